//! What happens behind the interface, by the segment's own time: states, watchdogs, and when the robot stands.

use crate::progress::note;
use omnibase_ethercat_sim::{Segment, SubDevice};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{AlState, AlStatusCode, HostTime};
use omnibase_robot_sim::SharedMachine;
use omnibase_robot_sim::machine::Truth;
use serde::Serialize;

/// Below this speed, and this turning speed, a robot stands: encoders of 20 bits can't tell it from rest.
const STANDS_M_S: f64 = 1e-4;
const STANDS_RAD_S: f64 = 1e-4;
/// Above this speed, or this turning speed, it moves.
const MOVES_M_S: f64 = 0.05;
const MOVES_RAD_S: f64 = 0.05;
/// Entries that are kept; what comes later is only shown.
const MOST_ENTRIES: usize = 10_000;

/// Something that happened, at a time since the start of the simulation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// When, s.
    pub time_s: f64,
    /// What.
    pub text: String,
}

/// A process-data watchdog that expired.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WatchdogStop {
    /// Position of the SubDevice.
    pub subdevice: usize,
    /// The time to which its watchdog was set, ms.
    pub set_ms: f64,
    /// When the last outputs came, s since the start of the simulation.
    pub last_outputs_s: f64,
    /// How long after that it expired, ms.
    pub after_ms: f64,
}

/// A robot that came to rest after drives had left OP with an error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Standstill {
    /// When the first drive left OP, s since the start of the simulation.
    pub left_op_s: f64,
    /// How fast the robot was then, m/s.
    pub speed_m_s: f64,
    /// How long it took from then to rest, ms.
    pub after_ms: f64,
    /// How far it came meanwhile, as the crow flies, m.
    pub distance_m: f64,
}

/// A SubDevice that reached OP.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Arrival {
    /// Position of the SubDevice.
    pub subdevice: usize,
    /// When, s since the start of the simulation.
    pub at_s: f64,
    /// How long after it had power, s.
    pub after_power_s: f64,
    /// The period of its SYNC0, us; null where it is off.
    pub sync0_us: Option<f64>,
    /// How far its clock was from the reference clock, ns (register 0x092C).
    pub clock_ns: u32,
}

/// Where the robot really is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TruePose {
    /// x, m.
    pub x_m: f64,
    /// y, m.
    pub y_m: f64,
    /// Heading, rad.
    pub heading_rad: f64,
}

/// Watches a segment and the machine behind it.
pub struct Logbook {
    start: HostTime,
    machine: Option<SharedMachine>,
    seen: Vec<LastState>,
    moving: bool,
    /// Since when drives let a moving robot go, and where it was.
    stopping: Option<Truth>,
    /// All that happened.
    pub entries: Vec<Entry>,
    /// Watchdogs that expired.
    pub watchdogs: Vec<WatchdogStop>,
    /// Stops that no MainDevice led.
    pub standstills: Vec<Standstill>,
    /// Ways to OP that ended there.
    pub arrivals: Vec<Arrival>,
}

/// What was seen of a SubDevice last.
#[derive(Clone, Copy, Debug, Default)]
struct LastState {
    state: Option<(AlState, AlStatusCode)>,
    expired: Option<HostTime>,
    /// Since when it has power.
    powered: HostTime,
    /// Its firmware, a program, isn't connected.
    is_awaited: bool,
}

impl Logbook {
    /// An empty one, for the segment as it stands.
    pub fn new(segment: &Segment, machine: Option<SharedMachine>) -> Self {
        let powered = segment.now();
        let seen = |one| LastState { state: state(one), powered, ..LastState::default() };
        let seen = segment.sub_devices().iter().map(seen);
        Logbook {
            start: segment.now(),
            machine,
            seen: seen.collect(),
            moving: false,
            stopping: None,
            entries: Vec::new(),
            watchdogs: Vec::new(),
            standstills: Vec::new(),
            arrivals: Vec::new(),
        }
    }

    /// Looks at the segment after something happened in it.
    pub fn look(&mut self, segment: &Segment) {
        let now = segment.now();
        for position in 0..self.seen.len() {
            let one = &segment.sub_devices()[position];
            self.look_at_watchdog(position, one);
            self.look_at_state(position, one, now);
            self.look_at_firmware(position, one, now);
        }
        self.look_at_machine(now);
    }

    fn look_at_watchdog(&mut self, position: usize, one: &SubDevice) {
        let Some(expiry) = one.esc().watchdog_expiry() else { return };
        if self.seen[position].expired.replace(expiry.expired) == Some(expiry.expired) {
            return;
        }
        let stop = WatchdogStop {
            subdevice: position,
            set_ms: expiry.set.as_nanos() as f64 * 1e-6,
            last_outputs_s: self.seconds(expiry.last_outputs),
            after_ms: (expiry.expired - expiry.last_outputs).as_nanos() as f64 * 1e-6,
        };
        let WatchdogStop { set_ms, after_ms, .. } = stop;
        self.note(
            expiry.expired,
            format!(
                "SubDevice {position}: the watchdog expired {after_ms:.3} ms after the last outputs, \
                 it is set to {set_ms:.3} ms"
            ),
        );
        self.watchdogs.push(stop);
    }

