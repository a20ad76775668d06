//! One drive, modelled after the state diagram of the standard, run by [`Enabling`].

use omnibase_cia402::{
    ControlWord, DriveRequest, DriveState, Enabling, EnablingError, ErrorCode, Feedback, Mode, Output,
    Progress, Settings, StatusWord, SupportedModes, Targets, Wanted, next_control_word,
};
use proptest::prelude::*;

const CYCLE_NS: u64 = 1_000_000;

/// A drive that takes some cycles for each step, with an actual position that drifts while the motor is free.
struct Drive {
    state: DriveState,
    mode: i8,
    delay: u32,
    waited: u32,
    last_control: ControlWord,
    error: u16,
    actual: Targets,
    voltage: bool,
    fault_cause: bool,
}

impl Drive {
    fn new() -> Drive {
        Drive {
            state: DriveState::NotReadyToSwitchOn,
            mode: 0,
            delay: 3,
            waited: 0,
            last_control: ControlWord(0),
            error: 0,
            actual: Targets { position_counts: i32::MAX - 5, velocity_units: 40, torque_per_mille: 3 },
            voltage: true,
            fault_cause: false,
        }
    }

    fn feedback(&self) -> Feedback {
        let (_, value) = self.state.mask_and_value();
        let mut status = StatusWord(value).with(StatusWord::REMOTE);
        if self.voltage {
            status = status.with(StatusWord::VOLTAGE_ENABLED);
        }
        Feedback {
            status,
            mode_code: Some(self.mode),
            actual: self.actual,
            error: Some(ErrorCode(self.error)),
        }
    }

    /// The transitions of the standard's diagram that a control word causes.
    fn step(&mut self, output: &Output) {
        use DriveState as S;
        let word = output.control.0;
        let rising_reset = word & 0x80 != 0 && self.last_control.0 & 0x80 == 0;
        self.last_control = output.control;
        let next = match self.state {
            S::NotReadyToSwitchOn => Some(S::SwitchOnDisabled),
            S::FaultReactionActive => Some(S::Fault),
            S::Fault => (rising_reset && !self.fault_cause).then_some(S::SwitchOnDisabled),
            _ if word & 0x02 == 0 => (self.state != S::SwitchOnDisabled).then_some(S::SwitchOnDisabled),
            S::QuickStopActive => (word & 0x0F == 0x0F).then_some(S::OperationEnabled),
            _ if word & 0x04 == 0 => match self.state {
                S::OperationEnabled => Some(S::QuickStopActive),
                S::SwitchOnDisabled => None,
                _ => Some(S::SwitchOnDisabled),
            },
            S::SwitchOnDisabled => (word & 0x07 == 0x06 && self.voltage).then_some(S::ReadyToSwitchOn),
            S::ReadyToSwitchOn => (word & 0x07 == 0x07).then_some(S::SwitchedOn),
            S::SwitchedOn if word & 0x0F == 0x0F => Some(S::OperationEnabled),
            S::SwitchedOn => (word & 0x07 == 0x06).then_some(S::ReadyToSwitchOn),
            S::OperationEnabled if word & 0x0F == 0x07 => Some(S::SwitchedOn),
            S::OperationEnabled => (word & 0x07 == 0x06).then_some(S::ReadyToSwitchOn),
        };
        // A reset is an edge: it counts at once. Other commands are levels and take their time.
        match next {
            Some(next) if self.state == S::Fault || self.waited >= self.delay => {
                self.state = next;
                self.waited = 0;
            }
            Some(_) => self.waited += 1,
            None => self.waited = 0,
        }
        if self.mode != output.mode.code() {
            self.mode = output.mode.code();
        }
        if self.state == S::OperationEnabled {
            match Mode::from_code(self.mode) {
                Some(Mode::CyclicSynchronousPosition) => {
                    self.actual.velocity_units =
                        output.targets.position_counts.wrapping_sub(self.actual.position_counts) * 1000;
                    self.actual.position_counts = output.targets.position_counts;
                }
                Some(Mode::CyclicSynchronousVelocity) => {
                    self.actual.velocity_units = output.targets.velocity_units;
                    self.actual.position_counts =
                        self.actual.position_counts.wrapping_add(output.targets.velocity_units / 1000);
                }
                _ => self.actual.torque_per_mille = output.targets.torque_per_mille,
            }
        } else {
            self.actual.position_counts = self.actual.position_counts.wrapping_add(7);
        }
    }
}

