//! Each sensor dead, frozen, jumping, biased, reversed, with its clock off: named, and the pose as good as it says.

use omnibase_fusion::{SensorKind, Verdict};

use crate::faulty::{DriveProfile, FAULTS, Fault, OUTSIDE, Outcome, companies, drive_for};

/// What becomes of a fault in each company and each of so many worlds.
fn all(
    worlds: u64,
    way: (f64, DriveProfile),
    fault: Option<Fault>,
) -> Vec<(&'static str, SensorKind, Outcome)> {
    std::thread::scope(|scope| {
        let worlds = (0..worlds).map(|seed| {
            scope.spawn(move || {
                let all = companies().into_iter();
                all.map(|(name, sensors)| (name, sensors[0].kind, drive_for(way, &sensors, fault, seed)))
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
        let outcomes = all(8, (8.0, DriveProfile::Wanders), fault);
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

/// Faults lead the wheels, and what they do then must not excuse the fault.
#[test]
fn who_is_followed_by_a_control_law_leads_it_nowhere_when_it_lies_and_no_other_is_named() {
    for fault in std::iter::once(None).chain(FAULTS.map(Some)) {
        let outcomes = all(2, (12.0, DriveProfile::Followed), fault);
        let is_clock = matches!(fault, Some(Fault::Early | Fault::Late));
        for (name, kind, outcome) in &outcomes {
            assert_eq!(outcome.other, None, "{name}, {fault:?}: who is right is named");
            // The clock of a gyro alone: as if wheels lagged.
            assert!(outcome.led_m < 0.04, "{name}, {fault:?}: {} m from its way", outcome.led_m);
            // Beside poses nobody else is needed.
            let has_poses = name.contains("poses") && *kind != SensorKind::Pose;
            assert!(!(has_poses && outcome.stood), "{name}, {fault:?}: it stood");
            let is_safe = outcome.named.is_some() || outcome.stood || fault.is_none() || is_clock;
            assert!(is_safe, "{name}, {fault:?}: it drives on, and nobody is named");
        }
        let (outside, nees) = (mean(&outcomes, |one| one.outside), mean(&outcomes, |one| one.nees));
        println!("{fault:?}: outside for {:.2} % of the time, NEES {nees:.2}", 100.0 * outside);
        let (most_outside, most_nees) = if is_clock { (0.15, 2.5) } else { (4.0 * OUTSIDE, 1.3) };
        assert!(outside <= most_outside && nees <= most_nees, "{fault:?}: {outside}, {nees}");
    }
}
