//! What changes while a robot runs: one message for all pages, thirty times a second.

use std::sync::atomic::{AtomicU64, Ordering};

use omnibase_measure::timing::TimingSeen;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{
    Course, CycleRecord, DriveMeasurement, DriveProgress, Exchange, LimitedBy, MAX_WHEELS, Phase,
    SafetyReason,
};
use omnibase_run::channels::Rows;
use omnibase_run::drive_errors::DriveErrors;
use omnibase_run::live::{Commander, JoystickState, LiveEvent, Snapshot, SourceCounts};
use schemars::JsonSchema;
use serde::Serialize;

use crate::room_seen::WaySeen;

/// A stamp's unit, ns.
pub(crate) const NS_OF_MS: u64 = 1_000_000;

/// The robot at one instant.
#[derive(Debug, Serialize, JsonSchema)]
pub struct StatusMessage {
    /// Time of the run, s.
    pub time_s: f64,
    /// The robot's own clock, ms: whoever asks for something sends back the last one that it had.
    pub stamp: u64,
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
    /// The joystick at the robot's computer: `absent`, `present`, `lost` or `blocked`.
    pub joystick: &'static str,
    /// Why it last stopped, in words; empty where nothing did.
    pub stop_reason: &'static str,
    /// Which drive that is about, in the order of the robot's file; nothing where it is about none.
    pub stop_drive: Option<u64>,
    /// Which SubDevice without a wheel that is about, in the order of the robot's file; nothing where it is about none.
    pub stop_device: Option<u64>,
    /// What is wrong with the axis about which it stopped, with its name; empty where it is about none.
    pub axis_problem: String,
    /// The number of the reference; 0 for the robot file's own.
    pub reference: u32,
    /// The number of the one that the next `track` begins: the same where none waits.
    pub reference_next: u32,
    /// Where that began: x m, y m, heading rad.
    pub reference_start: Option<[f64; 3]>,
    /// Where it goes by the straight way: x m, y m, heading rad; nothing where it doesn't.
    pub goal: Option<[f64; 3]>,
    /// The way to a pose that was asked for last (`drive_to`); nothing where none was.
    pub drive_to: Option<WaySeen>,
    /// How often walls were drawn: `/api/map` has them.
    pub walls: u32,
    /// Its own time, s.
    pub reference_time_s: f64,
    /// It was begun and isn't at its end.
    pub reference_begun: bool,
    /// Whether the reference, and the next one, is a way of `drive_to`, which alone begins it; nobody goes on with it.
    pub of_drive_to: [bool; 2],
    /// The pose is known; else somebody has to set it before a path is followed.
    pub pose_known: bool,
    /// In how many s the robot moves again without a person, after a loss; nothing where it doesn't.
    pub moves_again_in_s: Option<f64>,
    /// Where the robot is teaching since, s.
    pub teaching_since_s: Option<f64>,
    /// How many single points were remembered; nothing where nobody teaches points.
    pub taught_points: Option<usize>,
    /// Cycles done, frames lost, cycles left out.
    pub counts: [u64; 3],
    /// Cycle times so far.
    #[schemars(with = "serde_json::Map<String, serde_json::Value>")]
    pub timing: TimingSeen,
    /// Which controller of the robot's file has its say.
    pub controller: u64,
    /// The drives.
    pub drives: Vec<DriveSeen>,
    /// What may be set.
    pub settings: Vec<Setting>,
    /// Obstacles that are there.
    pub obstacles: Vec<ObstacleSeen>,
    /// The fence's corners in odom, m; none without a fence.
    pub fence: Vec<[f64; 2]>,
    /// What held the motion back: nothing, `fence` or `obstacle`.
    pub limited_by: &'static str,
    /// Every value, in the order of the robot's columns.
    pub values: Vec<f32>,
    /// What happened since the message before.
    pub events: Vec<EventSeen>,
    /// What became of what other programs sent, in the order of the robot's file.
    pub sources: Vec<SourceSeen>,
    /// What the server counted.
    pub server: [u64; 5],
}

/// What became of all that a program sent.
#[derive(Debug, Serialize, JsonSchema)]
pub struct SourceSeen {
    /// Taken.
    pub heard: u64,
    /// Too old when it came.
    pub late: u64,
    /// Overtaken by what was sent later, or ahead of the robot's clock.
    pub out_of_order: u64,
}

