//! A robot whose drives say anything, whose bus loses anything, and of whom anything is asked, cycle by cycle.
//!
//! Nothing may panic; what leaves is finite and within the limits; what is recorded computes again to the same bits.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_robot::registry::Kind;
use omnibase_robot::signals::{CycleTime, Quantity};
use omnibase_robot::{CycleRecord, Exchange, ImageBuffer, Registry, Request, Robot, RobotPlan};

const ROBOTS: [&str; 2] = [include_str!("../../robots/bmm.toml"), include_str!("../../robots/mecanum.toml")];
const AROUND: &str = "
[fence]
polygon_m = [[-3, -3], [3, -3], [3, 3], [-3, 3]]

[avoidance]
kind = \"guarded\"

[[obstacle]]
centre_m = [1.5, 0.5]
radius_m = 0.2
";

/// Where a run ends: some bytes ask for 64 cycles each, and a picture among the seeds for half a million.
const MOST_CYCLES: u64 = 20_000;

/// Bytes, as numbers of any width; `None` at their end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    /// Small whole numbers and tenths most of the time, else any bits.
    fn number(&mut self) -> Option<f64> {
        Some(match self.byte()? {
            bits if bits & 1 == 0 => f64::from(bits as i8) / 20.0,
            _ => f64::from_bits(u64::from_le_bytes(self.take()?)),
        })
    }

    fn request(&mut self) -> Option<Option<Request>> {
        let sort = self.byte()? % 14;
        let argument = u64::from(self.byte()?);
        let argument = argument | u64::from(argument & 1) << 32;
        let argument = if sort == 6 { argument } else { argument & 0xFF };
        let mut values = [0.0; 6];
        if matches!(sort, 5 | 6 | 10 | 12) {
            for value in &mut values {
                *value = self.number()?;
            }
        }
        Some(Request::from_codes([u64::from(sort), argument, u64::MAX], values).flatten())
    }
}

/// A table with one of the kinds, and something for each key that it needs.
fn table<'k>(name: &str, kinds: impl Iterator<Item = &'k Kind>, which: u8) -> String {
    let kinds: Vec<&Kind> = kinds.collect();
    let kind = kinds[usize::from(which) % kinds.len()];
    let value = |key: &str| match key {
        "points" => "[[0, 0, 0, 0], [9, 1, 0.5, 2]]",
        "controls" => "[[0, 0, 0], [1, 0, 0.2], [1, 1, 0.3], [0, 1, 0.5]]",
        "drawing" => "\"M 0 0 C 1 0 2 1 1 2\"",
        _ => "0.5",
    };
    let needed = kind.keys.iter().filter(|key| key.is_needed);
    let lines: String = needed.map(|key| format!("{} = {}\n", key.name, value(key.name))).collect();
    format!("[{name}]\nkind = {:?}\n{lines}\n", kind.name)
}

/// Every robot under every law, with every reference.
fn plan(which: u8, registry: &Registry) -> Option<RobotPlan> {
    let text = ROBOTS[usize::from(which & 1)];
    let (before, after) = (text.find("[controller]")?, text.find("[simulation]")?);
    let controller = table("controller", registry.controllers.kinds(), which >> 1);
    let reference = table("reference", registry.references.kinds(), which >> 3);
    let text = [&text[..before], &controller, &reference, &text[after..], AROUND].concat();
    RobotPlan::from_toml(&text, registry, &|_| Err("no file".into())).ok()
}

/// What honest drives answer: the status that follows the control word, and the mode that was asked for.
fn answer(image: &mut ImageBuffer) {
    for (inputs, outputs) in image.inputs.iter_mut().zip(&image.outputs) {
        let status = match outputs[0] & 0x0F {
            0x0F => 0x0237_u16,
            0x07 => 0x0233,
            0x06 => 0x0231,
            _ => 0x0250,
        };
        inputs[..2].copy_from_slice(&status.to_le_bytes());
        match outputs.len() {
            20 => inputs[12] = outputs[14],
            _ => inputs[2] = outputs[2],
        }
    }
}

fn look_at(record: &CycleRecord, plan: &RobotPlan) {
    let allowed = &record.allowed.commands;
    assert!(allowed.is_finite(), "{allowed:?}");
    let limit = match allowed.quantity {
        Quantity::Nothing => 0.0,
        Quantity::Speed => plan.limits.wheel_speed_rad_s,
        Quantity::Torque => plan.limits.wheel_torque_nm,
    };
    for value in allowed.values {
        assert!(value.abs() <= limit * (1.0 + 1e-9), "{allowed:?} beyond {limit}");
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = Bytes(bytes);
    let registry = Registry::with_built_in();
    let Some(which) = bytes.byte() else { return };
    let plan = plan(which, &registry).expect("a shipped robot");
    let mut robot = Robot::build(&plan, &registry).expect("a shipped robot");
    let mut again = Robot::build(&plan, &registry).expect("a shipped robot");
    let (mut image, mut buffer) = (ImageBuffer::new(&plan), ImageBuffer::new(&plan));
    let (mut first, mut second) = (Vec::new(), Vec::new());
    let mut index = 0;
    while let Some(what) = bytes.byte().filter(|_| index < MOST_CYCLES) {
        let repeats = if what & 0x80 == 0 { 1 } else { u64::from(what & 0x3F) + 1 };
        let (mut exchange, mut request) = (Exchange::Complete, None);
        if what & 0x80 == 0 {
            exchange = match what & 3 {
                1 => Exchange::Lost,
                2 => Exchange::ShortCount { expected: 9, received: 6 },
                3 if what & 8 != 0 => {
                    Exchange::Without { wheels: u16::from(what >> 4), devices: u16::from(what >> 6) }
                }
                3 => Exchange::Restarted { wheels: u16::from(what >> 4) },
                _ => Exchange::Complete,
            };
            if what & 4 != 0 {
                request = bytes.request().flatten();
            }
        }
        for _ in 0..repeats {
            answer(&mut image);
            if what & 0x88 == 0x08 {
                // A lie of one drive.
                let Some([wheel, at, lie]) = bytes.take() else { return };
                let wheels = image.inputs.len();
                let inputs = &mut image.inputs[usize::from(wheel) % wheels];
                let at = usize::from(at) % inputs.len();
                inputs[at] = lie;
            }
            let record =
                *robot.compute(CycleTime::on_grid(index, plan.bus.cycle_ns), exchange, request, &mut image);
            index += 1;
            look_at(&record, &plan);
            record.values(&mut first);
            again.replay(&record, &mut buffer).values(&mut second);
            for (number, pair) in first.iter().zip(&second).enumerate() {
                assert_eq!(
                    omnibase_run::channels::word(*pair.0),
                    omnibase_run::channels::word(*pair.1),
                    "value {number}"
                );
            }
            assert_eq!(image.outputs, buffer.outputs);
        }
    }
});
