//! Two interfaces at the ends of a ring, the simulator behind both: a cable is cut while the robot runs, and mended.

use super::support::{ATTEMPTS, BothReports, IN_OP, PATIENT, Program, events, repository};
use omnibase_host::{LinkState, Namespace, interface};
use std::time::Duration;

/// The second cable: its end at the run, and its end at the simulator.
const NEAR: &str = "veth2";
const FAR: &str = "veth3";

/// A namespace with a second cable, whose ends are up.
fn two_cables(test: &str) -> Option<Namespace> {
    let namespace = Namespace::for_test(test)?;
    namespace.ip(&format!("link add {NEAR} type veth peer name {FAR}")).unwrap();
    for end in [NEAR, FAR] {
        // Without this the kernel sends IPv6 solicitations of its own into the cable.
        namespace.ip(&format!("link set {end} addrgenmode none")).unwrap();
        namespace.ip(&format!("link set {end} up")).unwrap();
    }
    wait_for_carrier(&namespace);
    Some(namespace)
}

/// Until the kernel tells of both cables' carriers.
fn wait_for_carrier(namespace: &Namespace) {
    namespace.run(|| {
        let is_up = |end| interface::link_state(end) == LinkState::Up;
        while ![Namespace::NEAR, Namespace::FAR, NEAR, FAR].into_iter().all(is_up) {
            std::thread::sleep(Duration::from_millis(1));
        }
    });
}

/// Both processes, the robot on a circle.
fn start(more: &[&str]) -> (Program, Program) {
    let robot = repository("robots/bmm.toml");
    let simulator = Program::simulate(&[&[robot.as_str(), "--redundant", FAR], more].concat());
    let arguments =
        [&[robot.as_str(), "--redundant", NEAR, "--circle", "radius_m=0.3,duration_s=7"][..], &PATIENT];
    (simulator, Program::run(&arguments.concat()))
}

/// Goes on as if nothing had been: nobody left OP, every event was told once, nothing was lost, and the reference was
/// followed to its end. A machine that kept both from their time may lose frames of its own, which may look like a cable.
fn went_on(test: &str, seen: &BothReports, told: &[(&str, usize)]) {
    let words = events(&seen.report);
    for position in 0..3 {
        assert_eq!(seen.states(position), IN_OP, "{words:?}");
    }
    assert_eq!((seen.ended, seen.bus("losses")), (Some(0), 0.0), "{words:?}");
    for (expected, times) in told {
        let found = words.iter().filter(|text| *text == expected).count();
        assert!(found >= *times, "{expected}: {words:?}");
        assert!(found == *times || !seen.is_undisturbed(), "{expected}: {words:?}");
    }
    if !seen.is_undisturbed() {
        eprintln!("SKIPPED: {test}: that no frame is lost: this machine didn't keep its time");
        return;
    }
    assert_eq!(seen.report["lost_frames"], 0, "{words:?}");
    assert_eq!(seen.bus("working_counter_errors"), 0.0, "{words:?}");
}

#[test]
fn a_cable_that_is_cut_in_a_ring_loses_no_cycle_and_is_named_and_so_is_its_mending() {
    const TEST: &str = "a_cable_that_is_cut_in_a_ring";
    let Some(namespace) = two_cables(TEST) else { return };
    let attempt = || {
        let (mut simulator, mut run) =
            start(&["--fault", "cable-cut@0:3:1", "--fault", "cable-restored@0:4:1"]);
        let in_time = simulator.moves_before("fault: cable-cut", &mut run);
        in_time.then(|| BothReports::of(run, simulator))
    };
    let Some(seen) = (0..ATTEMPTS).find_map(|_| namespace.run(attempt)) else {
        eprintln!("SKIPPED: {TEST}: this machine moved no robot within 3 s in {ATTEMPTS} attempts");
        return;
    };
    let broken = "the ring is broken between `wheel_1` (SubDevice 0) and `wheel_2` (SubDevice 1)";
    went_on(TEST, &seen, &[(broken, 1), ("the ring is whole again", 1)]);
}

/// Waits until an interface has sent so many more frames, cycles of the run, or the run has ended. To be called inside
/// the namespace.
fn wait_for_frames(interface: &str, frames: u64, run: &mut Program) {
    let sent = || -> u64 {
        let text = std::fs::read_to_string("/proc/thread-self/net/dev").unwrap();
        let own = |line: &str| Some(line.trim().strip_prefix(interface)?.strip_prefix(':')?.to_owned());
        let line = text.lines().find_map(own).unwrap();
        line.split_whitespace().nth(8).unwrap().parse().unwrap()
    };
    let until = sent() + frames;
    while sent() < until && !run.has_ended() {
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn either_interface_may_lose_its_cable_and_get_it_back() {
    const TEST: &str = "either_interface_may_lose_its_cable";
    let Some(namespace) = two_cables(TEST) else { return };
    // What the ends of the cables are called, who is next to them, and who goes on meanwhile.
    let pulled = [
        (NEAR, FAR, "`wheel_3` (SubDevice 2) and the redundant interface", Namespace::NEAR),
        (Namespace::NEAR, Namespace::FAR, "the primary interface and `wheel_1` (SubDevice 0)", NEAR),
    ];
    let seen = namespace.run(|| {
        let (mut simulator, mut run) = start(&[]);
        simulator.wait_for("the robot moves");
        for (near, far, _, other) in pulled {
            namespace.ip(&format!("link set {near} down")).unwrap();
            simulator.wait_for(&format!("the cable of {far} is out"));
            wait_for_frames(other, 100, &mut run);
            namespace.ip(&format!("link set {near} up")).unwrap();
            simulator.wait_for(&format!("the cable of {far} is in again"));
            wait_for_frames(other, 100, &mut run);
        }
        BothReports::of(run, simulator)
    });
    let broken = pulled.map(|(.., between, _)| format!("the ring is broken between {between}"));
    went_on(TEST, &seen, &[("the ring is whole again", 2), (&broken[0], 1), (&broken[1], 1)]);
}
