//! EtherCrab: the segment to OP, and cycles with clock and AL status.

use crate::Course;
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
pub fn drive(port: Port, mark: Mark, course: Course) {
    // Its frames and lists live on the stack.
    let stack = std::thread::Builder::new().stack_size(64 << 20);
    stack.spawn(move || drive_here(port, mark, course)).expect("a thread").join().expect("its run");
}

fn drive_here(port: Port, mark: Mark, course: Course) {
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
            async_io::block_on(futures_lite::future::or(sized(&maindevice, mark, course), frames));
        }
        Port::Uring => {
            std::thread::spawn(move || {
                tx_rx_task_io_uring(Namespace::NEAR, tx, rx).map(drop).expect("io_uring");
            });
            async_io::block_on(sized(&maindevice, mark, course));
        }
    }
}

/// What it keeps has a size of its own: no larger than the segment asks for, or few drives pay for many.
async fn sized(maindevice: &MainDevice<'_>, mark: Mark, course: Course) {
    match course.drives {
        ..=8 => run::<8, 1024>(maindevice, mark, course).await,
        9..=32 => run::<32, 2048>(maindevice, mark, course).await,
        _ => run::<128, 8192>(maindevice, mark, course).await,
    }
}

async fn run<const SUBDEVICES: usize, const IMAGE: usize>(
    maindevice: &MainDevice<'_>,
    mut mark: Mark,
    course: Course,
) {
    let group = maindevice.init_single_group::<SUBDEVICES, IMAGE>(ethercat_now).await.expect("PRE-OP");
    let group = group.into_pre_op_pdi(maindevice).await.expect("a map");
    let group = group.into_safe_op(maindevice).await.expect("SAFE-OP");
    let group = group.request_into_op(maindevice).await.expect("asking for OP");
    loop {
        if group.tx_rx_sync_system_time(maindevice).await.expect("a cycle").all_op() {
            break;
        }
        async_io::Timer::after(Duration::from_millis(1)).await;
    }
    // A drive whose bytes two frames share counts in both.
    let right = |counter: u16| counter >= COUNT_PER_DRIVE * course.drives as u16;
    let [warm_up, timed, counted] = mark.halves(course);
    for _ in 0..warm_up {
        mark.pace();
        group.tx_rx_sync_system_time(maindevice).await.expect("a cycle");
    }
    for _ in 0..timed {
        mark.pace();
        let start = Instant::now();
        let response = group.tx_rx_sync_system_time(maindevice).await.expect("a cycle");
        mark.round_trip(start.elapsed().as_nanos() as u64);
        mark.judge(right(response.working_counter) && response.all_op());
    }
    let cpu = mark.begin();
    for _ in 0..counted {
        mark.pace();
        let response = group.tx_rx_sync_system_time(maindevice).await.expect("a cycle");
        mark.judge(right(response.working_counter) && response.all_op());
    }
    mark.end(cpu, counted);
    // Its threads wait for ever.
    std::process::exit(0);
}
