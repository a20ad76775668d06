//! SDOs that are written in SAFE-OP, on the way of all to OP and on the way back of one.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use omnibase_ethercat::cyclic::{
    AcyclicRequest, AcyclicWork, ClockDirection, Comeback, Goal, RegisterAccess, Step, TransitionOptions,
    TransitionStatus,
};
use omnibase_ethercat::mailbox::MailboxRequest;
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::wire::Clock;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::{Bus, BusOptions, SubDeviceConfig};
use omnibase_ethercat_sim::{Fault, FaultRates, Segment, SegmentFile, in_process};

use crate::runner::{Runner, synchronous};

const SERVOS: usize = 3;
/// The maker's file has it written in SAFE-OP, where alone the simulated drive takes it.
const WARM_UP: ObjectAddress = ObjectAddress { index: 0x2100, subindex: 0 };

fn servos(count: usize) -> Segment {
    let text = format!(
        "[[subdevice]]\nkind = \"esi\"\nesi = \"maker.xml\"\ndevice = \"MU-SERVO\"\ncount = {count}\n"
    );
    let segments = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../segments"));
    SegmentFile::parse(&text).unwrap().build(segments).unwrap()
}

fn warm_up() -> SdoWrite {
    SdoWrite {
        object: WARM_UP,
        data: vec![1],
        access: SdoAccess::Entry,
        refusal: Refusal::IsError,
        read_back: ReadBack::Compare,
        origin: Some("robot.toml line 7".into()),
    }
}

fn configs() -> Vec<SubDeviceConfig> {
    let mut configs = synchronous(SERVOS, Duration::from_millis(1));
    configs.iter_mut().for_each(|config| config.safe_op_sdos = vec![warm_up()]);
    configs
}

fn runner(configs: &[SubDeviceConfig]) -> Runner {
    Runner::new(servos(SERVOS), configs, ClockDirection::CycleFollowsDc)
}

fn ask(runner: &mut Runner, position: u16, object: ObjectAddress) -> Result<(), AcyclicRequest> {
    let work = AcyclicWork::Mailbox(MailboxRequest::upload(object, Vec::with_capacity(64)));
    runner.bus().submit(AcyclicRequest { tag: 5, position, work })
}

/// What the SubDevice has in the object.
fn read(runner: &mut Runner, position: u16, object: ObjectAddress) -> Vec<u8> {
    ask(runner, position, object).unwrap();
    let ended = (0..500).find_map(|_| {
        runner.cycle();
        runner.bus().poll_completion()
    });
    let ended = ended.expect("it answers");
    assert_eq!(ended.result, Ok(()));
    let AcyclicWork::Mailbox(request) = ended.work else { panic!("{:?}", ended.work) };
    request.data
}

fn states(runner: &mut Runner) -> Vec<u8> {
    let devices = runner.segment().sub_devices().iter();
    devices.map(|device| device.esc().peek(0x0130, 1).unwrap()[0]).collect()
}

/// Cycles on the way to OP until SDOs are being written.
fn until_they_are_written(runner: &mut Runner) {
    let Runner { paced, image, .. } = runner;
    let there = AtomicBool::new(false);
    let reached = paced.reach(Goal::Op, TransitionOptions::default(), &there, |paced| {
        let writes = TransitionStatus::Moving { goal: Goal::Op, step: Step::Sdos };
        there.store(*paced.bus().transition() == writes, Ordering::Relaxed);
        paced.exchange(image).map(drop)
    });
    assert_eq!(reached, Ok(false));
}

#[test]
fn all_are_written_before_op_is_asked() {
    let mut runner = runner(&configs());
    until_they_are_written(&mut runner);
    assert_eq!(states(&mut runner), [4; 3]);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    for position in 0..SERVOS as u16 {
        assert_eq!(read(&mut runner, position, WARM_UP), [1]);
    }
}

