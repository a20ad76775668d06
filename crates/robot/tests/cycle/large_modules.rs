//! More process data than a cycle's record has room for: what signals use of them is recorded, and replays.

use omnibase_robot::{CycleRecord, ImageBuffer, Registry, RequestKind, Robot, RobotPlan};

use crate::support::{Bench, plan};

const IO: &str = include_str!("../../../../robots/bmm_io.toml");
/// Its place in the robot's file.
const MODULE: usize = 4;
/// Bytes of process data of the module in each direction.
const BYTES: usize = 133;

/// A module of 133 bytes in each direction, with the given signals.
fn with_module(signals: &str) -> String {
    let map = |object: u16| {
        let entries = (1..=BYTES).map(|subindex| format!("{object:04X}.{subindex}:8"));
        entries.collect::<Vec<_>>().join(" ")
    };
    let table = format!(
        "[[device]]\nname = \"module\"\nposition = 7\nkind = \"io\"\n\
         inputs = [{{ pdo = \"0x1A00\", map = \"{}\" }}]\noutputs = [{{ pdo = \"0x1600\", map = \"{}\" }}]\n{signals}[platform]",
        map(0x6000),
        map(0x7000),
    );
    IO.replace("[platform]", &table)
}

#[test]
fn a_module_larger_than_a_record_has_its_signals_recorded_and_replays() {
    let text = with_module(
        "input = [{ name = \"first\", object = \"6000.1\", type = \"u8\" }, { name = \"ready\", object = \"6000.67\", bit = 3 }, \
         { name = \"last\", object = \"6000.133\", type = \"i8\" }]\n\
         output = [{ name = \"code\", object = \"7000.133\", type = \"u8\", on_stop = 5 }, { name = \"go\", object = \"7000.2\", bit = 7 }]\n",
    );
    let plan = plan(&text);
    let signals = plan.signals();
    // The voltage stands in two bytes of six, a button and the lamps in one of one.
    assert_eq!((signals.input_bytes, signals.output_bytes), (1 + 2 + 3, 1 + 2));
    let [first, ready, last] =
        ["first", "ready", "last"].map(|name| signals.input(&format!("module.{name}")).unwrap());
    let [told, go] = ["code", "go"].map(|name| signals.output(&format!("module.{name}")).unwrap());
    let registry = Registry::with_built_in();
    let mut bench = Bench::new(plan.clone());
    bench.image.device_inputs[1][0] = 0b01;
    let mut records: Vec<CycleRecord> = Vec::new();
    for cycle in 0..100_u8 {
        let bytes = &mut bench.image.device_inputs[MODULE];
        assert_eq!(bytes.len(), BYTES);
        // What no signal is of is never still, nor recorded.
        bytes.fill(cycle);
        (bytes[0], bytes[66], bytes[132]) =
            (cycle.wrapping_mul(3), if cycle < 50 { 0xF7 } else { 0x08 }, 0x80);
        let value = f64::from(cycle);
        records.push(bench.step(Some(match cycle {
            1 => RequestKind::Enable,
            60 => RequestKind::SetOutput { index: go as u32, value: 1.0 },
            _ => RequestKind::SetOutput { index: told as u32, value },
        })));
        let signals = records.last().unwrap().signals;
        assert_eq!(
            [first, ready, last].map(|input| signals.believed(input)),
            [Some(3.0 * value % 256.0), Some(f64::from(cycle >= 50)), Some(-128.0)]
        );
        let written = &bench.image.device_outputs[MODULE];
        assert!((0..BYTES).all(|byte| matches!(byte, 1 | 132) || written[byte] == 0), "{written:?}");
    }
    let written = &bench.image.device_outputs[MODULE];
    assert_eq!((written[132], written[1]), (99, 0x80));
    let mut again = Robot::build(&plan, &registry).unwrap();
    let mut image = ImageBuffer::new(&plan);
    for record in &records {
        assert_eq!(again.replay(record, &mut image), record, "cycle {}", record.time.index);
    }
}