struct Bench {
    drive: Drive,
    machine: Enabling,
    request: DriveRequest,
    now_ns: u64,
}

impl Bench {
    fn new(mode: Mode) -> Bench {
        let request = DriveRequest {
            wanted: Wanted::OperationEnabled,
            mode,
            targets: Targets { position_counts: 1_000_000, velocity_units: 40, torque_per_mille: 0 },
        };
        Bench { drive: Drive::new(), machine: Enabling::new(Settings::default()), request, now_ns: 0 }
    }

    fn cycle(&mut self) -> Output {
        self.now_ns += CYCLE_NS;
        let output = self.machine.advance(self.now_ns, &self.drive.feedback(), &self.request);
        self.drive.step(&output);
        output
    }

    fn run_until(&mut self, done: impl Fn(&Output) -> bool) -> Output {
        for _ in 0..10_000 {
            let output = self.cycle();
            if done(&output) {
                return output;
            }
        }
        panic!("not reached in 10000 cycles; drive in {}, {:?}", self.drive.state, self.machine.problem());
    }

    fn running(mode: Mode) -> Bench {
        let mut bench = Bench::new(mode);
        bench.run_until(|output| output.progress == Progress::Running);
        bench
    }
}

#[test]
fn the_way_to_operation_is_the_standards_and_targets_follow_the_actual_values() {
    let mut bench = Bench::new(Mode::CyclicSynchronousPosition);
    let mut words = Vec::new();
    let mut last_actual;
    loop {
        last_actual = bench.drive.actual;
        let enabled = bench.drive.state == DriveState::OperationEnabled;
        let output = bench.cycle();
        assert_eq!(output.targets.position_counts, last_actual.position_counts, "{:?}", output.progress);
        assert_eq!(output.targets.velocity_units, last_actual.velocity_units);
        if words.last() != Some(&output.control.0) {
            words.push(output.control.0);
        }
        if output.progress == Progress::Running {
            break;
        }
        if !enabled {
            assert_eq!(
                output.targets.torque_per_mille, 0,
                "a free motor gets no torque, whatever its sensor says"
            );
        }
    }
    assert_eq!(words, [0x00, 0x06, 0x07, 0x0F]);
    // The owner's position counts from elsewhere: its increments arrive unchanged.
    bench.request.targets.position_counts += 11;
    let output = bench.cycle();
    assert_eq!(output.targets.position_counts, last_actual.position_counts.wrapping_add(11));
}

#[test]
fn velocity_fades_from_the_actual_to_the_wished() {
    let mut bench = Bench::new(Mode::CyclicSynchronousVelocity);
    bench.request.targets.velocity_units = 2040;
    let first = bench.run_until(|output| output.progress == Progress::Running);
    assert_eq!(first.targets.velocity_units, 40, "the actual speed");
    let mut last = 40;
    for _ in 0..20 {
        let velocity = bench.cycle().targets.velocity_units;
        assert_eq!(velocity - last, 100, "2000 units over 20 ms");
        last = velocity;
    }
    assert_eq!(bench.cycle().targets.velocity_units, 2040);
}

