//! Two clocks that drift, and a line with jitter between them.

use omnibase_receive::ClockMap;
use proptest::prelude::*;

const MS: u64 = 1_000_000;

/// The other clock began 5 s later and runs so many ppm fast.
fn foreign_ns(ours_ns: u64, ppm: f64) -> u64 {
    ((ours_ns - 5000 * MS) as f64 * (1.0 + ppm * 1e-6)) as u64
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn with_answers_the_true_instant_lies_within_the_bound(
        ways in prop::collection::vec((100_000_u64..20 * MS, 100_000_u64..20 * MS), 20..400),
        ppm in -100.0..100.0,
    ) {
        let mut map = ClockMap::default();
        for (n, (there_ns, back_ns)) in ways.iter().enumerate() {
            let asked_ns = 6000 * MS + n as u64 * 50 * MS;
            let its_ns = foreign_ns(asked_ns + there_ns, ppm);
            map.after(its_ns, asked_ns);
            map.before(its_ns, asked_ns + there_ns + back_ns);
            let mapped = map.map(its_ns).unwrap();
            let off_ns = mapped.ours_ns.abs_diff(asked_ns + there_ns);
            prop_assert!(off_ns <= mapped.bound_ns.unwrap(), "{off_ns} beyond {mapped:?}");
        }
    }
}

#[test]
fn without_answers_the_least_delay_stands_for_the_offset() {
    let mut map = ClockMap::default();
    assert_eq!(map.map(1), None);
    for n in 0..100 {
        let ours_ns = 6000 * MS + n * 10 * MS;
        assert!(map.before(foreign_ns(ours_ns, 0.0), ours_ns + MS + n % 7 * MS));
    }
    let mapped = map.map(foreign_ns(7000 * MS, 0.0)).unwrap();
    assert_eq!((mapped.ours_ns, mapped.bound_ns), (7001 * MS, None), "at least 1 ms on its way");
}

#[test]
fn a_clock_that_jumps_is_left_out_until_it_stays() {
    let mut map = ClockMap::default();
    for n in 0..100 {
        assert!(map.before(1000 * MS + n * 10 * MS, 6000 * MS + n * 10 * MS));
    }
    // One message of the future, as of a clock that was set: nobody hears what is sent later.
    assert!(!map.before(900_000 * MS, 7000 * MS));
    assert!(map.before(2010 * MS, 7010 * MS));
    assert_eq!(map.map(2020 * MS).unwrap().ours_ns, 7020 * MS, "one changed nothing");
    let taken: Vec<bool> = (0..12).map(|n| map.before(900_000 * MS + n * MS, 7020 * MS + n * MS)).collect();
    assert_eq!(taken.iter().position(|taken| *taken), Some(9));
    assert_eq!(map.map(900_000 * MS).unwrap().ours_ns, 7020 * MS);
}

#[test]
fn answers_do_not_hide_that_a_clock_jumped() {
    let mut map = ClockMap::default();
    let mut told = |its_ns: u64, ours_ns: u64| {
        map.after(its_ns, ours_ns - MS);
        (map.before(its_ns, ours_ns + MS), map.map(its_ns).unwrap().ours_ns)
    };
    for n in 0..100 {
        assert!(told(1000 * MS + n * 10 * MS, 6000 * MS + n * 10 * MS).0);
    }
    // What follows something of ours fits a clock that was set forward, but what was heard doesn't.
    let after: Vec<_> = (0..12).map(|n| told(900_000 * MS + n * 10 * MS, 7000 * MS + n * 10 * MS)).collect();
    assert_eq!(after.iter().position(|(is_taken, _)| *is_taken), Some(9));
    assert_eq!(after[11].1, 7110 * MS);
}

#[test]
fn what_a_silence_held_up_is_as_old_as_it_is() {
    let mut map = ClockMap::default();
    for n in 0..300 {
        let ours_ns = 6000 * MS + n * 10 * MS;
        map.before(foreign_ns(ours_ns, 0.0), ours_ns + MS);
    }
    // A cable is out for a minute, and what was sent in its last 2 s comes at once.
    let back_ns = 69_000 * MS;
    for n in 0..200 {
        let was_ns = back_ns - 2000 * MS + n * 10 * MS;
        assert!(map.before(foreign_ns(was_ns, 0.0), back_ns + n));
        let mapped_ns = map.map(foreign_ns(was_ns, 0.0)).unwrap().ours_ns;
        assert!(mapped_ns.abs_diff(was_ns) < 8 * MS, "of {was_ns}: {mapped_ns}");
    }
}

#[test]
fn a_clock_that_was_set_a_little_is_known_anew_and_never_better_than_it_can_be() {
    let mut map = ClockMap::default();
    let mut told = |its_ns: u64, ours_ns: u64| {
        map.after(its_ns, ours_ns - MS / 10);
        map.before(its_ns, ours_ns + MS / 10);
        map.map(its_ns).unwrap()
    };
    for n in 0..100 {
        told(1000 * MS + n * 10 * MS, 6000 * MS + n * 10 * MS);
    }
    // Set by 5 ms, less than counts as a jump: the bounds of before and of now contradict each other.
    for n in 100..110 {
        let ours_ns = 6000 * MS + n * 10 * MS;
        let mapped = told(1005 * MS + n * 10 * MS, ours_ns);
        let off_ns = mapped.ours_ns.abs_diff(ours_ns);
        assert!(mapped.bound_ns.is_none_or(|bound_ns| off_ns <= bound_ns), "{n}: {off_ns} of {mapped:?}");
        assert!(n < 102 || mapped.bound_ns.is_some_and(|bound_ns| bound_ns < MS), "{n}: {mapped:?}");
    }
}