impl From<SourceCounts> for SourceSeen {
    fn from(SourceCounts { heard, late, out_of_order }: SourceCounts) -> Self {
        SourceSeen { heard, late, out_of_order }
    }
}

/// One drive.
#[derive(Debug, Serialize, JsonSchema)]
pub struct DriveSeen {
    /// What it does.
    pub state: &'static str,
    /// Its error, in words; empty where it has none.
    pub error: String,
}

/// One obstacle, in odom.
#[derive(Debug, Serialize, JsonSchema)]
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
#[derive(Debug, Serialize, JsonSchema)]
pub struct Setting {
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Least and greatest allowed value.
    pub range: [f64; 2],
}

/// Something that happened.
#[derive(Clone, Debug, Serialize, JsonSchema)]
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

impl StatusMessage {
    /// The message of a snapshot.
    pub(crate) fn new(snapshot: &Snapshot, rows: &mut Rows) -> Self {
        let Snapshot { record, extras, .. } = snapshot;
        // Before the first cycle there is no record, and no wheel in it.
        let values = if snapshot.cycles == 0 { &[][..] } else { rows.of(record, extras) };
        let (commander, by_stick) = commander(extras.authority.commander);
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
        StatusMessage {
            time_s: record.time.now_ns as f64 * 1e-9,
            stamp: record.time.now_ns / NS_OF_MS,
            phase: snapshot.phase.name(),
            commander,
            by_stick,
            course: course_name(record.course),
            emergency_stop: extras.authority.is_emergency,
            blocked_sticks: extras.authority.blocked_sticks,
            joystick: match extras.authority.joystick {
                JoystickState::Absent => "absent",
                JoystickState::Present => "present",
                JoystickState::Lost => "lost",
                JoystickState::Blocked => "blocked",
            },
            stop_reason: if record.stop_reason == SafetyReason::None {
                ""
            } else {
                record.stop_reason.text()
            },
            stop_drive: stop_drive(record),
            stop_device: stop_device(record),
            axis_problem: snapshot.axis_problem.to_string(),
            reference: snapshot.reference,
            reference_next: record.reference_next as u32,
            reference_start: snapshot.reference_start.map(|start| pose(start.odom_from_body)),
            drive_to: None,
            walls: 0,
            goal: snapshot.goal.filter(|_| record.course == Course::Way).map(pose),
            reference_time_s: record.reference_time_s,
            reference_begun: record.reference_begun != 0,
            of_drive_to: snapshot.is_looked_after,
            pose_known: record.state.pose_known,
            moves_again_in_s: extras.moves_again_in_s,
            teaching_since_s: None,
            taught_points: None,
            counts: [snapshot.cycles, snapshot.lost_frames, snapshot.overruns],
            timing: snapshot.timing,
            controller: record.controller,
            drives: drives(record, &snapshot.drive_errors),
            settings: settings.collect(),
            obstacles: obstacles.collect(),
            fence: snapshot.fence.corners_m().to_vec(),
            limited_by: match record.guard.limited_by {
                LimitedBy::Nothing => "",
                LimitedBy::Fence => "fence",
                LimitedBy::Obstacle => "obstacle",
            },
            values: values.iter().map(|value| *value as f32).collect(),
            events: Vec::new(),
            sources: Vec::new(),
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
        Commander::Stick(client) => (client.to_string(), true),
        Commander::Reference(client) => (client.to_string(), false),
    }
}

/// Why a request doesn't fit a phase, and what would.
pub(crate) fn unfit(phase: Phase) -> &'static str {
    match phase {
        Phase::Disabled => "refused: the robot is disabled: enable it first",
        Phase::Enabling => {
            "refused: the drives are on their way to operation: ask again when the robot holds"
        }
        Phase::Holding => "refused: the robot holds its place already",
        Phase::Tracking => "refused: the robot moves: pause or stop it first",
        Phase::Stopping | Phase::QuickStopping => {
            "refused: the robot comes to rest: ask again when it stands"
        }
        Phase::Fault => "refused: the robot was stopped by a fault: acknowledge it first",
    }
}

fn course_name(course: Course) -> &'static str {
    match course {
        Course::Reference => "reference",
        Course::Velocity => "velocity",
        Course::Way => "way",
        Course::Onto => "onto",
    }
}