#[test]
fn a_mode_is_switched_while_moving_without_a_jump() {
    let mut bench = Bench::running(Mode::CyclicSynchronousPosition);
    for _ in 0..50 {
        bench.request.targets.position_counts += 25;
        bench.cycle();
    }
    assert_eq!(bench.drive.actual.velocity_units, 25_000);
    bench.request.mode = Mode::CyclicSynchronousVelocity;
    bench.request.targets.velocity_units = 25_000;
    let before = bench.drive.actual;
    let output = bench.cycle();
    assert_eq!(output.mode, Mode::CyclicSynchronousVelocity);
    assert_eq!(output.progress, Progress::SwitchingMode { to: Mode::CyclicSynchronousVelocity });
    assert_eq!(
        output.targets.velocity_units, 25_000,
        "the new target is the actual one before 0x6061 shows the mode"
    );
    assert_eq!(
        output.targets.position_counts,
        before.position_counts.wrapping_add(25),
        "the old target goes on"
    );
    let output = bench.cycle();
    assert_eq!(output.progress, Progress::Running);
    assert_eq!(output.targets.velocity_units, 25_000);
    // And back: the position starts where the wheel is, whatever the owner counts from.
    bench.request.mode = Mode::CyclicSynchronousPosition;
    bench.request.targets.position_counts = -77;
    bench.run_until(|output| output.progress == Progress::Running);
    let actual = bench.drive.actual.position_counts;
    bench.request.targets.position_counts += 25;
    assert_eq!(bench.cycle().targets.position_counts, actual.wrapping_add(25));
    // To torque, from the actual torque.
    bench.drive.actual.torque_per_mille = 200;
    bench.request.mode = Mode::CyclicSynchronousTorque;
    let output = bench.run_until(|output| output.progress == Progress::Running);
    assert_eq!(output.targets.torque_per_mille, 200);
}

#[test]
fn a_fault_is_named_and_reset_by_an_edge_only_when_acknowledged() {
    let mut bench = Bench::running(Mode::CyclicSynchronousVelocity);
    bench.drive.state = DriveState::FaultReactionActive;
    bench.cycle();
    bench.drive.error = 0x8611;
    let output = bench.run_until(|_| true);
    assert_eq!(output.progress, Progress::Stopped(EnablingError::Fault(Some(ErrorCode(0x8611)))));
    assert_eq!(
        bench.machine.problem().unwrap().to_string(),
        "the drive is in fault: error 0x8611 (following error)"
    );
    for _ in 0..5000 {
        assert_eq!(bench.cycle().control.0 & 0x80, 0, "no reset by itself");
    }
    bench.machine.acknowledge();
    assert_eq!(bench.cycle().control.0 & 0x80, 0, "low first");
    assert_eq!(bench.cycle().control.0 & 0x80, 0x80, "then the edge");
    bench.run_until(|output| output.progress == Progress::Running);
}

#[test]
fn a_fault_with_a_lasting_cause_persists() {
    let mut bench = Bench::running(Mode::CyclicSynchronousVelocity);
    (bench.drive.state, bench.drive.error, bench.drive.fault_cause) = (DriveState::Fault, 0x3220, true);
    bench.cycle();
    bench.machine.acknowledge();
    let output = bench.run_until(|output| matches!(output.progress, Progress::Stopped(_)));
    assert_eq!(output.progress, Progress::Stopped(EnablingError::FaultPersists(Some(ErrorCode(0x3220)))));
}

#[test]
fn a_quick_stop_is_never_left_by_itself() {
    let mut bench = Bench::running(Mode::CyclicSynchronousVelocity);
    bench.request.wanted = Wanted::QuickStop;
    assert_eq!(bench.cycle().control, ControlWord::COMMAND_QUICK_STOP);
    bench.request.wanted = Wanted::OperationEnabled;
    for _ in 0..5000 {
        let output = bench.cycle();
        assert_eq!(output.control, ControlWord::COMMAND_QUICK_STOP);
        assert_eq!(output.progress, Progress::Stopped(EnablingError::QuickStop));
    }
    assert_eq!(bench.drive.state, DriveState::QuickStopActive);
    // A drive whose option code leaves quick stop afterwards is not enabled again either.
    bench.drive.state = DriveState::SwitchOnDisabled;
    for _ in 0..5000 {
        assert_eq!(bench.cycle().control, ControlWord::COMMAND_DISABLE_VOLTAGE);
    }
    bench.machine.acknowledge();
    bench.run_until(|output| output.progress == Progress::Running);
}

