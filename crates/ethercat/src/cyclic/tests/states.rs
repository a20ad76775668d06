//! The way to OP and back.

use super::*;

#[test]
fn the_way_to_op_locks_programs_sync_and_passes_safe_op() {
    let mut bench = Bench::new(3);
    for station in 0x1001..0x1003 {
        bench.segment().registers.insert((station, 0x092C), 0x8000_0100u32.to_le_bytes().to_vec());
    }
    assert_eq!(bench.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    let segment = bench.segment();
    for station in 0x1000..0x1003 {
        let register = |register| &segment.registers[&(station, register)];
        assert_eq!(register(0x0981), &[3]);
        assert_eq!(u32_at(register(0x09A0), 0), 1_000_000);
        let start = u64::from_le_bytes(register(0x0990)[..].try_into().unwrap());
        assert_eq!(start % 1_000_000, 0);
        assert!(!segment.registers.contains_key(&(station, 0x09A4)));
    }
    let order = |register: u32| {
        segment.log.iter().position(|(command, at)| *command == 5 && at >> 16 == register).unwrap()
    };
    assert!(order(0x0980) < order(0x09A0) && order(0x09A0) < order(0x0990));
    assert!(order(0x0990) < order(0x0120), "SYNC0 is armed before SAFE-OP is asked");
    let states: Vec<u16> = bench.segment().status.clone();
    assert_eq!(states, [8, 8, 8]);
}

#[test]
fn what_keeps_a_segment_from_op_is_named() {
    let mut bench = Bench::new(3);
    bench.segment().registers.insert((0x1002, 0x092C), 5000u32.to_le_bytes().to_vec());
    let TransitionStatus::Failed(error) = bench.to(Goal::Op) else { panic!("{:?}", bench.bus.transition()) };
    assert!(matches!(error, TransitionError::NotLocked { position: 2, difference_ns: 5000, .. }), "{error}");

    let mut bench = Bench::new(3);
    bench.segment().refuses = Some(0x09A0);
    let TransitionStatus::Failed(error) = bench.to(Goal::Op) else { panic!("{:?}", bench.bus.transition()) };
    let words =
        "SubDevice 0 does not take register 0x09a0: working counter 0 where working counter 1 was expected";
    assert_eq!(error.to_string(), words);
    // A chip whose firmware hasn't read the last request takes no other: it is there, unlike one that is lost.
    for (is_there, words) in
        [(true, "SubDevice 0 does not take register 0x0120"), (false, "SubDevice 0 did not answer")]
    {
        let mut bench = Bench::in_op(3);
        bench.segment().refuses = is_there.then_some(0x0120);
        bench.segment().alive[0] = is_there;
        let TransitionStatus::Failed(error) = bench.to(Goal::Init) else {
            panic!("{:?}", bench.bus.transition())
        };
        assert!(error.to_string().starts_with(words), "{error}");
    }
    // 0x0980 may be refused.
    let mut bench = Bench::new(3);
    bench.segment().refuses = Some(0x0980);
    assert_eq!(bench.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
}

#[test]
fn a_refused_state_carries_code_cause_and_what_was_programmed() {
    let mut bench = Bench::new(2);
    bench.bus.request(Goal::Op, TransitionOptions::default(), bench.now);
    loop {
        bench.cycle();
        if let TransitionStatus::Moving { step: Step::Await(AlState::SafeOp), .. } = bench.bus.transition() {
            break;
        }
    }
    bench.segment().status[1] = 0x12;
    bench.segment().code = 0x001E;
    for _ in 0..3 {
        bench.cycle();
    }
    let TransitionStatus::Failed(error) = bench.bus.transition() else {
        panic!("{:?}", bench.bus.transition())
    };
    assert_eq!(
        error.to_string(),
        "SubDevice 1 refuses SAFE-OP and is in PRE-OP with error: 0x001e invalid input configuration; \
         probable cause: SM3 length differs from the mapped inputs; programmed: 20 bytes of outputs, \
         20 bytes of inputs, SYNC0 every 1000000 ns shifted by 0 ns"
    );
}

#[test]
fn any_exchange_lost_on_the_way_to_op_delays_it_at_most() {
    for bad in 1..60u64 {
        let mut bench = Bench::new(2);
        bench.segment().fault = Box::new(move |exchange, queue| {
            if exchange == bad {
                queue.clear();
            }
        });
        assert_eq!(bench.to(Goal::Op), TransitionStatus::Reached(Goal::Op), "exchange {bad}");
    }
}

#[test]
fn the_clean_end_leaves_op_then_switches_sync_off() {
    let mut bench = Bench::in_op(3);
    assert_eq!(bench.to(Goal::Init), TransitionStatus::Reached(Goal::Init));
    let segment = bench.segment();
    assert_eq!(segment.status, [1, 1, 1]);
    assert_eq!(segment.registers[&(0x1001, 0x0981)], [0]);
    let last = |register: u32, log: &[(u8, u32)]| {
        log.iter().rposition(|(command, at)| *command == 5 && at >> 16 == register).unwrap()
    };
    let first_ask =
        segment.log.iter().rposition(|(command, at)| *command == 5 && at >> 16 == 0x0981).unwrap();
    assert!(first_ask < last(0x0120, &segment.log));
}
