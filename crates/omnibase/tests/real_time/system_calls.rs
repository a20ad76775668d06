//! The program itself under `strace`: what its thread of the cycle asks the kernel for while the robot follows its path.

use super::support::{PATIENT, Program, Scratch, repository};
use omnibase_host::{Namespace, skipped};
use std::collections::BTreeMap;
use std::process::{Command, Stdio};

/// The part of a run's cycles that is looked at: from behind the set-up to before the end.
const LOOKED_AT: std::ops::Range<f64> = 0.2..0.9;
/// A run of fewer cycles was stopped by a machine on which strace pauses it too long.
const LEAST_CYCLES: usize = 900;
/// Runs until one is long enough.
const ATTEMPTS: u32 = 5;

/// What `strace` wrote of a run that is recorded, in which a drive loses its supply and comes back; with what is more for this port.
fn traced(port: &str, ring: &[&str]) -> String {
    let robot = repository("robots/bmm.toml");
    let (trace, recording) = (Scratch::new(&format!("{port}.strace")), Scratch::new(&format!("{port}.mcap")));
    let _simulator = Program::simulate(&[&robot, "--fault", "power-cycle@2:5:0.3"]);
    let mut command = Command::new("strace");
    command.args(["-f", "-o", trace.path(), env!("CARGO_BIN_EXE_omnibase"), "run", &robot, "--realtime"]);
    command.args(["--interface", Namespace::NEAR, "--circle", "radius_m=0.3,duration_s=6", "--json"]);
    command.args(["--record", recording.path()]).args(PATIENT);
    command.args(["--set", "safety.after_lost_device=\"move_again_unattended\""]).args(ring);
    // However it ends: cycles that are late, and those of a stop, count too.
    Program::start(command).end();
    std::fs::read_to_string(&trace.0).unwrap()
}

/// The calls of the thread of the cycle, by name; one line of each. `None` for a short run.
fn calls(trace: &str) -> Option<BTreeMap<&str, (usize, &str)>> {
    let lines = trace.lines().filter_map(|line| line.split_once(' '));
    let lines: Vec<(&str, &str)> = lines.map(|(thread, call)| (thread, call.trim_start())).collect();
    // The one that asks to come first.
    let (thread, _) = lines.iter().find(|(_, call)| call.contains("SCHED_FIFO"))?;
    let ours: Vec<&str> = lines.iter().filter(|(of, _)| of == thread).map(|(_, call)| *call).collect();
    // Each cycle sleeps once, whether its line is whole or resumed.
    let sleeps = ours.iter().enumerate().filter(|(_, call)| call.starts_with("clock_nanosleep("));
    let sleeps: Vec<usize> = sleeps.map(|(at, _)| at).collect();
    if sleeps.len() < LEAST_CYCLES {
        return None;
    }
    let [from, until] = [LOOKED_AT.start, LOOKED_AT.end].map(|part| (part * sleeps.len() as f64) as usize);
    let (from, until) = (sleeps[from], sleeps[until]);
    let mut calls = BTreeMap::new();
    // `<... name resumed>` is the end of a call that was counted when it began; `---` and `+++` are no calls.
    for call in ours[from..until].iter().filter(|call| !call.starts_with(['<', '-', '+'])) {
        let Some((name, _)) = call.split_once('(') else { continue };
        calls.entry(name).or_insert((0, *call)).0 += 1;
    }
    Some(calls)
}

#[test]
fn the_thread_of_the_cycle_asks_the_kernel_for_frames_and_time_alone() {
    asks_for("socket", &[], &["clock_nanosleep", "sendto", "recvfrom", "ppoll", "ioctl"]);
}

#[test]
fn the_thread_of_a_cycle_with_a_ring_asks_the_kernel_for_sends_and_time_alone() {
    asks_for("ring", &["--ring"], &["clock_nanosleep", "sendto", "ppoll", "ioctl"]);
}

/// With this port it asks for nothing but what is allowed.
fn asks_for(port: &str, more: &[&str], allowed: &[&str]) {
    const TEST: &str = "the_thread_of_the_cycle_asks_the_kernel";
    let Some(namespace) = Namespace::for_test(TEST) else { return };
    if Command::new("strace").arg("-V").stdout(Stdio::null()).status().is_err() {
        return skipped(format_args!("{TEST}: strace is not installed"));
    }
    let traces = (0..ATTEMPTS).map(|_| namespace.run(|| traced(port, more)));
    let Some(trace) = traces.into_iter().find(|trace| calls(trace).is_some()) else {
        eprintln!(
            "SKIPPED: {TEST}: under strace this machine ran {LEAST_CYCLES} cycles in none of {ATTEMPTS} runs"
        );
        return;
    };
    let calls = calls(&trace).unwrap_or_default();
    let counted: Vec<String> = calls.iter().map(|(name, (count, _))| format!("{count} {name}")).collect();
    eprintln!("{TEST}, {port}: {}", counted.join(", "));
    for (name, (count, line)) in &calls {
        assert!(allowed.contains(name), "{port}: the cycle also calls {name}, {count} times: {line}");
        // Whether the cable is in, which the port asks where a frame stays away.
        assert!(*name != "ioctl" || line.contains("SIOCGIFFLAGS"), "{port}: {line}");
    }
    // One frame a cycle, and one more where it looks for who is missing.
    let (sleeps, sends) = (calls["clock_nanosleep"].0, calls["sendto"].0);
    assert!(sends >= sleeps && sleeps > LEAST_CYCLES / 2, "{port}: is the trace read rightly? {counted:?}");
}