#[test]
fn a_quick_stop_is_left_by_way_of_switch_on_disabled() {
    let mut bench = Bench::running(Mode::CyclicSynchronousVelocity);
    bench.drive.state = DriveState::QuickStopActive;
    assert_eq!(bench.cycle().progress, Progress::Stopped(EnablingError::QuickStopByDrive));
    bench.machine.acknowledge();
    let mut seen_disabled = false;
    bench.run_until(|output| output.control == ControlWord::COMMAND_DISABLE_VOLTAGE);
    for _ in 0..100 {
        bench.cycle();
        seen_disabled |= bench.drive.state == DriveState::SwitchOnDisabled;
    }
    assert!(seen_disabled);
    assert_eq!(bench.drive.state, DriveState::OperationEnabled);
}

#[test]
fn a_quick_stop_that_the_drive_ignores_ends_without_torque() {
    let mut bench = Bench::running(Mode::CyclicSynchronousVelocity);
    bench.request.wanted = Wanted::QuickStop;
    let mut feedback = bench.drive.feedback();
    feedback.status = StatusWord(0x0637);
    let mut now_ns = bench.now_ns;
    let words: Vec<u16> = (0..2100)
        .map(|_| {
            now_ns += CYCLE_NS;
            bench.machine.advance(now_ns, &feedback, &bench.request).control.0
        })
        .collect();
    assert_eq!(words[0], 0x02);
    assert_eq!(words[2000], 0x02, "2 s are allowed");
    assert_eq!(words[2002], 0x00);
}

#[test]
fn leaving_operation_by_itself_is_named_and_not_repaired() {
    let mut bench = Bench::running(Mode::CyclicSynchronousVelocity);
    bench.drive.state = DriveState::SwitchOnDisabled;
    bench.drive.voltage = false;
    let output = bench.cycle();
    let Progress::Stopped(problem @ EnablingError::LeftOperation { found, .. }) = output.progress else {
        panic!("{output:?}")
    };
    assert_eq!(found, DriveState::SwitchOnDisabled);
    assert!(problem.to_string().contains("torque is safely off"), "{problem}");
    bench.drive.voltage = true;
    for _ in 0..5000 {
        assert_eq!(bench.cycle().control, ControlWord::COMMAND_DISABLE_VOLTAGE);
    }
}

#[test]
fn a_step_that_takes_too_long_is_named() {
    let mut bench = Bench::new(Mode::CyclicSynchronousVelocity);
    bench.drive.voltage = false;
    let output = bench.run_until(|output| matches!(output.progress, Progress::Stopped(_)));
    let Progress::Stopped(EnablingError::StateTimeout { from, to, waited_ns, .. }) = output.progress else {
        panic!("{output:?}")
    };
    assert_eq!((from, to), (DriveState::SwitchOnDisabled, Wanted::OperationEnabled));
    assert!(waited_ns > 2_000_000_000 && waited_ns <= 2_000_000_000 + CYCLE_NS, "{waited_ns}");
    assert_eq!(output.control, ControlWord::COMMAND_DISABLE_VOLTAGE);
}