    fn look_at_state(&mut self, position: usize, one: &SubDevice, now: HostTime) {
        let state = state(one);
        let before = std::mem::replace(&mut self.seen[position].state, state);
        if before == state {
            return;
        }
        let words = match state {
            None => "no power".to_owned(),
            Some((state, AlStatusCode::NO_ERROR)) => state.to_string(),
            Some((state, code)) => format!("{state} with error {code}"),
        };
        self.note(now, format!("SubDevice {position}: {words}"));
        if before.is_none() {
            self.seen[position].powered = now;
        }
        if state == Some((AlState::Op, AlStatusCode::NO_ERROR)) && self.arrivals.len() < MOST_ENTRIES {
            let after_power_s = (now - self.seen[position].powered).as_secs_f64();
            let (sync0_us, clock_ns) = (sync0_us(one), clock_ns(one));
            let at_s = self.seconds(now);
            self.arrivals.push(Arrival { subdevice: position, at_s, after_power_s, sync0_us, clock_ns });
        }
        let was_op = before.is_some_and(|(state, _)| state == AlState::Op);
        let in_order = state.is_some_and(|(_, code)| code == AlStatusCode::NO_ERROR);
        if was_op && !in_order && self.stopping.is_none() {
            self.stopping = self.truth(now).filter(|_| self.moving);
        }
    }

    fn look_at_firmware(&mut self, position: usize, one: &SubDevice, now: HostTime) {
        let awaited = one.awaited_at();
        let was = std::mem::replace(&mut self.seen[position].is_awaited, awaited.is_some());
        match awaited {
            Some(path) if !was => {
                let path = path.display();
                self.note(
                    now,
                    format!("SubDevice {position}: no firmware is connected at `{path}`: nobody answers its requests"),
                );
            }
            None if was => self.note(now, format!("SubDevice {position}: its firmware is connected")),
            _ => {}
        }
    }

    fn look_at_machine(&mut self, now: HostTime) {
        let Some(machine) = &self.machine else { return };
        let stopping = self.stopping;
        // Running drives look by themselves; else the machine has to be moved on.
        let truth = if stopping.is_some() { self.truth(now) } else { Some(machine.truth()) };
        let Some(truth) = truth else { return };
        if !self.moving && moves(&truth) {
            self.moving = true;
            self.note(now, "the robot moves".to_owned());
        }
        if !self.moving || !stands(&truth) {
            return;
        }
        self.moving = false;
        let Some(began) = self.stopping.take() else {
            return self.note(now, "the robot stands".to_owned());
        };
        let stop = Standstill {
            left_op_s: self.seconds(HostTime(began.time_ns)),
            speed_m_s: began.twist_in_body.vx_m_s.hypot(began.twist_in_body.vy_m_s),
            after_ms: truth.time_ns.saturating_sub(began.time_ns) as f64 * 1e-6,
            distance_m: (truth.pose.x_m - began.pose.x_m).hypot(truth.pose.y_m - began.pose.y_m),
        };
        self.note(
            now,
            format!(
                "the robot stands: {:.1} ms and {:.1} mm after its drives left OP at {:.3} m/s",
                stop.after_ms,
                1e3 * stop.distance_m,
                stop.speed_m_s
            ),
        );
        self.standstills.push(stop);
    }

    /// The truth now. Drives that carry no current don't move the machine on: this does.
    fn truth(&self, now: HostTime) -> Option<Truth> {
        let mut machine = self.machine.as_ref()?.lock();
        machine.advance(now.0);
        Some(machine.truth())
    }

    /// Where the robot really is; `None` where there is none.
    pub fn true_pose(&self) -> Option<TruePose> {
        let pose = self.machine.as_ref()?.truth().pose;
        Some(TruePose { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad })
    }

    /// Notes what somebody did.
    pub fn note(&mut self, at: HostTime, text: String) {
        let time_s = self.seconds(at);
        note(format_args!("{time_s:>12.6} s  {text}"));
        if self.entries.len() < MOST_ENTRIES {
            self.entries.push(Entry { time_s, text });
        }
    }

    fn seconds(&self, at: HostTime) -> f64 {
        (at - self.start).as_nanos() as f64 * 1e-9
    }
}

/// Four bytes of its registers.
fn long(one: &SubDevice, address: u16) -> u32 {
    one.esc().peek(address, 4).and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes)
}

/// The period of its SYNC0, us; `None` where it is off.
fn sync0_us(one: &SubDevice) -> Option<f64> {
    const ON: u8 = 3;
    let is_on = one.esc().peek(reg::DC_ACTIVATION, 1).is_some_and(|byte| byte[0] & ON == ON);
    is_on.then(|| f64::from(long(one, reg::DC_SYNC0_CYCLE)) * 1e-3)
}

/// How far its clock is from the reference, ns; bit 31 is the sign.
fn clock_ns(one: &SubDevice) -> u32 {
    long(one, reg::DC_SYSTEM_TIME_DIFFERENCE) & 0x7FFF_FFFF
}

/// State and error of a SubDevice with power.
fn state(one: &SubDevice) -> Option<(AlState, AlStatusCode)> {
    let word = |address| one.esc().peek(address, 2).map(|bytes| u16::from_le_bytes([bytes[0], bytes[1]]));
    let status = word(reg::AL_STATUS).filter(|_| one.powered())?;
    let state = AlState::from_bits(status)?;
    let code = if status & AlState::ERROR == 0 { 0 } else { word(reg::AL_STATUS_CODE)? };
    Some((state, AlStatusCode(code)))
}

fn moves(truth: &Truth) -> bool {
    let twist = truth.twist_in_body;
    twist.vx_m_s.hypot(twist.vy_m_s) > MOVES_M_S || twist.w_rad_s.abs() > MOVES_RAD_S
}

fn stands(truth: &Truth) -> bool {
    let twist = truth.twist_in_body;
    twist.vx_m_s.hypot(twist.vy_m_s) < STANDS_M_S && twist.w_rad_s.abs() < STANDS_RAD_S
}
