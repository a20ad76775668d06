//! The run: bring-up, cycle after cycle until its end, and a defined stop, whatever happens.

mod told;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use omnibase_cia402::ErrorCode;
use omnibase_ethercat::wire::{Clock, Link};
use omnibase_fusion::{MAX_SENSORS, Verdict};
use omnibase_platform::Pose2;
use omnibase_record::run::RunSink;
use omnibase_robot::signals::Exchange;
use omnibase_robot::signals::{CycleTime, Phase, SafetyReason};
use omnibase_robot::{CycleRecord, MOST_SETTINGS, Request, RequestKind, Robot, RobotPlan};
use omnibase_robot_sim::SharedMachine;

use crate::channels::{CycleExtras, Rows};
use crate::conductor::{Conductor, Wish};
use crate::drive_errors::DriveErrors;
use crate::live::operator::{Note, Turn};
use crate::live::{Client, FenceSeen, LiveEnd, Snapshot, SubDeviceFacts};
use crate::simulated::{Script, Sensors};
use omnibase_measure::events::{Event, Watch};
use omnibase_measure::pauses::Pauses;
use omnibase_measure::slips::SlipWatch;
use omnibase_measure::summary::Summary;
use omnibase_measure::timing::{TimedCycle, TimedRobot, Timing};
use omnibase_measure::tracking::Tracking;
use omnibase_measure::truth::Witness;
use omnibase_session::Words;
use omnibase_session::session::{Session, SessionError};
use omnibase_session::supervision::{BusFigures, DatagramFigures, SubDeviceFigures};

/// Events that a run keeps; what comes later is only recorded.
const MOST_EVENTS: usize = 1000;

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The bus.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The robot stopped by itself.
    #[error("the robot stopped: {reason}{}", problems(.drives))]
    Stopped {
        /// Why, in words.
        reason: &'static str,
        /// What is wrong with each drive.
        drives: Vec<String>,
    },
}

fn problems(drives: &[String]) -> String {
    drives.iter().map(|problem| format!("\n  {problem}")).collect()
}

/// How far a run is, for whoever watches from another thread.
#[derive(Debug, Default)]
pub struct Progress {
    /// Cycles done.
    pub cycles: AtomicU64,
    /// Cycles that the reference takes; 0 until that is known.
    pub total: AtomicU64,
    /// It is over.
    pub ended: AtomicBool,
    /// Becomes true when the robot comes to a fault.
    pub fault: Arc<AtomicBool>,
}

/// What a run needs beside its link and its clock.
pub struct Setup<'a> {
    /// The robot's plan.
    pub plan: &'a RobotPlan,
    /// Its stages.
    pub robot: Robot,
    /// The machine behind a simulated robot.
    pub machine: Option<SharedMachine>,
    /// What happens to it by time.
    pub script: Option<Script>,
    /// Rows for the recording, and where they go.
    pub recording: Option<(Rows, RunSink)>,
    /// Where people and programs lead the robot, in place of its one reference from start to end.
    pub live: Option<LiveEnd>,
    /// Becomes true where somebody wants the end.
    pub stop: &'a AtomicBool,
    /// How far it is.
    pub progress: &'a Progress,
}

/// How a run went: figures in any case, and why it ended early, where it did.
#[derive(Debug)]
pub struct Ran {
    /// The figures; those of the recording are not in it yet.
    pub summary: Summary,
    /// The last cycle.
    pub last: CycleRecord,
    /// Where it should have ended; `None` where nothing was followed.
    pub wished_end: Option<Pose2>,
    /// Whether the reference was followed to its end.
    pub finished: bool,
    /// Why it ended early.
    pub ended: Result<(), RunError>,
}

/// Runs a robot once: the same in virtual and in real time, for only link and clock differ.
///
/// In every end drives are disabled and the segment is brought to INIT, as far as it still listens.
pub fn run<L: Link, C: Clock>(
    link: L,
    clock: C,
    setup: Setup<'_>,
    warn: &mut dyn FnMut(String),
) -> Result<Ran, RunError> {
    let mut session = Session::prepare(link, clock, setup.plan, warn)?;
    let stop = setup.stop;
    let mut cycle = Cycle::new(setup);
    if let Some(live) = &mut cycle.live {
        live.acyclic().introduce(session.subdevices().map(SubDeviceFacts::of).collect());
    }
    let reached = session.reach_op(stop);
    let ran = match reached {
        Ok(true) => cycle.until_over(&mut session).map_err(RunError::from),
        Ok(false) => Ok(()),
        Err(error) => Err(error.into()),
    };
    if cycle.robot.phase() == Phase::Fault && ran.is_ok() {
        // The mailbox is silent in INIT. A drive that doesn't answer goes without its code.
        cycle.error_codes = session.error_codes().unwrap_or_default();
    }
    let ended = session.end().map_err(RunError::from);
    Ok(cycle.finish(ran, ended))
}

