//! Distributed clocks: receive times, system time, drift control, SYNC pulses.

use crate::bench::{Bench, firmware, idle};
use core::time::Duration;
use omnibase_ethercat_sim::{Attachment, DcRegisters, EscConfig, Fault, Parent, Segment, SubDevice};
use omnibase_ethercat_wire::register::{self as reg, al_event};
use omnibase_ethercat_wire::{Address, Command, HostTime};
use std::sync::{Arc, Mutex};

fn clock(offset_ns: u64, drift_ppm: f64) -> EscConfig {
    EscConfig { dc_offset_ns: offset_ns, dc_drift_ppm: drift_ppm, ..EscConfig::default() }
}

fn device(offset_ns: u64, drift_ppm: f64) -> SubDevice {
    SubDevice::new(clock(offset_ns, drift_ppm), idle())
}

fn u32s(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// The difference register in ns, with its sign.
fn difference_ns(bench: &mut Bench, station: u16) -> i64 {
    let raw = bench.number_at(station, reg::DC_SYSTEM_TIME_DIFFERENCE, 4) as i64;
    if raw & 0x8000_0000 != 0 { -(raw & 0x7FFF_FFFF) } else { raw }
}

#[test]
fn receive_times_of_all_ports_are_latched_along_the_tree() {
    // 0 has a branch at port 3 (1) and goes on at port 1 (2); cables of 100, 200 and 300 ns.
    let cable = |port, cable_delay_ns| Attachment {
        parent: Parent::SubDevice { position: 0, port },
        entry_port: 0,
        cable_delay_ns,
    };
    let root = Attachment { parent: Parent::MainDevice, entry_port: 0, cable_delay_ns: 100 };
    let devices = vec![device(5_000_000_000, 0.0), device(7_000, 0.0), device(9_000, 0.0)];
    let mut bench = Bench::new(Segment::new(devices, vec![root, cable(3, 200), cable(1, 300)]).unwrap());
    bench.number(3);
    let sent = bench.send(Command::Bwr, Address::broadcast(reg::DC_RECEIVE_TIMES), &[0; 4]);
    assert_eq!(sent.counter, 3);
    let at = bench.now.0 + 100;
    let times = |bench: &mut Bench, station| u32s(&bench.fprd(station, reg::DC_RECEIVE_TIMES, 16).unwrap());
    // Chip crossings take 300 ns. Port 3: 300 out, 200 cable, 300 turn, 200 back. Port 1: 300 out, 300 cable,
    // 300 turn, 300 back later. The frame isn't seen at port 2.
    let first = 5_000_000_000 + at;
    let expected = [first, first + 1000 + 1200, 0, first + 1000].map(|time| time as u32);
    assert_eq!(times(&mut bench, 0x1001), expected);
    assert_eq!(times(&mut bench, 0x1002), [(7_000 + at + 500) as u32, 0, 0, 0]);
    assert_eq!(times(&mut bench, 0x1003), [(9_000 + at + 1000 + 300 + 300) as u32, 0, 0, 0]);
    // The processing unit's time has 64 bits.
    assert_eq!(bench.number_at(0x1001, reg::DC_RECEIVE_TIME_UNIT, 8), first);
}

#[test]
fn system_time_is_local_time_plus_offset_latched_at_the_frame() {
    let mut bench = Bench::single(clock(1_000, 0.0), idle());
    let time = bench.number_at(0x1001, reg::DC_SYSTEM_TIME, 8);
    assert_eq!(time, 1_000 + bench.now.0 + 100);
    bench.fpwr(0x1001, reg::DC_SYSTEM_TIME_OFFSET, &1_000_000_000_000u64.to_le_bytes());
    let time = bench.number_at(0x1001, reg::DC_SYSTEM_TIME, 8);
    assert_eq!(time, 1_000_000_000_000 + 1_000 + bench.now.0 + 100);
    // 50 ppm fast: 50 us a second.
    let mut bench = Bench::single(clock(0, 50.0), idle());
    bench.wait_us(1_000_000);
    let time = bench.number_at(0x1001, reg::DC_SYSTEM_TIME, 8);
    let host = bench.now.0 + 100;
    assert_eq!(time, host + host / 20_000);
}

#[test]
fn a_clock_starts_when_power_comes() {
    let mut bench = Bench::single(clock(1_000, 0.0), idle());
    bench.segment.inject(0, Fault::PowerCycle { off_for: Duration::from_millis(1) }).unwrap();
    let on_at = bench.segment.now().0 + 1_000_000;
    bench.wait_us(2000);
    bench.number(1);
    let time = bench.number_at(0x1001, reg::DC_SYSTEM_TIME, 8);
    assert_eq!(time, 1_000 + bench.now.0 + 100 - on_at);
}

#[test]
fn a_written_system_time_is_compared_with_the_own_one() {
    let mut bench = Bench::single(clock(0, 0.0), idle());
    bench.fpwr(0x1001, reg::DC_FILTER_DEPTHS, &[0, 12]);
    bench.fpwr(0x1001, reg::DC_SYSTEM_TIME_DELAY, &250u32.to_le_bytes());
    // 700 ns behind what it will be when the frame arrives: the own time, less the delay, is 450 ahead.
    let received = bench.now.0 + 10_000 + 100 - 700;
    assert_eq!(bench.fpwr(0x1001, reg::DC_SYSTEM_TIME, &received.to_le_bytes()), 1);
    assert_eq!(bench.number_at(0x1001, reg::DC_SYSTEM_TIME_DIFFERENCE, 4), 450);
    let received = bench.now.0 + 10_000 + 100;
    bench.fpwr(0x1001, reg::DC_SYSTEM_TIME, &received.to_le_bytes()[..4]);
    assert_eq!(bench.number_at(0x1001, reg::DC_SYSTEM_TIME_DIFFERENCE, 4), 0x8000_00FA, "250 behind");
    // Filter depth 4: a sixteenth of the difference at first.
    bench.fpwr(0x1001, reg::DC_SPEED_COUNTER_START, &0x1000u16.to_le_bytes());
    assert_eq!(bench.number_at(0x1001, reg::DC_SYSTEM_TIME_DIFFERENCE, 4), 0);
    bench.fpwr(0x1001, reg::DC_FILTER_DEPTHS, &[4, 12]);
    let received = bench.now.0 + 10_000 + 100 - 250 - 3200;
    bench.fpwr(0x1001, reg::DC_SYSTEM_TIME, &received.to_le_bytes());
    assert_eq!(bench.number_at(0x1001, reg::DC_SYSTEM_TIME_DIFFERENCE, 4), 200);
}

/// Three clocks, 50 ppm apart, offsets and delays set: the largest difference at `cycle_us` after `settle_ms`,
/// and the largest true deviation of system times.
fn lock(cycle_us: u64, settle_ms: u64) -> (i64, i64) {
    let devices = vec![device(123_456_789, 30.0), device(5_000, -20.0), device(77_000_000_000, 80.0)];
    let mut bench = Bench::new(Segment::line(devices).unwrap());
    bench.number(3);
    bench.send(Command::Bwr, Address::broadcast(reg::DC_FILTER_DEPTHS), &[0, 12]);
    bench.send(Command::Bwr, Address::broadcast(reg::DC_SPEED_COUNTER_START), &[0, 0x10]);
    bench.send(Command::Bwr, Address::broadcast(reg::DC_RECEIVE_TIMES), &[0; 4]);
    let reference = bench.number_at(0x1001, reg::DC_RECEIVE_TIME_UNIT, 8);
    for (station, delay) in [(0x1002, 400u32), (0x1003, 800)] {
        let own = bench.number_at(station, reg::DC_RECEIVE_TIME_UNIT, 8);
        let offset = reference.wrapping_add(u64::from(delay)).wrapping_sub(own);
        bench.fpwr(station, reg::DC_SYSTEM_TIME_OFFSET, &offset.to_le_bytes());
        bench.fpwr(station, reg::DC_SYSTEM_TIME_DELAY, &delay.to_le_bytes());
    }
    let (mut difference, mut deviation) = (0, 0);
    let cycles = (settle_ms + 1000) * 1000 / cycle_us;
    for n in 0..cycles {
        bench.wait_us(cycle_us - 30);
        let frmw = bench.send(Command::Frmw, Address::station(0x1001, reg::DC_SYSTEM_TIME), &[0; 8]);
        assert_eq!(frmw.counter, 3);
        if n * cycle_us > settle_ms * 1000 {
            for station in [0x1002, 0x1003] {
                difference = difference.max(difference_ns(&mut bench, station).abs());
            }
            let times: Vec<i64> = bench
                .segment
                .sub_devices()
                .iter()
                .map(|device| device.esc().system_time(bench.now).unwrap().0 as i64)
                .collect();
            deviation = deviation.max((times[1] - times[0]).abs()).max((times[2] - times[0]).abs());
        } else {
            bench.wait_us(20);
        }
    }
    (difference, deviation)
}

#[test]
fn clocks_50_ppm_apart_lock_at_any_cycle_and_stay() {
    // The register shows whole nanoseconds of a comparison that itself has one nanosecond of rounding.
    for (cycle_us, settle_ms, limit_ns) in [
        (125, 400, 3),
        (250, 400, 3),
        (1000, 400, 5),
        (4000, 500, 50),
        (20_000, 3000, 50),
        (100_000, 20_000, 500),
    ] {
        let (difference, deviation) = lock(cycle_us, settle_ms);
        assert!(difference <= limit_ns, "{cycle_us} us: register {difference} ns");
        assert!(deviation <= limit_ns, "{cycle_us} us: true deviation {deviation} ns");
    }
}

#[test]
fn a_step_of_50_ppm_never_exceeds_a_microsecond_at_1_khz() {
    let (difference, _) = lock(1000, 0);
    assert!((100..1000).contains(&difference), "{difference} ns");
}

#[test]
fn the_speed_counter_shows_the_correction() {
    let devices = vec![device(0, 0.0), device(0, 50.0)];
    let mut bench = Bench::new(Segment::line(devices).unwrap());
    bench.number(2);
    bench.fpwr(0x1002, reg::DC_SYSTEM_TIME_DELAY, &400u32.to_le_bytes());
    for _ in 0..2000 {
        bench.wait_us(990);
        bench.send(Command::Frmw, Address::station(0x1001, reg::DC_SYSTEM_TIME), &[0; 8]);
    }
    let shown = bench.number_at(0x1002, reg::DC_SPEED_COUNTER_DIFFERENCE, 2) as f64;
    // The datasheet's formula gives the deviation back: 50 ppm, within the resolution of the counter.
    let deviation = shown / (5.0 * (4096.0 + shown + 2.0) * (4096.0 - shown + 2.0));
    assert!((deviation - 50e-6).abs() < 0.2e-6, "{deviation}");
}

/// Which pulses came (AL event bits), and when (host ns).
type Pulses = Arc<Mutex<Vec<(u32, u64)>>>;

/// One chip whose firmware notes when SYNC0 and SYNC1 came, and acknowledges them.
fn sync_bench(drift_ppm: f64) -> (Bench, Pulses) {
    let pulses = Arc::new(Mutex::new(Vec::new()));
    let log = pulses.clone();
    let app = firmware(move |pdi, event, now: HostTime| {
        let sync = event.0 & (al_event::SYNC0 | al_event::SYNC1);
        if sync != 0 {
            log.lock().unwrap().push((sync, now.0));
            pdi.read(reg::DC_SYNC0_STATUS, &mut [0; 2]);
        }
        None
    });
    (Bench::single(clock(0, drift_ppm), app), pulses)
}

fn start_sync(bench: &mut Bench, start: u64, sync0_ns: u32, sync1_ns: u32, activation: u8) {
    bench.fpwr(0x1001, reg::DC_SYNC0_CYCLE, &[sync0_ns.to_le_bytes(), sync1_ns.to_le_bytes()].concat());
    bench.fpwr(0x1001, reg::DC_START_TIME, &start.to_le_bytes());
    assert_eq!(bench.fpwr(0x1001, reg::DC_ACTIVATION, &[activation]), 1);
}

#[test]
fn sync0_comes_at_its_start_time_and_then_every_cycle() {
    let (mut bench, pulses) = sync_bench(0.0);
    start_sync(&mut bench, 2_000_000, 250_000, 0, 3);
    assert_eq!(bench.number_at(0x1001, reg::DC_ACTIVATION_STATUS, 1), 1, "the first pulse is pending");
    assert_eq!(bench.number_at(0x1001, reg::DC_START_TIME, 8), 2_000_000);
    bench.now = HostTime(2_600_000);
    bench.segment.advance(bench.now);
    assert_eq!(*pulses.lock().unwrap(), [(4, 2_000_000), (4, 2_250_000), (4, 2_500_000)]);
    assert_eq!(bench.number_at(0x1001, reg::DC_ACTIVATION_STATUS, 1), 0);
    assert_eq!(bench.number_at(0x1001, reg::DC_START_TIME, 8), 2_750_000, "reads as the next SYNC0");
    assert_eq!(bench.fpwr(0x1001, reg::DC_ACTIVATION, &[0]), 1);
    bench.wait_us(1000);
    assert_eq!(pulses.lock().unwrap().len(), 3);
}

#[test]
fn pulses_follow_the_own_clock_not_the_hosts() {
    let (mut bench, pulses) = sync_bench(100.0);
    start_sync(&mut bench, 10_000_000, 1_000_000, 0, 3);
    bench.wait_us(50_000);
    let pulses = pulses.lock().unwrap();
    // System time 10 ms is host time 10 ms / 1.0001, rounded up.
    assert_eq!(pulses[0].1, 9_999_001);
    assert_eq!(pulses[30].1, 39_996_001);
}

#[test]
fn sync1_follows_sync0_by_its_cycle_time() {
    let (mut bench, pulses) = sync_bench(0.0);
    start_sync(&mut bench, 2_000_000, 500_000, 100_000, 7);
    bench.wait_us(1700);
    let expected = [(4, 2_000_000), (8, 2_100_000), (4, 2_500_000), (8, 2_600_000)];
    assert_eq!(pulses.lock().unwrap()[..4], expected);
    // Zero: together with SYNC0. More than a cycle: counted from the SYNC0 after the last SYNC1.
    let (mut bench, pulses) = sync_bench(0.0);
    start_sync(&mut bench, 2_000_000, 500_000, 0, 7);
    bench.wait_us(1700);
    assert_eq!(pulses.lock().unwrap()[..2], [(12, 2_000_000), (12, 2_500_000)]);
    let (mut bench, pulses) = sync_bench(0.0);
    start_sync(&mut bench, 2_000_000, 500_000, 600_000, 5);
    bench.wait_us(4000);
    assert_eq!(pulses.lock().unwrap()[..2], [(8, 2_600_000), (8, 3_600_000)]);
}

#[test]
fn a_cycle_of_zero_is_a_single_shot() {
    let (mut bench, pulses) = sync_bench(0.0);
    start_sync(&mut bench, 2_000_000, 0, 0, 3);
    bench.wait_us(10_000);
    assert_eq!(*pulses.lock().unwrap(), [(4, 2_000_000)]);
}

#[test]
fn a_start_time_in_the_past_never_comes_or_after_the_wrap() {
    let (mut bench, pulses) = sync_bench(0.0);
    start_sync(&mut bench, 500_000, 250_000, 0, 3);
    bench.wait_us(5_000_000);
    assert_eq!(*pulses.lock().unwrap(), []);

    let pulses = Arc::new(Mutex::new(Vec::new()));
    let log = pulses.clone();
    let app = firmware(move |_, event, now| {
        if event.0 & al_event::SYNC0 != 0 {
            log.lock().unwrap().push(now.0);
        }
        None
    });
    let mut bench = Bench::single(EscConfig { features: reg::FEATURE_DC, ..EscConfig::default() }, app);
    start_sync(&mut bench, 500_000, 1 << 31, 0, 3);
    bench.wait_us(5_000_000);
    assert_eq!(*pulses.lock().unwrap(), [500_000 + (1 << 32)]);
}

#[test]
fn sync_registers_belong_to_the_side_that_0x0980_says() {
    let (mut bench, _) = sync_bench(0.0);
    bench.pdi_write(reg::DC_ACTIVATION, &[3]);
    assert_eq!(bench.number_at(0x1001, reg::DC_ACTIVATION, 1), 0);
    assert_eq!(bench.fpwr(0x1001, reg::DC_CYCLIC_CONTROL, &[1]), 1);
    assert_eq!(bench.fpwr(0x1001, reg::DC_SYNC0_CYCLE, &[1]), 0);
    bench.pdi_write(reg::DC_SYNC0_CYCLE, &[1]);
    assert_eq!(bench.number_at(0x1001, reg::DC_SYNC0_CYCLE, 4), 1);
    // While it runs, the start time shows the next pulse and can't be written.
    assert_eq!(bench.fpwr(0x1001, reg::DC_CYCLIC_CONTROL, &[0]), 1);
    start_sync(&mut bench, 20_000_000, 1_000_000, 0, 3);
    assert_eq!(bench.fpwr(0x1001, reg::DC_START_TIME, &[9; 8]), 0);
}

#[test]
fn chips_whose_clock_is_switched_off_show_receive_times_only() {
    let config = EscConfig { dc_registers: DcRegisters::ReceiveTimesOnly, ..clock(5_000, 0.0) };
    let mut bench = Bench::single(config, idle());
    assert_eq!(bench.fpwr(0x1001, reg::DC_RECEIVE_TIMES, &[0; 4]), 1);
    let latched = bench.now.0 + 100 + 5_000;
    assert_eq!(bench.number_at(0x1001, reg::DC_RECEIVE_TIMES, 4), latched);
    for register in
        [reg::DC_SYSTEM_TIME, reg::DC_RECEIVE_TIME_UNIT, reg::DC_SYSTEM_TIME_OFFSET, reg::DC_ACTIVATION]
    {
        assert_eq!(bench.fprd(0x1001, register, 4), None, "0x{register:04x}");
        assert_eq!(bench.fpwr(0x1001, register, &[0; 4]), 0, "0x{register:04x}");
    }
}

#[test]
fn chips_without_clocks_have_no_clock_registers_but_pass_frames_on() {
    let none = EscConfig { features: 0, ..EscConfig::default() };
    let devices = vec![device(0, 0.0), SubDevice::new(none, idle()), device(0, 0.0)];
    let mut bench = Bench::new(Segment::line(devices).unwrap());
    bench.number(3);
    let frmw = bench.send(Command::Frmw, Address::station(0x1001, reg::DC_SYSTEM_TIME), &[0; 8]);
    assert_eq!(frmw.counter, 2);
    assert_eq!(bench.send(Command::Bwr, Address::broadcast(reg::DC_RECEIVE_TIMES), &[0; 4]).counter, 2);
    assert_eq!(bench.fprd(0x1002, reg::DC_RECEIVE_TIMES, 4), None);
    assert_eq!(bench.segment.sub_devices()[1].esc().system_time(bench.now), None);
}
