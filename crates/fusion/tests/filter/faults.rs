//! Each sensor dead, frozen, jumping, biased, reversed, with its clock off: named, and the pose as good as it says.

use omnibase_fusion::{SensorKind, Verdict};

use crate::faulty::{FAULTS, Fault, companies, drive};

#[test]
fn each_fault_of_each_kind_is_named_alone_and_in_company_and_the_truth_stays_where_it_is_said_to_be() {
    for (name, sensors) in companies() {
        let sound = drive(&sensors, None, 9);
        assert!(sound.other.is_none(), "{name}: {sound:?} without a fault");
        for fault in FAULTS {
            // A clock that is off is seen where what it tells changes: here of poses, of speeds in `clocks`.
            if matches!(fault, Fault::Early | Fault::Late) && sensors[0].kind != SensorKind::Pose {
                continue;
            }
            let outcome = drive(&sensors, Some(fault), 9);
            println!("{name}, {fault:?}: {outcome:?}");
            let (after_s, verdict) = outcome.named.expect("named");
            assert!(after_s <= 0.5, "{name}, {fault:?}: after {after_s} s");
            let expected = match fault {
                Fault::Dead => Verdict::Silent,
                Fault::Frozen => Verdict::Frozen,
                _ => Verdict::Contradicts,
            };
            assert_eq!(verdict, expected, "{name}, {fault:?}");
            assert_eq!(outcome.other, None, "{name}, {fault:?}: who is right is named");
            // Of all that follows, axis by axis; in some worlds more without a fault as well (`--example faults`).
            assert!(outcome.sigmas <= 3.0, "{name}, {fault:?}: {} sigma", outcome.sigmas);
        }
    }
}
