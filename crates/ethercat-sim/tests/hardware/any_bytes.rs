//! Whatever comes by the cable or from the firmware: no panic, the length stays, and time goes on.

use crate::bench::{Bench, firmware};
use core::time::Duration;
use omnibase_ethercat_sim::{EscConfig, Fault, Segment, SubDevice};
use omnibase_ethercat_wire::frame::{FrameBuilder, MAX_FRAME};
use omnibase_ethercat_wire::{Address, Command, HostTime};

/// splitmix64, seed stated by the test.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }

    fn bytes(&mut self, length: usize) -> Vec<u8> {
        (0..length).map(|_| self.next() as u8).collect()
    }

    /// An address where something is, or anything.
    fn register(&mut self) -> u16 {
        const PLACES: [u16; 14] = [
            0x0000, 0x0010, 0x0100, 0x0120, 0x0200, 0x0300, 0x0400, 0x0500, 0x0600, 0x0800, 0x0900, 0x0980,
            0x0F00, 0x1000,
        ];
        match self.below(4) {
            0 => self.next() as u16,
            _ => PLACES[self.below(14) as usize] + self.below(0x60) as u16,
        }
    }
}

fn bench(seed: u64) -> Bench {
    let chip = |n: u64| {
        let mut random = Random(seed + n);
        let config = EscConfig {
            fmmu_count: random.next() as u8,
            sm_count: random.next() as u8,
            ram_kib: random.below(12) as u8,
            features: random.next() as u16 & 0x060D,
            port_descriptor: 0xFF,
            sii: random.bytes(200),
            dc_offset_ns: random.next(),
            dc_drift_ppm: random.below(400) as f64 - 200.0,
            ..EscConfig::default()
        };
        // Firmware that hits keys.
        let app = firmware(move |pdi, _, now| {
            for _ in 0..random.below(4) {
                let (register, length) = (random.register(), random.below(40) as usize);
                if random.below(2) == 0 {
                    pdi.read(register, &mut vec![0; length]);
                } else {
                    pdi.write(register, &random.bytes(length));
                }
            }
            Some(now + Duration::from_nanos(random.below(300_000)))
        });
        SubDevice::new(config, app)
    };
    Bench::new(Segment::line((0..3).map(chip).collect()).unwrap())
}

fn frame(random: &mut Random) -> Vec<u8> {
    let mut frame = FrameBuilder::new();
    for _ in 0..1 + random.below(4) {
        let command = Command::ALL[random.below(15) as usize];
        let address = match command.address(0) {
            Address::Position { .. } => Address::position(random.below(4) as u16, random.register()),
            Address::Station { .. } => Address::station(random.below(3) as u16, random.register()),
            Address::Broadcast { .. } => Address::broadcast(random.register()),
            Address::Logical(_) => Address::Logical((random.below(300) as u32).wrapping_sub(50)),
        };
        let length = random.below(300) as usize;
        // Small numbers make more sense to registers than large ones.
        let mut data = random.bytes(length);
        if random.below(2) == 0 {
            data.iter_mut().for_each(|byte| *byte &= 0x07);
        }
        if frame.push(command, 0, address, &data).is_err() {
            break;
        }
    }
    let mut bytes = frame.bytes().to_vec();
    for _ in 0..random.below(6).saturating_sub(3) {
        let at = random.below(bytes.len() as u64) as usize;
        bytes[at] = random.next() as u8;
    }
    if random.below(20) == 0 {
        bytes.truncate(random.below(bytes.len() as u64) as usize);
    }
    bytes
}

#[test]
fn no_frame_and_no_firmware_brings_it_down() {
    for seed in 0..40 {
        let mut random = Random(seed);
        let mut bench = bench(seed * 1000);
        for _ in 0..500 {
            let mut bytes = frame(&mut random);
            let length = bytes.len();
            bench.now = HostTime(bench.now.0 + random.below(1_000_000));
            if let Some(back) = bench.segment.process(&mut bytes, bench.now) {
                assert!(back > bench.now);
            }
            assert_eq!(bytes.len(), length);
            if random.below(50) == 0 {
                let port = random.below(2) as u8;
                let fault = match random.below(6) {
                    0 => Fault::PowerCycle { off_for: Duration::from_micros(random.below(3000)) },
                    1 => Fault::CableCut { port },
                    2 => Fault::CableRestored { port },
                    3 => Fault::PowerOff,
                    4 => Fault::LinkAlone { port },
                    _ => Fault::CrcErrors { port, frames: 2 },
                };
                // A port without a cable refuses, by name.
                let _ = bench.segment.inject(random.below(3) as usize, fault);
                let _ = bench.segment.inject(random.below(3) as usize, Fault::PowerOn);
            }
        }
    }
}

#[test]
fn pure_noise_does_nothing() {
    let mut random = Random(7);
    let mut bench = bench(7);
    for _ in 0..2000 {
        let length = random.below(MAX_FRAME as u64) as usize;
        let mut bytes = random.bytes(length);
        bench.now = HostTime(bench.now.0 + 1000);
        assert_eq!(bench.segment.process(&mut bytes, bench.now), None);
    }
}
