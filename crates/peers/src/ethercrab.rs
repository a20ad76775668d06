//! EtherCrab drives a segment of CiA 402 servos: to OP with SYNC0, process data, SDOs, dictionary.

use crate::makers::MakersCommand;
use ethercrab::std::{ethercat_now, tx_rx_task};
use ethercrab::subdevice_group::{CycleInfo, DcConfiguration};
use ethercrab::{
    DcSync, MainDevice, MainDeviceConfig, ObjectDescriptionListQuery, PduStorage, RegisterAddress,
    RetryBehaviour, SubDeviceRef, Timeouts,
};
use std::time::{Duration, Instant};

/// Most SubDevices that one run can drive.
const MAX_SUBDEVICES: usize = 32;
const MAX_FRAMES: usize = 32;
const MAX_PDU_DATA: usize = PduStorage::element_size(1100);
const MAX_IMAGE: usize = 4096;
/// CiA 402: the bits of the status word that name the state, and three states.
const STATE_MASK: u16 = 0x6F;
const WALK: [(u16, u16); 3] = [(0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)];

/// What a run did.
#[derive(Debug)]
pub struct Report {
    /// The SubDevices' names as EtherCrab read them.
    pub names: Vec<String>,
    /// Objects in the first servo's dictionary.
    pub dictionary: usize,
    /// The largest 0x092C before SYNC0 was armed, ns.
    pub clock_difference_ns: u32,
    /// Cycles exchanged in OP.
    pub cycles: u64,
    /// Working counter of the last cycle.
    pub working_counter: u16,
    /// Round trips of the cycles in OP, ns, sorted.
    pub round_trips_ns: Vec<u64>,
}

/// A step that failed, in words.
pub type Failure = String;

fn at<E: std::fmt::Debug>(step: &str) -> impl Fn(E) -> Failure + '_ {
    move |error| format!("EtherCrab: {step}: {error:?}")
}

/// Drives the servos behind `interface` from INIT to OP and `cycles` cycles further, then back to SAFE-OP.
pub fn drive(interface: &str, cycle: Duration, cycles: u64) -> Result<Report, Failure> {
    // Its object lists and frames live on the stack, many copies of them in a build without optimisation.
    let stack = std::thread::Builder::new().stack_size(64 << 20);
    std::thread::scope(|scope| {
        let worker = stack.spawn_scoped(scope, || drive_here(interface, cycle, cycles));
        worker.map_err(at("starting its thread"))?.join().map_err(at("its thread"))?
    })
}

fn drive_here(interface: &str, cycle: Duration, cycles: u64) -> Result<Report, Failure> {
    // EtherCrab borrows its storage for as long as a MainDevice lives; a run needs one, and is soon over.
    let storage: &'static PduStorage<MAX_FRAMES, MAX_PDU_DATA> = Box::leak(Box::new(PduStorage::new()));
    let (tx, rx, pdu_loop) = storage.try_split().map_err(at("splitting the storage"))?;
    let timeouts = Timeouts {
        wait_loop_delay: Duration::from_millis(1),
        state_transition: Duration::from_secs(10),
        pdu: Duration::from_millis(500),
        eeprom: Duration::from_secs(1),
        mailbox_response: Duration::from_secs(2),
        ..Timeouts::default()
    };
    let config =
        MainDeviceConfig { dc_static_sync_iterations: 1000, retry_behaviour: RetryBehaviour::Count(3) };
    let maindevice = MainDevice::new(pdu_loop, timeouts, config);
    let frames = tx_rx_task(interface, tx, rx).map_err(at("opening the interface"))?;
    let frames = async { Err(format!("EtherCrab: the frame task ended: {:?}", frames.await.err())) };
    async_io::block_on(futures_lite::future::or(run(&maindevice, cycle, cycles), frames))
}

