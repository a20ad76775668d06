//! Both ports over a veth pair in a namespace of the test's own; skipped loudly without the rights for one.

use omnibase_ethercat_wire::frame::FrameBuilder;
use omnibase_ethercat_wire::{Address, Clock, Command, HostTime, Link, LinkError};
use omnibase_host::{
    LinkState, MonotonicClock, Namespace, OpenError, PacketRing, PacketSocket, Waiting, interface, skipped,
};
use std::process::Command as Program;
use std::sync::atomic::{AtomicBool, Ordering};

/// Every port, by name.
const PORTS: [&str; 3] = ["socket", "ring", "ring-busy"];

fn open(port: &str, interface: &str) -> Box<dyn Link> {
    match port {
        "socket" => Box::new(PacketSocket::open(interface).unwrap()),
        "ring" => Box::new(PacketRing::open(interface, Waiting::Sleep).unwrap()),
        "ring-busy" => Box::new(PacketRing::open(interface, Waiting::BusyPoll).unwrap()),
        other => panic!("no port {other}"),
    }
}

fn soon() -> HostTime {
    HostTime(MonotonicClock.now().0 + 5_000_000_000)
}

/// A frame with one datagram of `length` bytes, recognisable by its index and its data.
fn frame(index: u8, length: usize) -> FrameBuilder {
    let mut frame = FrameBuilder::new();
    frame.push(Command::Lwr, index, Address::Logical(0x1000), &vec![index ^ 0x5A; length]).unwrap();
    frame
}

/// Sends every frame back until `stop` is set, as a segment would, with the processed bit set.
fn echo(interface: &str, stop: &AtomicBool) {
    let mut port = PacketSocket::open(interface).unwrap();
    let mut buffer = [0; 2048];
    while !stop.load(Ordering::Relaxed) {
        let deadline = HostTime(MonotonicClock.now().0 + 20_000_000);
        if let Ok(Some(length)) = port.receive(&mut buffer, deadline) {
            buffer[6] |= 0x02;
            port.send(&buffer[..length]).unwrap();
        }
    }
}

/// Runs `work` in `namespace` while the far end echoes.
fn with_echo<R: Send>(namespace: &Namespace, work: impl FnOnce() -> R + Send) -> R {
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| namespace.run(|| echo(Namespace::FAR, &stop)));
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            namespace.run(|| {
                wait_for_echo();
                work()
            })
        }));
        stop.store(true, Ordering::Relaxed);
        result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Sends until the far end answers, so that no frame is lost to an echo that isn't open yet.
fn wait_for_echo() {
    let mut port = PacketSocket::open(Namespace::NEAR).unwrap();
    let mut buffer = [0; 2048];
    for _ in 0..500 {
        port.send(frame(0, 1).bytes()).unwrap();
        let deadline = HostTime(MonotonicClock.now().0 + 10_000_000);
        if port.receive(&mut buffer, deadline).unwrap().is_some() {
            // Answers to earlier frames may be under way; a new socket doesn't see those that came before it.
            while port.receive(&mut buffer, HostTime(MonotonicClock.now().0 + 20_000_000)).unwrap().is_some()
            {
            }
            return;
        }
    }
    panic!("the echo never answered");
}

fn cycle(port: &mut dyn Link, index: u8, length: usize) {
    let sent = frame(index, length);
    port.send(sent.bytes()).unwrap();
    let mut buffer = [0; 2048];
    let received = port.receive(&mut buffer, soon()).unwrap().expect("an answer within 5 s");
    let mut expected = sent.bytes().to_vec();
    expected[6] |= 0x02;
    assert_eq!(&buffer[..received], expected, "frame {index} of {length} bytes");
}

#[test]
fn frames_of_every_length_come_back_unchanged() {
    let Some(namespace) = Namespace::for_test("frames_of_every_length_come_back_unchanged") else { return };
    for port in PORTS {
        with_echo(&namespace, || {
            let mut link = open(port, Namespace::NEAR);
            // More cycles than either ring has slots, and every length from empty to full.
            for (index, length) in (0..=1486).enumerate() {
                cycle(&mut *link, index as u8, length);
            }
        });
    }
}

#[test]
fn several_frames_are_under_way_at_once_and_keep_their_order() {
    let Some(namespace) = Namespace::for_test("several_frames_are_under_way_at_once") else { return };
    for port in PORTS {
        with_echo(&namespace, || {
            let mut link = open(port, Namespace::NEAR);
            let mut buffer = [0; 2048];
            for round in 0..20 {
                for index in 0..32 {
                    link.send(frame(index, 100 + round).bytes()).unwrap();
                }
                for index in 0..32 {
                    let length = link.receive(&mut buffer, soon()).unwrap().expect("an answer");
                    assert_eq!((length, buffer[17]), (128 + round, index), "{port}, round {round}");
                }
            }
        });
    }
}