/// An array of bytes that goes on in the padding behind its entry, as those of IO-Link do.
#[test]
fn a_number_in_an_array_of_bytes_is_read_from_its_byte() {
    let map = "6000.1:8 6000.2:240 pad:240 pad:64 6000.3:8";
    let text = |signals: &str| {
        let table = format!(
            "[[device]]\nname = \"link\"\nposition = 7\nkind = \"io\"\n\
             inputs = [{{ pdo = \"0x1A00\", map = \"{map}\" }}]\ninput = [{signals}]\n[platform]"
        );
        IO.replace("[platform]", &table)
    };
    let plan = plan(&text(
        "{ name = \"near\", object = \"6000.2\", byte = 2, type = \"i16\", scale = 0.5 }, \
         { name = \"far\", object = \"6000.2\", byte = 66, type = \"u16\" }, \
         { name = \"on\", object = \"6000.2\", byte = 67, bit = 7 }",
    ));
    let [near, far, on] =
        ["near", "far", "on"].map(|name| plan.signals().input(&format!("link.{name}")).unwrap());
    let mut bench = Bench::new(plan);
    let bytes = &mut bench.image.device_inputs[MODULE];
    bytes[3..5].copy_from_slice(&(-7_i16).to_le_bytes());
    bytes[67..69].copy_from_slice(&0x8123_u16.to_le_bytes());
    let signals = bench.step(None).signals;
    assert_eq!([near, far, on].map(|input| signals.believed(input)), [Some(-3.5), Some(33059.0), Some(1.0)]);
    for (signal, expected) in [
        (
            "byte = 67, type = \"u16\"",
            "byte = 67: the object has 544 bits with the padding behind it (allowed: 0 to 66)",
        ),
        ("byte = 0", "type: must be given: it says how many bytes are a number"),
        ("byte = 0, bit = 8", "bit = 8: a byte has fewer bits (allowed: 0 to 7)"),
        ("byte = 0, bit = 1, type = \"u8\"", "type: `bit` is of a `bool`"),
        ("byte = 0, type = \"bool\"", "type: `bit` is of a `bool`"),
        (
            "byte = 30, type = \"u8\", simulated = 1",
            "simulated = 1: it stands in padding, which a simulated SubDevice leaves at 0",
        ),
    ] {
        let refusal = refusal(&text(&format!("{{ name = \"x\", object = \"6000.2\", {signal} }}")));
        assert!(refusal.contains(&format!("device[4].input[0].{expected}")), "{refusal}");
    }
}

/// Outputs in the same bits, more entries than a map has, and more bytes than a chip has memory for.
#[test]
fn what_no_subdevice_can_have_is_refused() {
    let twice = "output = [{ name = \"word\", object = \"7000.1\", byte = 0, type = \"u8\" }, { name = \"bit\", object = \"7000.1\", bit = 3 }]\n";
    let told = refusal(&with_module(twice));
    assert!(
        told.contains("output[1].object = \"bit\": it stands in bits of `word`, which would be lost"),
        "{told}"
    );
    let with_map = |map: String| {
        let table = format!(
            "[[device]]\nname = \"module\"\nposition = 7\nkind = \"io\"\ninputs = [{{ pdo = \"0x1A00\", map = \"{map}\" }}]\n[platform]"
        );
        refusal(&IO.replace("[platform]", &table))
    };
    let told = with_map(format!("6000.1:240{}", " pad:240".repeat(254)));
    assert!(told.contains("255 entries") && told.contains("at most 254"), "{told}");
    let one = |pdo: u16| {
        format!("{{ pdo = \"0x{:04X}\", map = \"6000.{pdo}:255{}\" }}", 0x1A00 + pdo, " pad:255".repeat(253))
    };
    let all: Vec<String> = (1..=3).map(one).collect();
    let table = format!(
        "[[device]]\nname = \"module\"\nposition = 7\nkind = \"io\"\ninputs = [{}]\n[platform]",
        all.join(", ")
    );
    let told = refusal(&IO.replace("[platform]", &table));
    assert!(told.contains("24289 bytes of process data") && told.contains("at most 20480"), "{told}");
}

fn refusal(text: &str) -> String {
    let no_files = |name: &str| Err(format!("no file {name}"));
    let problems = RobotPlan::from_toml(text, &Registry::with_built_in(), &no_files).unwrap_err();
    problems.iter().map(|problem| format!("{problem}\n")).collect()
}

#[test]
fn signals_of_more_bytes_than_a_record_has_are_refused() {
    // 33 numbers of four bytes each.
    let entries: Vec<String> = (1..=33).map(|subindex| format!("6000.{subindex}:32")).collect();
    let of = |subindex| format!("{{ name = \"n{subindex}\", object = \"6000.{subindex}\", type = \"u32\" }}");
    let signals: Vec<String> = (1..=33).map(of).collect();
    let table = format!(
        "[[device]]\nname = \"module\"\nposition = 7\nkind = \"io\"\n\
         inputs = [{{ pdo = \"0x1A00\", map = \"{}\" }}]\ninput = [{}]\n[platform]",
        entries.join(" "),
        signals.join(", ")
    );
    let refusal = refusal(&IO.replace("[platform]", &table));
    // The voltage and a button are three bytes more.
    assert!(refusal.contains("135 bytes of inputs") && refusal.contains("at most 128"), "{refusal}");
}