async fn run(maindevice: &MainDevice<'_>, cycle: Duration, cycles: u64) -> Result<Report, Failure> {
    let mut group = maindevice
        .init_single_group::<MAX_SUBDEVICES, MAX_IMAGE>(ethercat_now)
        .await
        .map_err(at("start to PRE-OP"))?;
    let names: Vec<String> = group.iter(maindevice).map(|servo| servo.name().to_owned()).collect();

    let mut dictionary = 0;
    for (position, servo) in group.iter(maindevice).enumerate() {
        if position == 0 || position + 1 == names.len() {
            dictionary = check_mailbox(&servo).await?;
        }
        servo.sdo_write(0x6060, 0, 9u8).await.map_err(at("SDO write 6060:00"))?;
        servo.sdo_write(0x1C32, 1, 2u16).await.map_err(at("SDO write 1C32:01"))?;
    }
    for mut servo in group.iter_mut(maindevice) {
        servo.set_dc_sync(DcSync::Sync0);
    }

    let group = group.into_pre_op_pdi(maindevice).await.map_err(at("mapping"))?;
    let mut clock_difference_ns = u32::MAX;
    let deadline = Instant::now() + Duration::from_secs(10);
    while clock_difference_ns >= 1000 {
        if Instant::now() > deadline {
            return Err(format!("EtherCrab: clocks still {clock_difference_ns} ns apart after 10 s"));
        }
        for _ in 0..100 {
            group.tx_rx_sync_system_time(maindevice).await.map_err(at("clock frames"))?;
            async_io::Timer::after(cycle).await;
        }
        clock_difference_ns = 0;
        for servo in group.iter(maindevice) {
            let raw: u32 = servo
                .register_read(RegisterAddress::DcSystemTimeDifference)
                .await
                .map_err(at("reading 0x092C"))?;
            clock_difference_ns = clock_difference_ns.max(raw & 0x7FFF_FFFF);
        }
    }

    let dc = DcConfiguration {
        start_delay: Duration::from_millis(100),
        sync0_period: cycle,
        sync0_shift: cycle / 2,
    };
    let group = group.configure_dc_sync(maindevice, dc).await.map_err(at("arming SYNC0"))?;
    let group = group.into_safe_op(maindevice).await.map_err(at("SAFE-OP"))?;
    let group = group.request_into_op(maindevice).await.map_err(at("asking for OP"))?;

    let deadline = Instant::now() + Duration::from_secs(10);
    loop {
        let started = Instant::now();
        let response = group.tx_rx_dc(maindevice).await.map_err(at("cycle before OP"))?;
        if response.all_op() {
            break;
        }
        if started > deadline {
            return Err(format!("EtherCrab: not in OP after 10 s: {:?}", response.subdevice_states));
        }
        let CycleInfo { next_cycle_wait, .. } = response.extra;
        async_io::Timer::at(started + next_cycle_wait).await;
    }

    let mut report = Report {
        names,
        dictionary,
        clock_difference_ns,
        cycles: 0,
        working_counter: 0,
        round_trips_ns: Vec::with_capacity(cycles as usize),
    };
    let mut walk = WALK.iter().peekable();
    for number in 0..cycles.max(1000) {
        let started = Instant::now();
        if let Some((control_word, _)) = walk.peek() {
            for servo in group.iter(maindevice) {
                servo.outputs_raw_mut()[..2].copy_from_slice(&control_word.to_le_bytes());
            }
        }
        let response = group.tx_rx_dc(maindevice).await.map_err(at("cycle in OP"))?;
        report.round_trips_ns.push(started.elapsed().as_nanos() as u64);
        report.cycles = number + 1;
        report.working_counter = response.working_counter;
        if let Some((_, wanted)) = walk.peek() {
            let reached = group.iter(maindevice).all(|servo| {
                let inputs = servo.inputs_raw();
                u16::from_le_bytes([inputs[0], inputs[1]]) & STATE_MASK == *wanted
            });
            if reached {
                walk.next();
            }
        } else if number >= cycles {
            break;
        }
        async_io::Timer::at(started + response.extra.next_cycle_wait).await;
    }
    if let Some((control_word, wanted)) = walk.next() {
        return Err(format!("EtherCrab: control word {control_word:#x} did not lead to status {wanted:#x}"));
    }
    report.round_trips_ns.sort_unstable();
    group.into_safe_op(maindevice).await.map_err(at("back to SAFE-OP"))?;
    Ok(report)
}

/// Brings the SubDevices behind `interface` to OP with their makers' commands of up to four bytes (EtherCrab 0.7.1 sends no
/// longer ones); how many SubDevices, and how many commands.
pub fn bring_up_with(interface: &str, commands: &[MakersCommand]) -> Result<(usize, usize), Failure> {
    let stack = std::thread::Builder::new().stack_size(64 << 20);
    std::thread::scope(|scope| {
        let worker = stack.spawn_scoped(scope, || bring_up_here(interface, commands));
        worker.map_err(at("starting its thread"))?.join().map_err(at("its thread"))?
    })
}