#[test]
fn who_has_no_mailbox_is_named_before_anything_moves() {
    let text = "[[subdevice]]\nkind = \"coupler\"\n[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\n";
    let segment = SegmentFile::parse(text).unwrap().build(Path::new(".")).unwrap();
    let (link, clock) = in_process(segment);
    let mut bus = Bus::new(link, clock, BusOptions::default());
    let count = bus.scan().unwrap().len();
    let mut configs = vec![SubDeviceConfig::default(); count];
    configs[count - 1].safe_op_sdos.push(warm_up());
    let error = bus.configure(&configs).unwrap_err().to_string();
    let expected =
        format!("SubDevice {}: SDO 2100:00 was asked, but the SubDevice has no CoE mailbox", count - 1);
    assert_eq!(error, format!("{expected} (robot.toml line 7)"));
}

#[test]
fn without_any_nothing_is_waited_for() {
    let mut runner = runner(&synchronous(SERVOS, Duration::from_millis(1)));
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    assert_eq!(read(&mut runner, 1, WARM_UP), [0]);
}

#[test]
fn one_that_started_anew_is_told_again() {
    let mut runner = runner(&configs());
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.segment().inject(1, Fault::PowerOff).unwrap();
    runner.segment().inject(1, Fault::PowerOn).unwrap();
    runner.cycles(5);
    assert!(runner.bus().recover(1));
    let ended = (0..20_000).find_map(|_| {
        runner.cycle();
        runner.bus().poll_recovered()
    });
    assert_eq!(ended, Some((1, Ok(Comeback::Restarted))));
    assert_eq!(states(&mut runner), [8; 3]);
    assert_eq!(read(&mut runner, 1, WARM_UP), [1]);
}

#[test]
fn one_that_is_refused_is_named_and_nobody_is_in_op() {
    let mut configs = configs();
    configs[2].safe_op_sdos[0].object = ObjectAddress::new(0x2F00, 1);
    let mut runner = runner(&configs);
    let TransitionStatus::Failed(error) = runner.to(Goal::Op) else { panic!("it is refused") };
    let words = error.to_string();
    let expected = "in SAFE-OP, SubDevice 2: SDO write to 2f00:01: ";
    assert!(words.starts_with(expected) && words.ends_with("(robot.toml line 7)"), "{words}");
    assert_eq!(states(&mut runner), [4; 3]);
    // The mailboxes of all are free again.
    for position in 0..SERVOS as u16 {
        assert_eq!(read(&mut runner, position, ObjectAddress::new(0x1018, 1)), [0x0F, 0x0F, 0, 0]);
    }
    assert_eq!(runner.to(Goal::Init), TransitionStatus::Reached(Goal::Init));
}

#[test]
fn a_stop_doesnt_wait_for_them() {
    let mut runner = runner(&configs());
    until_they_are_written(&mut runner);
    assert!(!runner.bus().recover(0), "its mailbox is in use");
    let now = runner.paced.clock().now();
    runner.bus().request(Goal::PreOp, TransitionOptions::default(), now);
    assert!(runner.bus().recover(0) && runner.bus().call_off(0), "its mailbox is free");
    assert_eq!(runner.to(Goal::PreOp), TransitionStatus::Reached(Goal::PreOp));
    assert_eq!(states(&mut runner), [2; 3]);
    assert_eq!(read(&mut runner, 0, ObjectAddress::new(0x1018, 1)), [0x0F, 0x0F, 0, 0]);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    assert_eq!(read(&mut runner, 0, WARM_UP), [1]);
}

/// All mailboxes share one datagram a cycle: none of them waits for so long that its answer would be too late.
#[test]
fn many_write_one_after_the_other() {
    const MANY: usize = 100;
    let mut configs = synchronous(MANY, Duration::from_millis(4));
    for config in &mut configs {
        config.safe_op_sdos = vec![warm_up()];
        config.timeouts.mailbox = Some(Duration::from_millis(40));
    }
    let mut runner = Runner::new(servos(MANY), &configs, ClockDirection::CycleFollowsDc);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    for position in [0, 50, 99] {
        assert_eq!(read(&mut runner, position, WARM_UP), [1]);
    }
}

