//! Firmware in another process: the protocol byte by byte, and the C client with its example.

use crate::bench::{Bench, fmmu, sync_manager};
use crate::skipped::skipped;
use core::time::Duration;
use omnibase_ethercat_sim::{EscConfig, Fault, Pace, Segment, SocketApplication, SubDevice};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Command};
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command as Process};
use std::thread::JoinHandle;

/// Long enough for any machine; nothing waits for it unless the test fails.
const PATIENCE: Duration = Duration::from_secs(60);

fn path(name: &str) -> PathBuf {
    // Socket paths are short (108 bytes), target folders may not be.
    let path = std::env::temp_dir().join(format!("omnibase-{}-{name}.pdi", std::process::id()));
    let _ = std::fs::remove_file(&path);
    path
}

/// What a firmware of hand-written bytes does: sends, and expects to receive.
enum Step {
    Send(&'static [u8]),
    Expect(&'static [u8]),
}
use Step::{Expect, Send};

/// A firmware that follows a script, in lockstep, and the bench around it.
fn scripted(name: &str, script: Vec<Step>) -> (Bench, JoinHandle<()>) {
    let path = path(name);
    let mut application = SocketApplication::bind(&path, Pace::Lockstep).unwrap();
    let firmware = std::thread::spawn(move || {
        let mut stream = UnixStream::connect(path).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        for (n, step) in script.into_iter().enumerate() {
            match step {
                Send(bytes) => stream.write_all(bytes).unwrap(),
                Expect(bytes) => {
                    let mut received = vec![0; bytes.len()];
                    stream.read_exact(&mut received).unwrap();
                    assert_eq!(received, bytes, "step {n}");
                }
            }
        }
    });
    application.wait_for_firmware(PATIENCE).unwrap();
    let device = SubDevice::new(EscConfig::default(), Box::new(application));
    (Bench::new(Segment::line(vec![device]).unwrap()), firmware)
}

const FOREVER: Step = Send(&[3, 0, 0, 0, 8, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255]);
const POWER_ON: Step = Expect(&[0x84, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);

#[test]
fn every_message_has_the_bytes_of_its_description() {
    let (mut bench, firmware) = scripted(
        "bytes",
        vec![
            POWER_ON,
            // Read ESC type and revision; write two bytes of user memory; run again after 500 000 ns.
            Send(&[1, 0, 0x00, 0x00, 2, 0, 0, 0]),
            Expect(&[0x81, 0, 0x00, 0x00, 2, 0, 0, 0, 0, 0, 0, 0, 0x11, 0x00]),
            Send(&[2, 0, 0x80, 0x0F, 2, 0, 0, 0, 0xAB, 0xCD]),
            Expect(&[0x82, 0, 0x80, 0x0F, 0, 0, 0, 0, 0, 0, 0, 0]),
            Send(&[3, 0, 0, 0, 8, 0, 0, 0, 0x20, 0xA1, 0x07, 0, 0, 0, 0, 0]),
            Expect(&[0x83, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0x20, 0xA1, 0x07, 0, 0, 0, 0, 0]),
            FOREVER,
            // AL control at 1 020 100 ns: event word 1, which reading 0x0120 clears.
            Expect(&[0x83, 0, 0, 0, 8, 0, 0, 0, 1, 0, 0, 0, 0xC4, 0x90, 0x0F, 0, 0, 0, 0, 0]),
            Send(&[1, 0, 0x20, 0x01, 2, 0, 0, 0]),
            Expect(&[0x81, 0, 0x20, 0x01, 2, 0, 0, 0, 0, 0, 0, 0, 2, 0]),
            Send(&[2, 0, 0x30, 0x01, 2, 0, 0, 0, 2, 0]),
            Expect(&[0x82, 0, 0x30, 0x01, 0, 0, 0, 0, 0, 0, 0, 0]),
            FOREVER,
        ],
    );
    bench.number(1);
    assert_eq!(bench.now.0, 1_010_000);
    assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[2, 0]), 1);
    // In lockstep the answer is there before the next frame.
    assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 2), 2);
    assert_eq!(bench.fprd(0x1001, 0x0F80, 2), Some(vec![0xAB, 0xCD]));
    firmware.join().unwrap();
}

#[test]
fn nonsense_ends_the_connection_and_the_segment_goes_on() {
    for nonsense in [[9, 0, 0, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0x01, 0x10, 0, 0], [3, 0, 0, 0, 7, 0, 0, 0]] {
        let nonsense: &'static [u8] = Box::leak(Box::new(nonsense));
        let (mut bench, firmware) = scripted("nonsense", vec![POWER_ON, Send(nonsense)]);
        bench.number(1);
        assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[2, 0]), 1);
        bench.wait_us(5000);
        assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 2), 1, "nobody is there to answer");
        firmware.join().unwrap();
    }
}

