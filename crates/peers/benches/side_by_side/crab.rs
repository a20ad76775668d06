//! EtherCrab: the segment to OP, and cycles with clock and AL status.

use crate::DRIVES;
use crate::mark::Mark;
use ethercrab::std::{ethercat_now, tx_rx_task, tx_rx_task_io_uring};
use ethercrab::{MainDevice, MainDeviceConfig, PduStorage, Timeouts};
use omnibase_host::Namespace;
use std::time::{Duration, Instant};

const MAX_FRAMES: usize = 16;
const MAX_PDU_DATA: usize = PduStorage::element_size(1100);
/// Working counter of LRW for a drive: 1 for its inputs, 2 for its outputs.
const COUNT_PER_DRIVE: u16 = 3;

/// How its frames reach the cable.
#[derive(Clone, Copy, Debug)]
pub enum Port {
    /// A task beside the cycle in the same thread.
    Task,
    /// A thread with io_uring, its fastest port.
    Uring,
}

/// EtherCrab as a contestant.
pub fn drive(port: Port, mark: Mark, cycles: u64) {
    // Its frames and lists live on the stack.
    let stack = std::thread::Builder::new().stack_size(64 << 20);
    stack.spawn(move || drive_here(port, mark, cycles)).expect("a thread").join().expect("its run");
}

fn drive_here(port: Port, mark: Mark, cycles: u64) {
    let storage: &'static PduStorage<MAX_FRAMES, MAX_PDU_DATA> = Box::leak(Box::new(PduStorage::new()));
    let (tx, rx, pdu_loop) = storage.try_split().expect("its storage");
    let timeouts = Timeouts {
        wait_loop_delay: Duration::from_millis(1),
        state_transition: Duration::from_secs(10),
        pdu: Duration::from_millis(500),
        eeprom: Duration::from_secs(2),
        mailbox_response: Duration::from_secs(2),
        ..Timeouts::default()
    };
    let config = MainDeviceConfig { dc_static_sync_iterations: 100, ..MainDeviceConfig::default() };
    let maindevice = MainDevice::new(pdu_loop, timeouts, config);
    match port {
        Port::Task => {
            let frames = tx_rx_task(Namespace::NEAR, tx, rx).expect("the interface");
            let frames = async {
                panic!("its frame task ended: {:?}", frames.await.err());
            };
            async_io::block_on(futures_lite::future::or(run(&maindevice, mark, cycles), frames));
        }
        Port::Uring => {
            std::thread::spawn(move || {
                tx_rx_task_io_uring(Namespace::NEAR, tx, rx).map(drop).expect("io_uring");
            });
            async_io::block_on(run(&maindevice, mark, cycles));
        }
    }
}

async fn run(maindevice: &MainDevice<'_>, mut mark: Mark, cycles: u64) {
    let group = maindevice.init_single_group::<8, 1024>(ethercat_now).await.expect("PRE-OP");
    let group = group.into_pre_op_pdi(maindevice).await.expect("a map");
    let group = group.into_safe_op(maindevice).await.expect("SAFE-OP");
    let group = group.request_into_op(maindevice).await.expect("asking for OP");
    loop {
        if group.tx_rx_sync_system_time(maindevice).await.expect("a cycle").all_op() {
            break;
        }
        async_io::Timer::after(Duration::from_millis(1)).await;
    }
    let right = |counter: u16| counter == COUNT_PER_DRIVE * DRIVES as u16;
    let [warm_up, timed, counted] = Mark::halves(cycles);
    for _ in 0..warm_up {
        group.tx_rx_sync_system_time(maindevice).await.expect("a cycle");
    }
    for _ in 0..timed {
        let start = Instant::now();
        let response = group.tx_rx_sync_system_time(maindevice).await.expect("a cycle");
        mark.round_trip(start.elapsed().as_nanos() as u64);
        mark.judge(right(response.working_counter) && response.all_op());
    }
    let cpu = mark.begin();
    for _ in 0..counted {
        let response = group.tx_rx_sync_system_time(maindevice).await.expect("a cycle");
        mark.judge(right(response.working_counter) && response.all_op());
    }
    mark.end(cpu, counted);
    // Its threads wait for ever.
    std::process::exit(0);
}