/// A register access that is in hand when the SDOs' turn comes.
#[test]
fn a_register_in_hand_keeps_nobody_from_writing() {
    let mut runner = runner(&configs());
    let (too_long, mut cycles) = (AtomicBool::new(false), 0);
    let Runner { paced, image, .. } = &mut runner;
    let reached = paced.reach(Goal::Op, TransitionOptions::default(), &too_long, |paced| {
        cycles += 1;
        too_long.store(cycles > 20_000, Ordering::Relaxed);
        let bus = paced.bus_mut();
        for position in 0..3 {
            let work =
                AcyclicWork::Registers { way: RegisterAccess::Read, register: 0x0130, data: vec![0; 2] };
            let _ = bus.submit(AcyclicRequest { tag: 0, position, work });
        }
        while let Some(ended) = bus.poll_completion() {
            assert_eq!(ended.result, Ok(()));
        }
        paced.exchange(image).map(drop)
    });
    assert_eq!(reached, Ok(true), "{:?} after {cycles} cycles", runner.bus().transition());
}

/// One frame in ten is lost, every which way: no answer of a mailbox is.
#[test]
fn many_lost_frames_lose_no_answer() {
    let configs = configs().into_iter().map(|config| {
        let safe_op_sdos = vec![warm_up(); 20];
        SubDeviceConfig { safe_op_sdos, ..config }
    });
    let mut runner = runner(&configs.collect::<Vec<_>>());
    let rates = FaultRates { drop_request_ppm: 50_000, drop_answer_ppm: 50_000, ..FaultRates::default() };
    runner.bus().link_mut().inner.set_rates(rates);
    for _ in 0..10 {
        assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
        assert_eq!(runner.to(Goal::PreOp), TransitionStatus::Reached(Goal::PreOp));
    }
}

/// The cable goes while SDOs are written: that is what is told, of nobody's mailbox.
#[test]
fn a_cable_that_goes_meanwhile_is_told_as_lost_frames() {
    let mut runner = runner(&configs());
    until_they_are_written(&mut runner);
    let Runner { paced, image, .. } = &mut runner;
    let mut cycles = 0;
    while let TransitionStatus::Moving { .. } = paced.bus().transition() {
        paced
            .bus_mut()
            .link_mut()
            .inner
            .set_rates(FaultRates { drop_answer_ppm: 1_000_000, ..FaultRates::default() });
        let _ = paced.exchange(image);
        cycles += 1;
        assert!(cycles < 1000, "{:?}", paced.bus().transition());
    }
    let words = format!("{:?}", runner.bus().transition());
    assert!(words.starts_with("Failed(") && words.contains("Unheard"), "{words}");
}

/// Requests of others are in hand when the SDOs' turn comes: they end first, and those behind them last.
#[test]
fn what_is_in_hand_and_what_waits_is_done_too() {
    let mut runner = runner(&configs());
    let (mut asked, mut answered) = (0, 0);
    let Runner { paced, image, .. } = &mut runner;
    let (too_long, mut cycles) = (AtomicBool::new(false), 0);
    let reached = paced.reach(Goal::Op, TransitionOptions::default(), &too_long, |paced| {
        cycles += 1;
        too_long.store(cycles > 20_000, Ordering::Relaxed);
        let bus = paced.bus_mut();
        if asked - answered < 3 {
            let upload = MailboxRequest::upload(ObjectAddress::new(0x1018, 1), Vec::with_capacity(64));
            let work = AcyclicWork::Mailbox(upload);
            bus.submit(AcyclicRequest { tag: asked, position: 1, work }).unwrap();
            asked += 1;
        }
        if let Some(ended) = bus.poll_completion() {
            assert_eq!((ended.tag, ended.result), (answered, Ok(())));
            answered += 1;
        }
        paced.exchange(image).map(drop)
    });
    assert_eq!(reached, Ok(true));
    assert!(answered > 5, "{answered} of {asked}");
    for _ in 0..500 {
        runner.cycle();
        let Some(ended) = runner.bus().poll_completion() else { continue };
        assert_eq!((ended.tag, ended.result), (answered, Ok(())));
        answered += 1;
    }
    assert_eq!(answered, asked);
    assert_eq!(read(&mut runner, 1, WARM_UP), [1]);
}