/// The cycle's state.
struct Cycle<'a> {
    plan: &'a RobotPlan,
    robot: Robot,
    witness: Option<Witness>,
    sensors: Option<Sensors>,
    script: Option<Script>,
    recording: Option<(Rows, RunSink)>,
    stop: &'a AtomicBool,
    progress: &'a Progress,
    conductor: Conductor,
    live: Option<LiveEnd>,
    watch: Watch,
    slips: SlipWatch,
    tracking: Tracking,
    bus: BusFigures,
    drive_errors: DriveErrors,
    /// What is wrong with the axis about which the robot stopped.
    axis_problem: Words,
    /// What was thought of each sensor in the cycle before.
    verdicts: [Verdict; MAX_SENSORS],
    subdevices: Vec<SubDeviceFigures>,
    datagrams: Vec<DatagramFigures>,
    timing: Timing,
    pauses: Pauses,
    events: Vec<(u64, Words)>,
    time: CycleTime,
    /// That of [`RobotPlan::input_age_ns`].
    input_age_ns: u64,
    last: CycleRecord,
    overruns: u64,
    lost_frames: u64,
    lost_before: u64,
    cycles: u64,
    realtime_factor: f64,
    stop_seen: bool,
    /// Somebody stopped a run that follows its plan.
    stopped_by_people: bool,
    recording_lost: bool,
    /// What the drives said is wrong with them, where they were asked.
    error_codes: Vec<Option<ErrorCode>>,
}

impl<'a> Cycle<'a> {
    fn new(setup: Setup<'a>) -> Self {
        let Setup { plan, robot, machine, script, recording, mut live, stop, progress } = setup;
        if let Some(live) = &mut live {
            // A plan comes back by itself.
            live.comes_back(plan.safety.comeback.filter(|_| !live.is_beside_plan()));
        }
        let total = robot.reference_duration_s().map_or(0.0, |s| s * 1e9 / plan.bus.cycle_ns as f64);
        progress.total.store(total as u64, Ordering::Relaxed);
        Cycle {
            robot,
            sensors: machine.as_ref().and_then(|_| Sensors::new(plan)),
            witness: machine.map(Witness::new),
            script,
            recording,
            stop,
            progress,
            conductor: Conductor::new(plan.safety.comeback),
            live,
            watch: Watch::default(),
            slips: SlipWatch::default(),
            tracking: Tracking::default(),
            bus: BusFigures::default(),
            drive_errors: DriveErrors::default(),
            axis_problem: Words::default(),
            verdicts: [Verdict::Awaited; MAX_SENSORS],
            subdevices: Vec::new(),
            datagrams: Vec::new(),
            timing: Timing::default(),
            pauses: Pauses::default(),
            events: Vec::with_capacity(MOST_EVENTS),
            time: CycleTime::on_grid(0, plan.bus.cycle_ns),
            input_age_ns: plan.input_age_ns(),
            last: CycleRecord::default(),
            overruns: 0,
            lost_frames: 0,
            lost_before: 0,
            cycles: 0,
            realtime_factor: 0.0,
            stop_seen: false,
            stopped_by_people: false,
            recording_lost: false,
            error_codes: Vec::new(),
            plan,
        }
    }

    fn until_over<L: Link, C: Clock>(&mut self, session: &mut Session<L, C>) -> Result<(), SessionError> {
        let (began, began_host) = (session.clock().now(), Instant::now());
        self.lost_before = session.counters().frames_lost;
        let (cycle, timeout) = session.pace();
        self.pauses = Pauses::new(cycle, timeout);
        let mut result = Ok(());
        while !self.conductor.is_over() {
            if let Err(error) = self.step(session) {
                result = Err(error);
                break;
            }
        }
        (self.subdevices, self.datagrams) = (session.subdevice_figures(), session.datagram_figures());
        let robot_s = (session.clock().now() - began).as_secs_f64();
        self.realtime_factor = robot_s / began_host.elapsed().as_secs_f64().max(1e-9);
        result
    }

