//! A simulated robot on virtual time, cycle by cycle, each where its owner asks for it, where wished at the host's pace.

use std::sync::atomic::AtomicBool;

use omnibase_ethercat::wire::LinkError;
use omnibase_ethercat_sim::{SimLink, in_process};
use omnibase_measure::tracking::Tracking;
use omnibase_measure::truth::{TruePlatform, Witness};
use omnibase_record::run::RunSchema;
use omnibase_robot::signals::{CycleRecord, CycleTime, Phase};
use omnibase_robot::{Registry, Request, Robot, RobotPlan, StageError};
use omnibase_session::session::{Session, SessionError};

use crate::channels::{CycleExtras, Known, Rows};
use crate::conductor::{Conductor, Wish};
use crate::pace::{Pace, PacedClock};
use crate::simulated::{self, Script, Sensors, SimulationError};

/// Why a simulated robot can't be made.
#[derive(Debug, thiserror::Error)]
pub enum NotBegun {
    /// Its stages.
    #[error(transparent)]
    Stages(#[from] StageError),
    /// The machine behind it.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// Its bus.
    #[error(transparent)]
    Session(#[from] SessionError),
}

/// Who leads the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leader {
    /// The run's own plan: enabled, its reference followed to the end, disabled, as by the command line.
    Plan,
    /// Whoever steps it.
    Owner,
}

/// A simulated robot in OP, with everything of a run but people, recording and pace. The same requests in the same cycles give
/// the same bits, and those of a run on virtual time.
pub struct Stepped {
    plan: RobotPlan,
    robot: Robot,
    session: Session<SimLink, PacedClock>,
    pace: Pace,
    script: Option<Script>,
    sensors: Option<Sensors>,
    witness: Witness,
    conductor: Option<Conductor>,
    tracking: Tracking,
    rows: Rows,
    last: CycleRecord,
    extras: CycleExtras,
    cycles: u64,
}

impl Stepped {
    /// Brings the simulated robot of a plan to OP; nothing is enabled, no cycle is computed. `warn` is told what a person should
    /// know of its bus.
    pub fn begin(
        plan: RobotPlan,
        registry: &Registry,
        leader: Leader,
        warn: &mut dyn FnMut(String),
    ) -> Result<Self, NotBegun> {
        let built = plan.clone();
        Stepped::begin_on(&built, plan, registry, leader, warn)
    }

    /// As [`Stepped::begin`], on the machine of another plan: what is built isn't quite what the robot's file says.
    pub fn begin_on(
        built: &RobotPlan,
        plan: RobotPlan,
        registry: &Registry,
        leader: Leader,
        warn: &mut dyn FnMut(String),
    ) -> Result<Self, NotBegun> {
        let robot = Robot::build(&plan, registry)?;
        // Whatever was built otherwise, its sensors speak as the plan says.
        let mut built = built.clone();
        built.simulation.sensor.clone_from(&plan.simulation.sensor);
        let (mut segment, machine) = simulated::segment(&built)?;
        let script = Script::new(&plan, &mut segment, &machine);
        let (link, clock) = in_process(segment);
        let (clock, pace) = PacedClock::free(clock);
        let mut session = Session::prepare(link, clock, &plan, warn)?;
        session.reach_op(&AtomicBool::new(false))?;
        let leads = leader == Leader::Plan;
        Ok(Stepped {
            robot,
            session,
            pace,
            script,
            sensors: Sensors::new(&plan),
            witness: Witness::new(machine),
            conductor: leads.then(|| Conductor::new(plan.safety.comeback)),
            tracking: Tracking::default(),
            rows: Rows::new(&plan.record_layout(), Known::Truth),
            last: CycleRecord::default(),
            extras: CycleExtras::default(),
            cycles: 0,
            plan,
        })
    }

    /// One cycle; what is asked counts where the plan asks for nothing itself.
    pub fn step(&mut self, asked: Option<Request>) -> Result<&CycleRecord, LinkError> {
        let (exchange, times) = self.session.exchange()?;
        let index = if self.cycles == 0 { 0 } else { self.last.time.index + times.periods };
        let time = CycleTime::on_grid(index, self.plan.bus.cycle_ns);
        self.cycles += 1;
        while self.script.as_mut().and_then(|script| script.next(time.now_ns)).is_some() {}
        let phase = self.robot.phase();
        let planned = self.conductor.as_mut().and_then(|plan| plan.next(&self.last, phase, Wish::GoOn));
        let request = planned.map(Request::lasting).or(asked);
        if let Some(sensors) = &mut self.sensors {
            sensors.hear(&mut self.robot, time.now_ns);
        }
        self.last = *self.robot.compute(time, exchange, request, self.session.image());
        let truth = self.witness.look(times.wake.0.saturating_sub(self.plan.input_age_ns()));
        if let Some(sensors) = &mut self.sensors {
            sensors.look(time.now_ns.saturating_sub(self.plan.input_age_ns()), &truth);
        }
        let plan = self.conductor.as_ref();
        self.extras = CycleExtras {
            times,
            bus: self.session.figures(),
            errors: self.tracking.take(&self.last, Some(&truth)),
            moves_again_in_s: plan.and_then(|plan| plan.moves_again_in_s(time.now_ns)),
            truth: Some(truth),
            ..CycleExtras::default()
        };
        self.session.look_at_drives(self.last.measurements.present());
        while self.session.take_event().is_some() {}
        while let Some((wheel, error)) = self.session.take_said() {
            self.conductor.iter_mut().for_each(|plan| plan.drive_said(wheel, error));
        }
        Ok(&self.last)
    }

    /// From now on a cycle begins no earlier than the host's clock says; the bits stay the same.
    pub fn keep_pace(&self) {
        self.pace.keep();
    }

    /// What the robot is made of.
    pub fn plan(&self) -> &RobotPlan {
        &self.plan
    }

    /// What it does.
    pub fn phase(&self) -> Phase {
        self.robot.phase()
    }

    /// What is wrong with each drive that has a problem: its name, and the problem.
    pub fn drive_problems(&self) -> impl Iterator<Item = (&str, String)> {
        let name = |wheel: usize| self.plan.drives.get(wheel).map_or("?", |drive| drive.name.as_str());
        self.robot.drive_problems().map(move |(wheel, problem)| (name(wheel), problem))
    }

    /// The last cycle.
    pub fn record(&self) -> &CycleRecord {
        &self.last
    }

    /// Where it really was when its encoders were read for the last cycle.
    pub fn truth(&self) -> TruePlatform {
        self.extras.truth.unwrap_or_default()
    }

    /// Whether the run's own plan led it to its end, or gave up.
    pub fn is_over(&self) -> bool {
        self.conductor.as_ref().is_some_and(Conductor::is_over)
    }

    /// Whether the run's own plan led it to the end of its reference.
    pub fn has_finished(&self) -> bool {
        self.conductor.as_ref().is_some_and(Conductor::has_finished)
    }

    /// The names of [`Stepped::row`], those of a recording.
    pub fn schema(&self) -> &RunSchema {
        self.rows.schema()
    }

    /// The last cycle as a row of a recording.
    pub fn row(&mut self) -> &[f64] {
        self.rows.of(&self.last, &self.extras)
    }
}