fn stop_drive(record: &CycleRecord) -> Option<u64> {
    let is_about_one = matches!(
        record.stop_reason,
        SafetyReason::WheelSpeed
            | SafetyReason::WheelTorque
            | SafetyReason::Oscillation
            | SafetyReason::WheelSlip
            | SafetyReason::Wiring
            | SafetyReason::EncoderDirection
            | SafetyReason::WeakMotor
            | SafetyReason::Drive
            | SafetyReason::DeviceLost
    );
    // Beyond the wheels it is about a SubDevice without one.
    Some(record.stop_where).filter(|place| is_about_one && *place < record.measurements.wheels as u64)
}

/// Places beyond the wheels are those of SubDevices without one.
fn stop_device(record: &CycleRecord) -> Option<u64> {
    let is_about_one = matches!(record.stop_reason, SafetyReason::Axis | SafetyReason::DeviceLost);
    record.stop_where.checked_sub(MAX_WHEELS as u64).filter(|_| is_about_one)
}

fn drives(record: &CycleRecord, errors: &DriveErrors) -> Vec<DriveSeen> {
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
    // What a drive said before it was lost says nothing of it now.
    let away = match record.exchange {
        Exchange::Without { wheels, .. } => wheels,
        Exchange::Complete | Exchange::Lost | Exchange::ShortCount { .. } | Exchange::Restarted { .. } => 0,
    };
    let seen = |(n, drive): (usize, &DriveMeasurement)| DriveSeen {
        state: if away >> n & 1 == 1 { "lost" } else { state(drive.progress) },
        error: Some(errors.of(n))
            .filter(|error| error.0 != 0)
            .map_or(String::new(), |error| error.to_string()),
    };
    record.measurements.present().iter().enumerate().map(seen).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drive_that_failed_is_told_by_its_place_with_its_error() {
        let mut record = CycleRecord { exchange: Exchange::Complete, ..CycleRecord::default() };
        record.measurements.wheels = 3;
        record.measurements.drives[1].progress = DriveProgress::Fault;
        record.measurements.drives[1].error.0 = 0x8611;
        let mut errors = DriveErrors::default();
        errors.look(record.measurements.present());
        record.stop_where = 1;
        for reason in [
            SafetyReason::Drive,
            SafetyReason::DeviceLost,
            SafetyReason::WheelSpeed,
            SafetyReason::WheelTorque,
            SafetyReason::Oscillation,
            SafetyReason::WheelSlip,
            SafetyReason::Wiring,
            SafetyReason::EncoderDirection,
            SafetyReason::WeakMotor,
        ] {
            record.stop_reason = reason;
            assert_eq!(stop_drive(&record), Some(1), "{reason:?}");
        }
        let told: Vec<_> =
            drives(&record, &errors).into_iter().map(|drive| (drive.state, drive.error)).collect();
        let quiet = ("unknown", String::new());
        assert_eq!(told, [quiet.clone(), ("fault", "0x8611 (following error)".into()), quiet]);
        // A reason that is about no drive names none, whatever place stands beside it.
        for reason in [SafetyReason::None, SafetyReason::NotFinite, SafetyReason::ExchangeLost] {
            record.stop_reason = reason;
            assert_eq!(stop_drive(&record), None, "{reason:?}");
        }
    }

    #[test]
    fn a_subdevice_without_a_wheel_is_told_by_its_own_place() {
        let mut record = CycleRecord { stop_where: MAX_WHEELS as u64 + 1, ..CycleRecord::default() };
        record.measurements.wheels = 3;
        for reason in [SafetyReason::Axis, SafetyReason::DeviceLost] {
            record.stop_reason = reason;
            assert_eq!((stop_drive(&record), stop_device(&record)), (None, Some(1)), "{reason:?}");
        }
        // The place of an input.
        record.stop_reason = SafetyReason::StopInput;
        assert_eq!(stop_device(&record), None);
        (record.stop_reason, record.stop_where) = (SafetyReason::DeviceLost, 2);
        assert_eq!((stop_drive(&record), stop_device(&record)), (Some(2), None));
    }

    #[test]
    fn a_drive_that_is_away_is_lost_whatever_it_said_last() {
        let mut record = CycleRecord {
            exchange: Exchange::Without { wheels: 0b100, devices: 0 },
            ..CycleRecord::default()
        };
        record.measurements.wheels = 3;
        for drive in &mut record.measurements.drives {
            drive.progress = DriveProgress::Running;
        }
        let states: Vec<_> =
            drives(&record, &DriveErrors::default()).iter().map(|drive| drive.state).collect();
        assert_eq!(states, ["running", "running", "lost"]);
    }
}