/// With voltage, too, a drive that isn't enabled usually waits for its stop or its power; one that isn't disabled doesn't.
#[test]
fn a_drive_that_is_not_enabled_is_told_with_the_usual_causes() {
    let words = |status, to| {
        let from = DriveState::ReadyToSwitchOn;
        EnablingError::StateTimeout { from, to, status: StatusWord(status), waited_ns: 2_004_000_000 }
            .to_string()
    };
    let powered = words(0x0231, Wanted::OperationEnabled);
    assert!(
        powered.contains("status word 0x0231. Usual causes: the emergency stop is still pressed"),
        "{powered}"
    );
    assert!(powered.contains("STO is open") && powered.contains("main power is missing"), "{powered}");
    let dark = words(0x0221, Wanted::OperationEnabled);
    assert!(dark.contains("bit 4 (voltage enabled) is clear: no main power"), "{dark}");
    assert!(dark.contains("Usual causes"), "{dark}");
    for (status, to) in [(0x0231, Wanted::SwitchOnDisabled), (0x0031, Wanted::OperationEnabled)] {
        assert!(!words(status, to).contains("Usual causes"), "{status:04x} {to}");
    }
}

#[test]
fn a_mode_that_never_shows_is_named_and_stops_quickly() {
    let mut bench = Bench::running(Mode::CyclicSynchronousVelocity);
    bench.request.mode = Mode::CyclicSynchronousTorque;
    let mut now_ns = bench.now_ns;
    let feedback = bench.drive.feedback();
    for _ in 0..2100 {
        now_ns += CYCLE_NS;
        let output = bench.machine.advance(now_ns, &feedback, &bench.request);
        if let Progress::Stopped(problem) = output.progress {
            assert!(
                matches!(
                    problem,
                    EnablingError::ModeTimeout { to: Mode::CyclicSynchronousTorque, found: 9, .. }
                ),
                "{problem}"
            );
            assert_eq!(output.control, ControlWord::COMMAND_QUICK_STOP);
            return;
        }
        assert_eq!(output.targets.velocity_units, 40, "the old target is held");
    }
    panic!("no timeout");
}

#[test]
fn an_unsupported_mode_is_refused_before_the_drive_is_enabled() {
    let settings = Settings { supported: Some(SupportedModes(0x180)), ..Settings::default() };
    let mut bench = Bench::new(Mode::CyclicSynchronousTorque);
    bench.machine = Enabling::new(settings);
    for _ in 0..100 {
        let output = bench.cycle();
        assert!(matches!(output.progress, Progress::Stopped(EnablingError::UnsupportedMode { .. })));
        assert_eq!(output.control, ControlWord::COMMAND_DISABLE_VOLTAGE);
    }
    assert!(SupportedModes(0x180).supports(Mode::CyclicSynchronousVelocity));
}

#[test]
fn profile_position_announces_each_target_once() {
    let mut bench = Bench::running(Mode::ProfilePosition);
    let mut feedback = bench.drive.feedback();
    let plain = feedback.status;
    bench.request.targets.position_counts = 5000;
    let mut send = |acknowledged: bool| {
        bench.now_ns += CYCLE_NS;
        feedback.status = if acknowledged { plain.with(StatusWord::SETPOINT_ACKNOWLEDGED) } else { plain };
        let output = bench.machine.advance(bench.now_ns, &feedback, &bench.request);
        (output.control.0 & 0x10 != 0, output.targets.position_counts)
    };
    send(true);
    assert_eq!(send(false), (true, 5000), "a new target rises bit 4, at its own place");
    assert_eq!(send(false), (true, 5000), "until it is acknowledged");
    assert_eq!(send(true), (false, 5000));
    assert_eq!(send(false), (false, 5000), "and is not announced again");
}

#[test]
fn a_target_in_profile_position_is_announced_again_after_another_that_never_was() {
    let mut bench = Bench::running(Mode::ProfilePosition);
    let mut feedback = bench.drive.feedback();
    let plain = feedback.status;
    let mut send = |target: i32, acknowledged: bool| {
        bench.now_ns += CYCLE_NS;
        bench.request.targets.position_counts = target;
        feedback.status = if acknowledged { plain.with(StatusWord::SETPOINT_ACKNOWLEDGED) } else { plain };
        let output = bench.machine.advance(bench.now_ns, &feedback, &bench.request);
        (output.control.0 & 0x10 != 0, output.targets.position_counts)
    };
    send(5000, true);
    assert_eq!(send(5000, false), (true, 5000));
    assert_eq!(send(6000, true), (false, 6000));
    assert_eq!(send(5000, false), (true, 5000));
}