#[test]
fn a_deadline_ends_the_wait_and_one_in_the_past_does_not_wait() {
    let Some(namespace) = Namespace::for_test("a_deadline_ends_the_wait") else { return };
    namespace.run(|| {
        for port in PORTS {
            let mut link = open(port, Namespace::NEAR);
            let mut buffer = [0; 2048];
            let deadline = HostTime(MonotonicClock.now().0 + 3_000_000);
            assert_eq!(link.receive(&mut buffer, deadline), Ok(None), "{port}");
            assert!(MonotonicClock.now() >= deadline, "{port} came back too early");
            assert_eq!(link.receive(&mut buffer, HostTime(0)), Ok(None), "{port}");
        }
    });
}

#[test]
fn own_frames_and_other_protocols_do_not_come_in() {
    let Some(namespace) = Namespace::for_test("own_frames_and_other_protocols_do_not_come_in") else {
        return;
    };
    namespace.run(|| {
        for port in PORTS {
            let mut near = open(port, Namespace::NEAR);
            let mut far = open(port, Namespace::FAR);
            let mut foreign = frame(1, 10).bytes().to_vec();
            foreign[12..14].copy_from_slice(&[0x08, 0x06]);
            near.send(&foreign).unwrap();
            near.send(frame(2, 10).bytes()).unwrap();
            let mut buffer = [0; 2048];
            assert_eq!(far.receive(&mut buffer, soon()), Ok(Some(38)), "{port}");
            assert_eq!(buffer[17], 2, "{port}");
            assert_eq!(near.receive(&mut buffer, HostTime(0)), Ok(None), "{port} saw its own frame");
        }
    });
}

#[test]
fn too_long_frames_are_refused_and_received_ones_dropped() {
    let Some(namespace) = Namespace::for_test("too_long_frames_are_refused") else { return };
    namespace.ip("link set veth0 mtu 9000").unwrap();
    namespace.ip("link set veth1 mtu 9000").unwrap();
    namespace.run(|| {
        let mut near = PacketSocket::open(Namespace::NEAR).unwrap();
        assert_eq!(near.send(&[0; 1515]), Err(LinkError::FrameTooLong { limit: 1514, found: 1515 }));
        for port in PORTS {
            let mut link = open(port, Namespace::NEAR);
            assert_eq!(
                link.send(&[0; 1515]),
                Err(LinkError::FrameTooLong { limit: 1514, found: 1515 }),
                "{port}"
            );
            let mut small = [0; 60];
            let mut far = PacketSocket::open(Namespace::FAR).unwrap();
            far.send(frame(1, 100).bytes()).unwrap();
            far.send(frame(2, 10).bytes()).unwrap();
            assert_eq!(link.receive(&mut small, soon()), Ok(Some(38)), "{port}: the one that fits");
            assert_eq!(small[17], 2);
        }
    });
}

/// Waits until the near end has this state: the kernel works changes of a carrier off in its own time.
fn wait_for(state: LinkState) {
    let deadline = soon();
    while interface::link_state(Namespace::NEAR) != state {
        assert!(MonotonicClock.now() < deadline, "{state:?} did not come within 5 s");
        std::thread::yield_now();
    }
}

#[test]
fn a_pulled_cable_is_a_link_that_is_down_and_comes_back() {
    let Some(namespace) = Namespace::for_test("a_pulled_cable_is_a_link_that_is_down") else { return };
    for port in PORTS {
        namespace.run(|| {
            let mut link = open(port, Namespace::NEAR);
            let mut buffer = [0; 2048];
            wait_for(LinkState::Up);

            namespace.ip("link set veth1 down").unwrap();
            wait_for(LinkState::NoCarrier);
            let waited = link.receive(&mut buffer, HostTime(MonotonicClock.now().0 + 1_000_000));
            assert_eq!(waited, Err(LinkError::Down), "{port}: no carrier");

            namespace.ip("link set veth0 down").unwrap();
            wait_for(LinkState::Off);
            assert_eq!(link.send(frame(7, 10).bytes()), Err(LinkError::Down), "{port}: switched off");

            namespace.ip("link set veth0 up").unwrap();
            namespace.ip("link set veth1 up").unwrap();
            let mut far = PacketSocket::open(Namespace::FAR).unwrap();
            wait_for(LinkState::Up);
            link.send(frame(8, 10).bytes()).unwrap();
            assert_eq!(far.receive(&mut buffer, soon()), Ok(Some(38)), "{port}");
            assert_eq!(buffer[17], 8, "{port}: the frame that was refused while down must not leave later");
        });
    }
}

#[test]
fn a_wrong_interface_is_refused_with_those_that_exist() {
    let Some(namespace) = Namespace::for_test("a_wrong_interface_is_refused") else { return };
    namespace.run(|| {
        let error = PacketSocket::open("eth77").unwrap_err();
        assert_eq!(error.to_string(), "no network interface `eth77`; there are: veth1, veth0");
        assert!(matches!(PacketRing::open("eth77", Waiting::Sleep), Err(OpenError::NoSuchInterface { .. })));
    });
}

