//! A million cycles ask for no memory.

#[path = "../benches/echo/mod.rs"]
mod echo;

use omnibase_ethercat::Exchange;
use omnibase_ethercat::cyclic::{AcyclicRequest, AcyclicWork, RegisterAccess};
use omnibase_ethercat::wire::HostTime;
use omnibase_host::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn a_million_cycles_allocate_nothing() {
    let (mut bus, mut image) = echo::operational(3, 16, |echo| echo);
    bus.link_mut().blind = true;
    let before = CountingAllocator::allocations_of_this_thread();
    for cycle in 0..1_000_000u64 {
        image.outputs.fill(cycle as u8);
        // Every mailbox would be looked at each 10 ms; this segment's are silent.
        let exchange = bus.exchange(&mut image, HostTime(20_000_000_000 + cycle * 1_000_000)).unwrap();
        assert_eq!(exchange, Exchange::Complete);
    }
    assert_eq!(CountingAllocator::allocations_of_this_thread() - before, 0);
}

#[test]
fn acyclic_work_and_its_answers_allocate_nothing_in_the_cycle() {
    let (mut bus, mut image) = echo::operational(3, 16, |echo| echo);
    let mut data = vec![0; 2];
    let mut inside = 0;
    for cycle in 0..1000u64 {
        let work = AcyclicWork::Registers { way: RegisterAccess::Read, register: 0x0130, data };
        bus.submit(AcyclicRequest { tag: cycle, position: 1, work }).unwrap();
        loop {
            let before = CountingAllocator::allocations_of_this_thread();
            bus.exchange(&mut image, HostTime(20_000_000_000 + cycle * 1_000_000)).unwrap();
            inside += CountingAllocator::allocations_of_this_thread() - before;
            if let Some(done) = bus.poll_completion() {
                assert_eq!((done.tag, done.result), (cycle, Ok(())));
                let AcyclicWork::Registers { data: buffer, .. } = done.work else { panic!("other work") };
                assert_eq!(buffer, [8, 0]);
                data = buffer;
                break;
            }
        }
    }
    assert_eq!(inside, 0);
}
