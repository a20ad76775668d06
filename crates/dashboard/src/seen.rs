//! What changes while a robot runs: one message for all pages, thirty times a second.

use std::sync::atomic::{AtomicU64, Ordering};

use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{Course, CycleRecord, DriveProgress, LimitedBy, Phase, SafetyReason};
use omnibase_run::channels::Rows;
use omnibase_run::live::{Commander, LiveEvent, Snapshot, StickState};
use omnibase_run::timing::TimingSeen;
use serde::Serialize;

/// The robot at one instant.
#[derive(Debug, Serialize)]
pub struct Seen {
    /// Time of the run, s.
    pub time_s: f64,
    /// Where the robot is in its life.
    pub phase: &'static str,
    /// Who commands: `nobody`, `joystick`, `page 2`, `command`; and whether by a stick.
    pub commander: String,
    /// A stick drives.
    pub by_stick: bool,
    /// What is followed.
    pub course: &'static str,
    /// The emergency stop is set.
    pub emergency_stop: bool,
    /// Blocked sticks: bit 0 the joystick's, then the pages'.
    pub blocked_sticks: u64,
    /// The stick at the robot's computer: `absent`, `present`, `lost` or `blocked`.
    pub joystick: &'static str,
    /// Why it last stopped, in words; empty where nothing did.
    pub stop_reason: &'static str,
    /// The number of the reference; 0 for the robot file's own.
    pub reference: u32,
    /// Where that began: x m, y m, heading rad.
    pub reference_start: Option<[f64; 3]>,
    /// Where it goes by the straight way: x m, y m, heading rad; nothing where it doesn't.
    pub goal: Option<[f64; 3]>,
    /// Its own time, s.
    pub reference_time_s: f64,
    /// It was begun and isn't at its end.
    pub reference_begun: bool,
    /// Where the robot is teaching since, s.
    pub teaching_since_s: Option<f64>,
    /// Cycles done, frames lost, cycles left out.
    pub counts: [u64; 3],
    /// Cycle times so far.
    pub timing: TimingSeen,
    /// Which controller of the robot's file has its say.
    pub controller: u64,
    /// The drives.
    pub drives: Vec<DriveSeen>,
    /// What may be set.
    pub settings: Vec<Setting>,
    /// Obstacles that are there.
    pub obstacles: Vec<ObstacleSeen>,
    /// What held the motion back: nothing, `fence` or `obstacle`.
    pub limited_by: &'static str,
    /// Every value, in the order of the robot's columns.
    pub values: Vec<f32>,
    /// What happened since the message before.
    pub events: Vec<EventSeen>,
    /// What the server counted.
    pub server: [u64; 5],
}

/// One drive.
#[derive(Debug, Serialize)]
pub struct DriveSeen {
    /// What it does.
    pub state: &'static str,
    /// Its error, in words; empty where it has none.
    pub error: String,
}

/// One obstacle, in odom.
#[derive(Debug, Serialize)]
pub struct ObstacleSeen {
    /// Its place.
    pub index: usize,
    /// Centre, m.
    pub x: f64,
    /// Centre, m.
    pub y: f64,
    /// Radius, m.
    pub radius: f64,
    /// Speed, m/s.
    pub velocity: [f64; 2],
}

/// A value that may be set.
#[derive(Debug, Serialize)]
pub struct Setting {
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Least and greatest allowed value.
    pub range: [f64; 2],
}

/// Something that happened.
#[derive(Clone, Debug, Serialize)]
pub struct EventSeen {
    /// Its number.
    pub number: u64,
    /// Time of the run, s.
    pub time_s: f64,
    /// In words.
    pub text: String,
}

/// What came in and was not carried out.
#[derive(Debug, Default)]
pub struct Counters {
    /// Connections refused: too many.
    pub crowded: AtomicU64,
    /// Requests refused: no right, or another origin.
    pub denied: AtomicU64,
    /// Messages that were no call.
    pub malformed: AtomicU64,
    /// Messages or bodies that were too long.
    pub oversized: AtomicU64,
    /// Messages dropped because too many came.
    pub flooding: AtomicU64,
}

impl Counters {
    /// One more.
    pub(crate) fn count(counter: &AtomicU64) {
        counter.fetch_add(1, Ordering::Relaxed);
    }

    /// The counts in their order.
    pub fn all(&self) -> [u64; 5] {
        [&self.crowded, &self.denied, &self.malformed, &self.oversized, &self.flooding]
            .map(|counter| counter.load(Ordering::Relaxed))
    }
}