#[test]
fn disabling_removes_the_voltage_and_is_no_problem() {
    let mut bench = Bench::running(Mode::CyclicSynchronousVelocity);
    bench.request.wanted = Wanted::SwitchOnDisabled;
    let output = bench.run_until(|output| output.progress == Progress::Holding(DriveState::SwitchOnDisabled));
    assert_eq!(output.control.0, 0);
    bench.request.wanted = Wanted::SwitchedOn;
    bench.run_until(|output| output.progress == Progress::Holding(DriveState::SwitchedOn));
}

#[test]
fn every_state_has_its_way_and_transition_16_is_none() {
    for state in DriveState::ALL {
        let (_, value) = state.mask_and_value();
        assert_eq!(StatusWord(value).state(), Some(state));
        for wanted in
            [Wanted::ReadyToSwitchOn, Wanted::SwitchedOn, Wanted::OperationEnabled, Wanted::QuickStop]
        {
            let word = next_control_word(state, wanted);
            assert_eq!(word.0 & 0x80, 0);
            if state == DriveState::QuickStopActive {
                assert_eq!(word, ControlWord::COMMAND_QUICK_STOP);
            }
        }
        assert_eq!(next_control_word(state, Wanted::SwitchOnDisabled).0, 0);
    }
}

proptest! {
    /// Whatever a drive sends: no panic, and "enable operation" never follows a fault or quick stop unasked.
    #[test]
    fn no_input_panics_or_restarts(
        cycles in proptest::collection::vec((any::<u16>(), any::<i8>(), any::<i32>(), any::<i32>(), any::<i16>(), any::<u32>()), 1..200),
    ) {
        let mut machine = Enabling::new(Settings::default());
        let mut stopped = false;
        let mut now_ns = 0;
        for (status, mode, position, velocity, torque, pause_ns) in cycles {
            now_ns += u64::from(pause_ns);
            let actual = Targets { position_counts: position, velocity_units: velocity, torque_per_mille: torque };
            let status = StatusWord(status);
            let feedback = Feedback { status, mode_code: Some(mode), actual, error: None };
            let request = DriveRequest {
                wanted: Wanted::OperationEnabled,
                mode: Mode::CyclicSynchronousVelocity,
                targets: Targets { velocity_units: i32::MIN, ..Targets::default() },
            };
            let output = machine.advance(now_ns, &feedback, &request);
            stopped |= matches!(status.state(), Some(DriveState::Fault | DriveState::QuickStopActive | DriveState::FaultReactionActive));
            if stopped {
                prop_assert!(output.control.0 & 0x08 == 0 && output.control.0 & 0x80 == 0);
                prop_assert!(matches!(output.progress, Progress::Stopped(_)));
            }
            if output.progress != Progress::Running && status.state() != Some(DriveState::OperationEnabled) && status.state().is_some() {
                prop_assert_eq!(output.targets.position_counts, position);
                prop_assert_eq!(output.targets.velocity_units, velocity);
            }
        }
    }
}

#[test]
fn no_bit_of_a_mode_rises_before_the_drive_shows_that_mode() {
    for mode in [Mode::ProfilePosition, Mode::Homing] {
        let mut bench = Bench::running(Mode::CyclicSynchronousPosition);
        let mut feedback = bench.drive.feedback();
        bench.request.mode = mode;
        let mut rises = |shown: Mode| {
            bench.now_ns += CYCLE_NS;
            feedback.mode_code = Some(shown.code());
            bench.machine.advance(bench.now_ns, &feedback, &bench.request).control.0 & 0x10 != 0
        };
        for _ in 0..3 {
            assert!(!rises(Mode::CyclicSynchronousPosition), "{mode}: its edge would be lost");
        }
        assert!(rises(mode));
    }
}