    /// Sleep, exchange, compute, record.
    fn step<L: Link, C: Clock>(&mut self, session: &mut Session<L, C>) -> Result<(), SessionError> {
        let (exchange, times) = session.exchange()?;
        let first_event = self.events.len();
        if self.cycles > 0 {
            let index = self.time.index + times.periods;
            self.time = CycleTime::on_grid(index, self.plan.bus.cycle_ns);
            self.overruns += times.periods - 1;
        }
        self.cycles += 1;
        let wish = if self.stop.load(Ordering::Relaxed) { Wish::Stop } else { Wish::GoOn };
        if wish == Wish::Stop && !self.stop_seen {
            self.stop_seen = true;
            self.happened(self.time.now_ns, "a stop was asked for".into());
        }
        while let Some(words) = self.script.as_mut().and_then(|script| script.next(self.time.now_ns)) {
            self.happened(self.time.now_ns, words);
        }
        let request = self.request(wish).map(|request| self.unless_written(request));
        if let Some(live) = &mut self.live {
            live.hear(&mut self.robot);
        }
        if let Some(sensors) = &mut self.sensors {
            sensors.hear(&mut self.robot, self.time.now_ns);
        }
        let before = self.robot.phase();
        let from = session.clock().now();
        self.last = *self.robot.compute(self.time, exchange, request, session.image());
        let compute_ns = (session.clock().now() - from).as_nanos() as u64;
        let inputs_ns = times.wake.0.saturating_sub(self.input_age_ns);
        let truth = self.witness.as_mut().map(|witness| witness.look(inputs_ns));
        if let Some((sensors, truth)) = self.sensors.as_mut().zip(truth.as_ref()) {
            sensors.look(self.time.now_ns.saturating_sub(self.input_age_ns), truth);
        }
        let errors = self.tracking.take(&self.last, truth.as_ref());
        let authority = self.live.as_ref().map(LiveEnd::authority).unwrap_or_default();
        self.bus = session.figures();
        let now_ns = self.time.now_ns;
        let moves_again_in_s = match self.leader() {
            Some(live) => live.moves_again_in_s(now_ns),
            None => self.conductor.moves_again_in_s(now_ns),
        };
        let extras =
            CycleExtras { times, bus: self.bus, compute_ns, errors, authority, moves_again_in_s, truth };
        // Who is at fault comes before what it led to.
        session.look_at_drives(self.last.measurements.present());
        while let Some(words) = session.take_event() {
            self.happened(self.time.now_ns, words);
        }
        while let Some((wheel, error)) = session.take_said() {
            self.conductor.drive_said(wheel, error);
            self.drive_errors.said(wheel, error);
            self.live.iter_mut().for_each(|live| live.drive_said(wheel, error));
        }
        self.drive_errors.look(self.last.measurements.present());
        self.look_at_axes();
        self.look_at_sensors();
        let phase = self.robot.phase();
        if phase == Phase::Fault && before != Phase::Fault {
            self.progress.fault.store(true, Ordering::Relaxed);
        }
        if let Some(words) = self.live.as_mut().and_then(|live| live.acyclic().step(session, phase)) {
            self.happened_by(self.time.now_ns, words, Some(Client::Command));
        }
        self.record(&extras);
        let events = first_event..self.events.len();
        let CycleRecord { time, exchange, stop_reason, ref request, .. } = self.last;
        let robot = Some(TimedRobot { phase, stop_reason, asked: request.is_some(), events });
        self.pauses.take(&times, matches!(exchange, Exchange::Lost));
        self.timing.take(&TimedCycle { time, exchange, times, compute_ns: Some(compute_ns), robot });
        self.lost_frames = session.counters().frames_lost - self.lost_before;
        self.show(extras);
        self.progress.cycles.store(self.cycles, Ordering::Relaxed);
        Ok(())
    }

    /// What is asked of the robot in this cycle: by people, or by the run's own plan; the end is the plan's in any case.
    fn request(&mut self, wish: Wish) -> Option<Request> {
        let phase = self.robot.phase();
        if self.leader().is_none() || wish == Wish::Stop {
            // Whoever stops a plan ends it: nobody could go on with it.
            let wish = if self.stopped_by_people { Wish::Stop } else { wish };
            let kind = self.conductor.next(&self.last, phase, wish);
            if let Some(note) = self.conductor.take_note() {
                self.happened(self.time.now_ns, note.into());
            }
            let by_plan = kind.map(Request::lasting);
            return if by_plan.is_none() { self.beside_plan(phase) } else { self.look_on(phase, by_plan) };
        }
        let live = self.live.as_mut()?;
        let Turn { request, offer } = live.turn(self.time.now_ns, &self.last, phase);
        if let Some((number, reference)) = offer
            && let Some((_, replaced)) = self.robot.offer_reference(number, reference)
        {
            live.give_back(replaced);
        }
        self.take_notes();
        request
    }

    /// People and programs, where they lead the robot in place of the plan.
    fn leader(&self) -> Option<&LiveEnd> {
        self.live.as_ref().filter(|live| !live.is_beside_plan())
    }