impl Seen {
    /// The message of a snapshot.
    pub(crate) fn new(snapshot: &Snapshot, rows: &mut Rows) -> Self {
        let Snapshot { record, beside, .. } = snapshot;
        // Before the first cycle there is no record, and no wheel in it.
        let values = if snapshot.cycles == 0 { &[][..] } else { rows.of(record, beside).0 };
        let (commander, by_stick) = commander(beside.say.commander);
        let settings = snapshot.settings.iter().flatten().map(|gain| Setting {
            name: gain.name,
            value: gain.value,
            range: [gain.least, gain.greatest],
        });
        let there = snapshot.obstacles.iter().enumerate();
        let obstacles = there.filter_map(|(index, obstacle)| {
            let Obstacle { centre_m: [x, y], radius_m: radius, velocity_m_s: velocity } = (*obstacle)?;
            Some(ObstacleSeen { index, x, y, radius, velocity })
        });
        let pose = |pose: omnibase_platform::Pose2| [pose.x_m, pose.y_m, pose.heading_rad];
        Seen {
            time_s: record.time.now_ns as f64 * 1e-9,
            phase: phase_name(snapshot.phase),
            commander,
            by_stick,
            course: course_name(record.course),
            emergency_stop: beside.say.is_emergency,
            blocked_sticks: beside.say.blocked_sticks,
            joystick: match beside.say.joystick {
                StickState::Absent => "absent",
                StickState::Present => "present",
                StickState::Lost => "lost",
                StickState::Blocked => "blocked",
            },
            stop_reason: if record.stop_reason == SafetyReason::None {
                ""
            } else {
                record.stop_reason.text()
            },
            reference: snapshot.reference,
            reference_start: snapshot.reference_start.map(|start| pose(start.odom_from_body)),
            goal: snapshot.goal.filter(|_| record.course == Course::Way).map(pose),
            reference_time_s: record.reference_time_s,
            reference_begun: record.reference_begun != 0,
            teaching_since_s: None,
            counts: [snapshot.cycles, snapshot.lost_frames, snapshot.overruns],
            timing: snapshot.timing,
            controller: record.controller,
            drives: drives(record),
            settings: settings.collect(),
            obstacles: obstacles.collect(),
            limited_by: match record.guard.limited_by {
                LimitedBy::Nothing => "",
                LimitedBy::Fence => "fence",
                LimitedBy::Obstacle => "obstacle",
            },
            values: values.iter().map(|value| *value as f32).collect(),
            events: Vec::new(),
            server: [0; 5],
        }
    }
}

impl From<LiveEvent> for EventSeen {
    fn from(event: LiveEvent) -> Self {
        let who = event.client.map(|client| format!(" ({client})")).unwrap_or_default();
        EventSeen { number: event.number, time_s: event.time_s, text: format!("{}{who}", event.text) }
    }
}

fn commander(commander: Commander) -> (String, bool) {
    match commander {
        Commander::Nobody => ("nobody".to_owned(), false),
        Commander::Pad(client) => (client.to_string(), true),
        Commander::Reference(client) => (client.to_string(), false),
    }
}

fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Disabled => "disabled",
        Phase::Enabling => "enabling",
        Phase::Holding => "holding",
        Phase::Tracking => "tracking",
        Phase::Stopping => "stopping",
        Phase::QuickStopping => "quick stopping",
        Phase::Fault => "fault",
    }
}

fn course_name(course: Course) -> &'static str {
    match course {
        Course::Reference => "reference",
        Course::Velocity => "velocity",
        Course::Way => "way",
    }
}

fn drives(record: &CycleRecord) -> Vec<DriveSeen> {
    let state = |progress| match progress {
        DriveProgress::Unknown => "unknown",
        DriveProgress::UnderWay => "under way",
        DriveProgress::SwitchingMode => "switching mode",
        DriveProgress::Running => "running",
        DriveProgress::Idle => "idle",
        DriveProgress::QuickStop => "quick stop",
        DriveProgress::Fault => "fault",
        DriveProgress::Failed => "failed",
    };
    let seen = |drive: &omnibase_robot::signals::DriveMeasurement| DriveSeen {
        state: state(drive.progress),
        error: if drive.error.0 == 0 { String::new() } else { drive.error.to_string() },
    };
    record.measurements.present().iter().map(seen).collect()
}