/// The example firmware, compiled; `None`, said loudly, where there is no C compiler.
fn example_firmware(name: &str) -> Option<PathBuf> {
    if Process::new("cc").arg("--version").output().is_err() {
        skipped("no C compiler (cc), so the C client of the PDI socket isn't tested");
        return None;
    }
    let sources = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("c");
    let program = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("example_firmware_{name}"));
    let compiled = Process::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-o"])
        .arg(&program)
        .args([sources.join("example_firmware.c"), sources.join("pdi_client.c")])
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    Some(program)
}

/// Ends the firmware with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn run_example(name: &str, pace: Pace) -> Option<(Bench, Running)> {
    let program = example_firmware(name)?;
    let path = path(name);
    let mut application = SocketApplication::bind(&path, pace).unwrap();
    let running = Running(Process::new(program).arg(&path).spawn().unwrap());
    application.wait_for_firmware(PATIENCE).unwrap();
    let device = SubDevice::new(EscConfig::default(), Box::new(application));
    Some((Bench::new(Segment::line(vec![device]).unwrap()), running))
}

/// Asks for a state and gives the AL status once it changed, or the last one when patience is over.
fn ask(bench: &mut Bench, control: u8) -> u64 {
    let before = bench.number_at(0x1001, reg::AL_STATUS, 2);
    assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[control, 0]), 1);
    let begin = std::time::Instant::now();
    loop {
        bench.wait_us(50);
        let status = bench.number_at(0x1001, reg::AL_STATUS, 2);
        if status != before || begin.elapsed() > PATIENCE {
            return status;
        }
    }
}

fn configure(bench: &mut Bench, inputs: u16) {
    bench.number(1);
    let managers = [sync_manager(0x1100, 6, 0x64), sync_manager(0x1180, inputs, 0x20)].concat();
    assert_eq!(bench.fpwr(0x1001, reg::SM + 16, &managers), 1);
    bench.fpwr(0x1001, reg::FMMU, &fmmu(0, 6, [0, 7], 0x1100, 0, 2));
    bench.fpwr(0x1001, reg::FMMU + 16, &fmmu(6, 6, [0, 7], 0x1180, 0, 1));
}

#[test]
fn the_c_firmware_goes_to_op_and_mirrors_in_lockstep() {
    let Some((mut bench, mut running)) = run_example("lockstep", Pace::Lockstep) else { return };
    configure(&mut bench, 6);
    for state in [2, 4, 8] {
        assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[state, 0]), 1);
        assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 6), u64::from(state));
    }
    for value in 1..100 {
        let out = [value, value + 1, 3, 4, 5, 6];
        let sent = [out, [0; 6]].concat();
        assert_eq!(bench.send(Command::Lrw, Address::Logical(0), &sent).counter, 3);
        let inputs = bench.send(Command::Lrd, Address::Logical(6), &[0; 6]);
        assert_eq!((inputs.counter, inputs.data), (1, out.to_vec()));
    }
    // A skipped state is refused, and accepted once acknowledged.
    assert_eq!(ask(&mut bench, 1), 1);
    assert_eq!(ask(&mut bench, 8), 0x11);
    assert_eq!(bench.number_at(0x1001, reg::AL_STATUS_CODE, 2), 0x11);
    assert_eq!(ask(&mut bench, 0x12), 2);
    // After a power cycle it starts from INIT.
    bench.segment.inject(0, Fault::PowerCycle { off_for: Duration::from_millis(1) }).unwrap();
    bench.wait_us(1100);
    configure(&mut bench, 5);
    assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 2), 1);
    assert_eq!(ask(&mut bench, 2), 2);
    assert_eq!(ask(&mut bench, 4), 0x12);
    assert_eq!(bench.number_at(0x1001, reg::AL_STATUS_CODE, 2), 0x1E, "inputs of another length");
    // Its chip tells of one that dies.
    let expired = |bench: &mut Bench| bench.number_at(0x1001, reg::WATCHDOG_COUNTER + 1, 1);
    bench.wait_us(500_000);
    assert_eq!(expired(&mut bench), 0);
    running.0.kill().unwrap();
    running.0.wait().unwrap();
    bench.fpwr(0x1001, reg::AL_CONTROL, &[1, 0]);
    bench.wait_us(500_000);
    assert_eq!(expired(&mut bench), 1);
}

#[test]
fn the_c_firmware_goes_to_op_running_freely() {
    let Some((mut bench, _running)) = run_example("free", Pace::Free) else { return };
    configure(&mut bench, 6);
    for state in [2, 4, 8] {
        assert_eq!(ask(&mut bench, state), u64::from(state));
    }
    let begin = std::time::Instant::now();
    loop {
        assert_eq!(bench.send(Command::Lwr, Address::Logical(0), &[1, 2, 3, 4, 5, 6]).counter, 1);
        bench.wait_us(50);
        let inputs = bench.send(Command::Lrd, Address::Logical(6), &[0; 6]);
        if inputs.data == [1, 2, 3, 4, 5, 6] {
            break;
        }
        assert!(begin.elapsed() < PATIENCE, "{inputs:?}");
    }
}
