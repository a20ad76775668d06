//! Work beside the cycle.

use super::*;

#[test]
fn registers_are_read_and_written_beside_the_cycle_without_changing_it() {
    let mut bench = Bench::in_op(3);
    let sent = bench.segment().sent;
    let cycles = bench.bus.counters().cycles;
    let request = |tag, way, data| AcyclicRequest {
        tag,
        position: 1,
        work: AcyclicWork::Registers { way, register: 0x0982, data },
    };
    bench.bus.submit(request(1, RegisterAccess::Write, vec![7, 8])).unwrap();
    bench.bus.submit(request(2, RegisterAccess::Read, vec![0, 0])).unwrap();
    let mut completions = Vec::new();
    for _ in 0..10 {
        assert_eq!(bench.cycle(), Exchange::Complete);
        completions.extend(bench.bus.poll_completion());
    }
    assert_eq!(completions.len(), 2);
    assert_eq!(completions[1].tag, 2);
    assert_eq!(completions[1].result, Ok(()));
    let AcyclicWork::Registers { data, .. } = &completions[1].work else { panic!() };
    assert_eq!(data, &[7, 8]);
    let frames = bench.segment().sent - sent;
    assert_eq!(frames, bench.bus.counters().cycles - cycles, "one frame a cycle, as before");
}

#[test]
fn acyclic_requests_that_cannot_be_served_are_refused_by_name() {
    let mut bench = Bench::new(1);
    let work = || AcyclicWork::Registers { way: RegisterAccess::Read, register: 0, data: vec![0; 100] };
    bench.bus.submit(AcyclicRequest { tag: 1, position: 5, work: work() }).unwrap();
    bench.bus.submit(AcyclicRequest { tag: 2, position: 0, work: work() }).unwrap();
    let mailbox =
        crate::mailbox::MailboxRequest::upload(crate::wire::coe::ObjectAddress::new(0x1000, 0), vec![]);
    bench.bus.submit(AcyclicRequest { tag: 3, position: 0, work: AcyclicWork::Mailbox(mailbox) }).unwrap();
    bench.cycle();
    let results: Vec<_> =
        core::iter::from_fn(|| bench.bus.poll_completion()).map(|done| done.result).collect();
    assert_eq!(
        results,
        [
            Err(AcyclicError::NoSubDevice { position: 5 }),
            Err(AcyclicError::TooLong { found: 100, limit: 32 }),
            Err(AcyclicError::NoMailbox { position: 0 }),
        ]
    );
    for tag in 0..CAPACITY as u64 {
        bench.bus.submit(AcyclicRequest { tag, position: 0, work: work() }).unwrap();
    }
    assert!(bench.bus.submit(AcyclicRequest { tag: 0, position: 0, work: work() }).is_err());
}

#[test]
fn a_register_that_nobody_takes_ends_in_an_error() {
    let mut bench = Bench::new(1);
    bench.segment().refuses = Some(0x0982);
    let work = AcyclicWork::Registers { way: RegisterAccess::Write, register: 0x0982, data: vec![1] };
    bench.bus.submit(AcyclicRequest { tag: 1, position: 0, work }).unwrap();
    let done = (0..1000).find_map(|_| {
        bench.cycle();
        bench.bus.poll_completion()
    });
    assert!(matches!(done.unwrap().result, Err(AcyclicError::Register { register: 0x0982, .. })));
}