#[test]
fn a_ring_knows_when_a_frame_came_in_however_late_it_is_fetched() {
    let Some(namespace) = Namespace::for_test("a_ring_knows_when_a_frame_came_in") else { return };
    namespace.run(|| {
        let mut near = PacketRing::open(Namespace::NEAR, Waiting::Sleep).unwrap();
        let mut far = PacketRing::open(Namespace::FAR, Waiting::Sleep).unwrap();
        assert_eq!(far.arrival(), None, "nothing came yet");
        let mut buffer = [0; 2048];
        let before = MonotonicClock.now();
        near.send(frame(1, 60).bytes()).unwrap();
        far.receive(&mut buffer, soon()).unwrap().expect("the first frame");
        let (first, between) = (far.arrival().unwrap(), MonotonicClock.now());
        near.send(frame(2, 60).bytes()).unwrap();
        let waited = HostTime(MonotonicClock.now().0 + 20_000_000);
        MonotonicClock.sleep_until(waited);
        far.receive(&mut buffer, soon()).unwrap().expect("the second frame");
        let second = far.arrival().unwrap();
        // 0.1 ms: two clocks can't be read at once.
        let slack = 100_000;
        assert!(before.0 < first.0 + slack && first <= between, "{before:?} {first:?} {between:?}");
        assert!(between.0 < second.0 + slack, "{between:?} {second:?}");
        assert!(second < waited, "the frame came before it was fetched: {second:?} {waited:?}");
    });
}

/// Not a test by itself: what [`system_calls_per_cycle`] runs under `strace`.
#[test]
fn cycles_for_strace() {
    let (Ok(port), Ok(cycles)) = (std::env::var("OMNIBASE_TEST_PORT"), std::env::var("OMNIBASE_TEST_CYCLES"))
    else {
        return;
    };
    let mut link = open(&port, Namespace::NEAR);
    let sent = frame(3, 60);
    let mut buffer = [0; 2048];
    for _ in 0..cycles.parse::<u32>().unwrap() {
        link.send(sent.bytes()).unwrap();
        link.receive(&mut buffer, soon()).unwrap().expect("an answer");
    }
}

/// System calls of one run of [`cycles_for_strace`], by name.
fn strace(port: &str, cycles: u32) -> Vec<(String, u64)> {
    let summary =
        std::env::temp_dir().join(format!("omnibase-strace-{}-{port}-{cycles}", std::process::id()));
    let status = Program::new("strace")
        .args(["-f", "-c", "-U", "calls,name", "-o"])
        .arg(&summary)
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", "cycles_for_strace", "--test-threads=1", "-q"])
        .env("OMNIBASE_TEST_PORT", port)
        .env("OMNIBASE_TEST_CYCLES", cycles.to_string())
        .stdout(std::process::Stdio::null())
        .status()
        .unwrap();
    assert!(status.success());
    let text = std::fs::read_to_string(&summary).unwrap();
    std::fs::remove_file(&summary).unwrap();
    text.lines()
        .filter_map(|line| {
            let (calls, name) = line.trim().split_once(' ')?;
            Some((name.trim().to_owned(), calls.parse().ok()?))
        })
        .collect()
}

#[test]
fn system_calls_per_cycle() {
    let Some(namespace) = Namespace::for_test("system_calls_per_cycle") else { return };
    if Program::new("strace").arg("-V").output().is_err() {
        return skipped("system_calls_per_cycle: strace is not installed");
    }
    const CYCLES: u64 = 500;
    let count = |calls: &[(String, u64)], name: &str| {
        calls.iter().find(|(found, _)| found == name).map_or(0, |(_, count)| *count)
    };
    with_echo(&namespace, || {
        for port in PORTS {
            let (idle, busy) = (strace(port, 0), strace(port, CYCLES as u32));
            let more = |name: &str| count(&busy, name) - count(&idle, name);
            assert_eq!(more("sendto"), CYCLES, "{port}: one send a cycle; {busy:?}");
            let (receives, waits) = (more("recvfrom"), more("ppoll"));
            match port {
                // As many as it takes while it looks; behind a wait one more.
                "socket" => assert!(receives >= CYCLES && waits <= CYCLES, "{port}: {busy:?}"),
                "ring" => assert!(receives == 0 && waits <= CYCLES, "{port}: one wait at most; {busy:?}"),
                _ => assert_eq!((receives, waits), (0, 0), "{port}: it never sleeps; {busy:?}"),
            }
            // Setting up may differ by a call or two; a call per cycle would show as 500.
            let known = more("sendto") + more("recvfrom") + more("ppoll");
            let all = count(&busy, "total") - count(&idle, "total");
            assert!(all <= known + 10, "{port}: {all} calls in {CYCLES} cycles, {known} known; {busy:?}");
        }
    });
}