fn bring_up_here(interface: &str, commands: &[MakersCommand]) -> Result<(usize, usize), Failure> {
    let storage: &'static PduStorage<MAX_FRAMES, MAX_PDU_DATA> = Box::leak(Box::new(PduStorage::new()));
    let (tx, rx, pdu_loop) = storage.try_split().map_err(at("splitting the storage"))?;
    let timeouts = Timeouts {
        wait_loop_delay: Duration::from_millis(1),
        state_transition: Duration::from_secs(10),
        pdu: Duration::from_millis(500),
        eeprom: Duration::from_secs(1),
        mailbox_response: Duration::from_secs(2),
        ..Timeouts::default()
    };
    let config = MainDeviceConfig { dc_static_sync_iterations: 0, retry_behaviour: RetryBehaviour::Count(3) };
    let maindevice = MainDevice::new(pdu_loop, timeouts, config);
    let frames = tx_rx_task(interface, tx, rx).map_err(at("opening the interface"))?;
    let frames = async { Err(format!("EtherCrab: the frame task ended: {:?}", frames.await.err())) };
    let work = async {
        let group = maindevice
            .init_single_group::<MAX_SUBDEVICES, MAX_IMAGE>(ethercat_now)
            .await
            .map_err(at("start to PRE-OP"))?;
        let mut sent = 0;
        for (position, one) in (0..).zip(group.iter(&maindevice)) {
            for command in commands.iter().filter(|command| command.position == position) {
                let (index, subindex) = (command.index, command.subindex);
                match command.data[..] {
                    [byte] => one.sdo_write(index, subindex, byte).await,
                    [low, high] => one.sdo_write(index, subindex, u16::from_le_bytes([low, high])).await,
                    [a, b, c, d] => one.sdo_write(index, subindex, u32::from_le_bytes([a, b, c, d])).await,
                    _ => continue,
                }
                .map_err(at("a maker's command"))?;
                sent += 1;
            }
        }
        let group = group.into_pre_op_pdi(&maindevice).await.map_err(at("mapping"))?;
        let group = group.into_safe_op(&maindevice).await.map_err(at("SAFE-OP"))?;
        let group = group.request_into_op(&maindevice).await.map_err(at("asking for OP"))?;
        let deadline = Instant::now() + Duration::from_secs(20);
        loop {
            let response = group.tx_rx(&maindevice).await.map_err(at("cycle before OP"))?;
            if response.all_op() {
                return Ok((group.len(), sent));
            }
            if Instant::now() > deadline {
                return Err(format!("EtherCrab: not in OP after 20 s: {:?}", response.subdevice_states));
            }
            async_io::Timer::after(Duration::from_millis(5)).await;
        }
    };
    async_io::block_on(futures_lite::future::or(work, frames))
}

/// SDOs of all lengths that EtherCrab can send and read, an abort, and the dictionary; the number of objects.
async fn check_mailbox<S: std::ops::Deref<Target = ethercrab::SubDevice>>(
    servo: &SubDeviceRef<'_, S>,
) -> Result<usize, Failure> {
    let wrong = |what: &str, found: String| Err(format!("EtherCrab: {what}: found {found}"));
    for value in [8i8, 9] {
        servo.sdo_write(0x6060, 0, value).await.map_err(at("SDO write of 1 byte"))?;
        let found: i8 = servo.sdo_read(0x6060, 0).await.map_err(at("SDO read of 1 byte"))?;
        if found != value {
            return wrong("6060:00", found.to_string());
        }
    }
    servo.sdo_write(0x6081, 0, 123_456u32).await.map_err(at("SDO write of 4 bytes"))?;
    let found: u32 = servo.sdo_read(0x6081, 0).await.map_err(at("SDO read of 4 bytes"))?;
    if found != 123_456 {
        return wrong("6081:00", found.to_string());
    }
    // More than four bytes: normal transfers. EtherCrab 0.7.1 takes the command specifier 0, with which the standard
    // answers an upload segment (ETG.1000.6, "Upload SDO segment response"), for invalid, and sends no download of
    // more than four bytes: segments and long downloads are SOEM's part.
    let five: [u8; 5] = servo.sdo_read(0x2F02, 0).await.map_err(at("SDO read of 5 bytes"))?;
    if five != [1, 2, 3, 4, 5] {
        return wrong("2F02:00", format!("{five:?}"));
    }
    let eight: u64 = servo.sdo_read(0x2F03, 0).await.map_err(at("SDO read of 8 bytes"))?;
    if eight != 0 {
        return wrong("2F03:00", eight.to_string());
    }
    let words = servo.sdo_read_array::<u16, 16>(0x2F04).await.map_err(at("SDO read of an array"))?;
    if !words.iter().copied().eq(1..=16) {
        return wrong("2F04", format!("{words:?}"));
    }
    if servo.sdo_read::<u8>(0x5FFF, 0).await.is_ok() {
        return wrong("5FFF:00", "a value, though there is no such object".into());
    }
    let objects = servo
        .sdo_info_object_description_list(ObjectDescriptionListQuery::All)
        .await
        .map_err(at("object list"))?
        .ok_or("EtherCrab: no object list")?;
    if !objects.contains(&0x6041) {
        return wrong("object list without 6041", objects.len().to_string());
    }
    Ok(objects.len())
}
