//! Each sensor dead, frozen, jumping, biased, reversed, with its clock off: named, and the pose as good as it says.

use omnibase_fusion::{SensorKind, Verdict};

use crate::faulty::{FAULTS, Fault, OUTSIDE, Outcome, companies, drive};

const WORLDS: std::ops::Range<u64> = 0..8;

/// What becomes of a fault in each company and each world.
fn all(fault: Option<Fault>) -> Vec<(&'static str, SensorKind, Outcome)> {
    std::thread::scope(|scope| {
        let worlds = WORLDS.map(|seed| {
            scope.spawn(move || {
                let all = companies().into_iter();
                all.map(|(name, sensors)| (name, sensors[0].kind, drive(&sensors, fault, seed)))
                    .collect::<Vec<_>>()
            })
        });
        let worlds: Vec<_> = worlds.collect();
        worlds.into_iter().flat_map(|world| world.join().expect("a world")).collect()
    })
}

fn mean(all: &[(&str, SensorKind, Outcome)], of: fn(&Outcome) -> f64) -> f64 {
    all.iter().map(|(_, _, outcome)| of(outcome)).sum::<f64>() / all.len() as f64
}

#[test]
fn each_fault_of_each_kind_is_named_alone_and_in_company_and_the_truth_stays_where_it_is_said_to_be() {
    for fault in std::iter::once(None).chain(FAULTS.map(Some)) {
        let outcomes = all(fault);
        for (name, kind, outcome) in &outcomes {
            assert_eq!(outcome.other, None, "{name}, {fault:?}: who is right is named");
            // A clock that is off is seen where what it tells changes: here of poses at once, of speeds in `clocks`.
            let is_unseen = matches!(fault, Some(Fault::Early | Fault::Late)) && *kind != SensorKind::Pose;
            if fault.is_none() || is_unseen {
                continue;
            }
            let (after_s, verdict) = outcome.named.unwrap_or_else(|| panic!("{name}, {fault:?}: named"));
            assert!(after_s <= 0.5, "{name}, {fault:?}: after {after_s} s");
            let expected = match fault {
                Some(Fault::Dead) => Verdict::Silent,
                Some(Fault::Frozen) => Verdict::Frozen,
                _ => Verdict::Contradicts,
            };
            assert_eq!(verdict, expected, "{name}, {fault:?}");
        }
        let (outside, nees) = (mean(&outcomes, |one| one.outside), mean(&outcomes, |one| one.nees));
        println!("{fault:?}: outside for {:.2} % of the time, NEES {nees:.2}", 100.0 * outside);
        if matches!(fault, Some(Fault::Early | Fault::Late)) {
            // Until it leans nobody knows of it.
            assert!(nees < 2.5 && outside < 0.1, "{fault:?}: NEES {nees}, outside {outside}");
        } else {
            // As often as three standard deviations of one axis, and what chance makes of so few worlds.
            assert!(outside <= 4.0 * OUTSIDE, "{fault:?}: outside for {outside} of the time");
        }
    }
}