    /// What people ask for in a cycle in which the plan asks for nothing.
    fn beside_plan(&mut self, phase: Phase) -> Option<Request> {
        let live = self.live.as_mut().filter(|live| live.is_beside_plan())?;
        let Turn { request, .. } = live.turn(self.time.now_ns, &self.last, phase);
        let is_stop = matches!(request, Some(Request { kind: RequestKind::Stop(_), .. }));
        self.stopped_by_people |= is_stop;
        self.take_notes();
        request
    }

    /// What the plan asks for; people see that it does.
    fn look_on(&mut self, phase: Phase, by_plan: Option<Request>) -> Option<Request> {
        if let Some(live) = self.live.as_mut().filter(|live| live.is_beside_plan()) {
            live.look_on(&self.last, phase);
        }
        by_plan
    }

    fn take_notes(&mut self) {
        while let Some(Note { text, client }) = self.live.as_mut().and_then(LiveEnd::take_note) {
            self.happened_by(self.time.now_ns, text.into(), client);
        }
    }

    /// Nobody enables drives in which something is being written that wants them disabled: the request is too old.
    fn unless_written(&mut self, request: Request) -> Request {
        let keeps_disabled = self.live.as_mut().is_some_and(|live| live.acyclic().keeps_disabled());
        if !matches!(request.kind, RequestKind::Enable) || !keeps_disabled {
            return request;
        }
        self.happened(self.time.now_ns, "not enabled: an object is just being written by SDO".into());
        Request { valid_until_ns: 0, ..request }
    }

    fn show(&mut self, extras: CycleExtras) {
        let Some(live) = &mut self.live else { return };
        let mut settings = [None; MOST_SETTINGS];
        for (index, setting) in self.robot.settings() {
            settings[index as usize] = Some(setting);
        }
        live.show(&Snapshot {
            record: self.last,
            phase: self.robot.phase(),
            extras,
            drive_errors: self.drive_errors,
            axis_problem: self.axis_problem,
            settings,
            joystick: self.robot.joystick_shape(),
            obstacles: *self.robot.obstacles(),
            fence: FenceSeen::of(self.robot.fence_m()),
            timing: self.timing.seen(),
            cycles: self.cycles,
            lost_frames: self.lost_frames,
            overruns: self.overruns,
            ..Snapshot::default()
        });
    }

    fn finish(self, ran: Result<(), RunError>, way_back: Result<(), RunError>) -> Ran {
        self.progress.ended.store(true, Ordering::Relaxed);
        let event =
            |(time_ns, text): (u64, Words)| Event { time_s: time_ns as f64 * 1e-9, text: text.to_string() };
        let finished = self.conductor.has_finished() && ran.is_ok() && way_back.is_ok();
        let wanted = self.stop.load(Ordering::Relaxed);
        let ended = ran.and_then(|()| {
            let followed = self.conductor.has_finished();
            if followed || (wanted && self.robot.phase() != Phase::Fault) {
                return Ok(());
            }
            let name = |wheel: usize| self.plan.drives.get(wheel).map_or("?", |drive| drive.name.as_str());
            let problem = |(wheel, problem): (usize, String)| {
                let code =
                    self.error_codes.get(wheel).copied().flatten().filter(|code| *code != ErrorCode::NONE);
                let code =
                    code.map(|code| format!("; asked by SDO, it says error {code}")).unwrap_or_default();
                format!("{}: {problem}{code}", name(wheel))
            };
            let devices = &self.plan.devices;
            let of_axes = self.robot.device_problems().map(|(device, problem)| {
                format!("{}: {problem}", devices.get(device).map_or("?", |device| device.name.as_str()))
            });
            Err(RunError::Stopped {
                reason: match self.conductor.stopped_by() {
                    SafetyReason::None => self.last.stop_reason.text(),
                    first => first.text(),
                },
                drives: self.robot.drive_problems().map(problem).chain(of_axes).collect(),
            })
        });
        // Why the robot stopped says more than that it then couldn't be brought back.
        let ended = ended.and(way_back);
        let events: Vec<Event> = self.events.into_iter().map(event).collect();
        let summary = Summary {
            final_error_m: self.tracking.final_error_m(),
            rms_error_m: self.tracking.rms_error_m(),
            max_error_m: self.tracking.max_error_m(),
            final_heading_error_rad: self.tracking.final_heading_error_rad(),
            measured: None,
            cycles: self.cycles,
            lost_frames: self.lost_frames,
            overruns: self.overruns,
            records_written: 0,
            records_dropped: 0,
            realtime_factor: self.realtime_factor,
            bus: self.bus,
            subdevices: self.subdevices,
            datagrams: self.datagrams,
            timing: self.timing.figures(&events),
            pauses: self.pauses,
            cpu_share: None,
            events,
        };
        Ran { summary, last: self.last, wished_end: self.tracking.wished_end(), finished, ended }
    }
}
