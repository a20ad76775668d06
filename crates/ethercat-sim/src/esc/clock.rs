//! The local clock of a distributed-clock unit, and the loop that keeps it at the reference clock's time.
//!
//! The chip adjusts the pace of its local clock by a speed counter. Its law isn't published; this one is a
//! proportional-integral loop with the chip's range and its registers, critically damped at a bandwidth that
//! the speed counter start (0x0930) sets, as in the chip: larger is slower.

/// Speed counter start after power-on.
pub const SPEED_COUNTER_START_DEFAULT: u16 = 0x1000;
/// Filter depth of the system time difference after power-on.
pub const DIFFERENCE_FILTER_DEFAULT: u8 = 4;
/// Fraction bits of [`LocalClock`]: a unit is 2^-40 ns, or a relative speed of 2^-40.
const FRACTION: u32 = 40;
/// Angular frequency of the loop at the default speed counter start, rad/s: settled after about 0.2 s.
const BANDWIDTH_RAD_S: f64 = 40.0;
/// Bandwidth times the time between corrections stays under this, whatever the cycle: the loop is sampled.
const STABLE_STEP_RAD: f64 = 0.25;

/// A free-running counter of nanoseconds with a quartz error and a correction.
#[derive(Clone, Debug)]
pub struct LocalClock {
    base_host: u64,
    base: u128,
    drift: i64,
    /// What it shows more in a nanosecond, drift and correction included.
    pace: i64,
}

impl LocalClock {
    /// A clock that shows `start_ns` at `host` and is `drift_ppm` parts per million too fast.
    pub fn new(host: u64, start_ns: u64, drift_ppm: f64) -> Self {
        let drift = relative(drift_ppm * 1e-6);
        let base = u128::from(start_ns) << FRACTION;
        LocalClock { base_host: host, base, drift, pace: pace(drift, 0) }
    }

    /// What it shows at `host`, ns.
    pub fn at(&self, host: u64) -> u64 {
        (self.fine(host) >> FRACTION) as u64
    }

    fn fine(&self, host: u64) -> u128 {
        let shown = |ns: u64| i128::from(ns) * i128::from(self.pace);
        match host.checked_sub(self.base_host) {
            Some(elapsed) => self.base.wrapping_add_signed(shown(elapsed)),
            None => self.base.wrapping_sub_signed(shown(self.base_host - host)),
        }
    }

    /// Runs faster from `host` on by `speed`, a relative one; slower where negative.
    fn correct(&mut self, host: u64, speed: f64) {
        self.base = self.fine(host);
        self.base_host = host;
        self.pace = pace(self.drift, relative(speed));
    }

    /// The first host instant at which the clock has shown `ahead_ns` more than at `host`.
    pub fn host_after(&self, host: u64, ahead_ns: u64) -> u64 {
        let shown = self.fine(host);
        // What the clock shows is rounded down: the target is the full nanosecond.
        let target = ((shown >> FRACTION) + u128::from(ahead_ns)) << FRACTION;
        let missing = target.saturating_sub(shown);
        let estimate = match u64::try_from(missing) {
            // The usual case, a fast one: up to 16 ms ahead.
            Ok(short) => (short as f64 / self.pace as f64) as u64,
            Err(_) => u64::try_from(missing / self.pace.max(1) as u128).unwrap_or(u64::MAX),
        };
        let mut at = host.saturating_add(estimate);
        while self.fine(at) < target && at < u64::MAX {
            at += 1;
        }
        at
    }
}

/// A full unit, and what is added to it.
fn pace(drift: i64, correction: i64) -> i64 {
    (1 << FRACTION) + drift.saturating_add(correction).min(i64::MAX - (1 << FRACTION))
}

fn relative(speed: f64) -> i64 {
    (speed * (1u64 << FRACTION) as f64) as i64
}

/// The drift control loop: compares received system times with the own one.
#[derive(Clone, Debug)]
pub struct DriftControl {
    mean_ns: f64,
    integral_ns_s: f64,
    last: Option<u64>,
    speed_counter_start: u16,
    /// Bandwidth by the speed counter start, rad/s.
    bandwidth_rad_s: f64,
    /// Largest correction, relative: the speed counter difference reaches start − 0x7F.
    limit: f64,
    difference_depth: u8,
    command: f64,
}

impl Default for DriftControl {
    fn default() -> Self {
        DriftControl::new(SPEED_COUNTER_START_DEFAULT, DIFFERENCE_FILTER_DEFAULT)
    }
}

impl DriftControl {
    fn new(speed_counter_start: u16, difference_depth: u8) -> Self {
        let scale = f64::from(SPEED_COUNTER_START_DEFAULT) / f64::from(speed_counter_start);
        let start = f64::from(speed_counter_start);
        let most = start - 127.0;
        DriftControl {
            mean_ns: 0.0,
            integral_ns_s: 0.0,
            last: None,
            speed_counter_start,
            bandwidth_rad_s: BANDWIDTH_RAD_S * scale,
            limit: most / (5.0 * (start + most + 2.0) * (start - most + 2.0)),
            difference_depth,
            command: 0.0,
        }
    }

    /// Forgets differences and correction; `start` is the speed counter start (bandwidth).
    pub fn reset(&mut self, start: u16, clock: &mut LocalClock, host: u64) {
        *self = DriftControl::new(start.clamp(0x0080, 0x3FFF), self.difference_depth);
        clock.correct(host, 0.0);
    }

    /// The filter depth of the difference (0x0934): the mean is over 2^depth values.
    pub fn set_difference_depth(&mut self, depth: u8) {
        self.difference_depth = depth & 0x0F;
    }

    /// A system time arrived at `host`; the own one was `ahead_ns` ahead of it (behind where negative).
    pub fn compare(&mut self, ahead_ns: i32, clock: &mut LocalClock, host: u64) {
        let ahead = f64::from(ahead_ns);
        self.mean_ns += (ahead - self.mean_ns) / f64::from(1u32 << self.difference_depth);
        let last = self.last.replace(host);
        let Some(elapsed) = last.map(|last| host.saturating_sub(last)).filter(|&ns| ns > 0) else { return };
        let elapsed_s = elapsed as f64 * 1e-9;
        let bandwidth = self.bandwidth_rad_s.min(STABLE_STEP_RAD / elapsed_s);
        let integral = self.integral_ns_s + bandwidth * bandwidth * ahead * elapsed_s;
        let wanted = 2.0 * bandwidth * ahead + integral;
        let limit = self.limit * 1e9;
        // While the range is used up, integrating on would only have to be undone.
        if wanted.abs() < limit {
            self.integral_ns_s = integral;
        }
        self.command = wanted.clamp(-limit, limit) * 1e-9;
        clock.correct(host, -self.command);
    }

    /// Register 0x092C: bit 31 set where the own time is smaller, the rest the mean difference in ns.
    pub fn difference_register(&self) -> u32 {
        let magnitude = (self.mean_ns.abs() + 0.5).min(f64::from(0x7FFF_FFFFu32)) as u32;
        if self.mean_ns < 0.0 && magnitude > 0 { magnitude | 0x8000_0000 } else { magnitude }
    }

    /// Register 0x0932: the speed counter difference that stands for the present correction, by the datasheet's
    /// deviation = difference / (5 · (start + difference + 2) · (start − difference + 2)).
    pub fn speed_difference_register(&self) -> u16 {
        let deviation = self.command;
        if deviation == 0.0 {
            return 0;
        }
        let center = f64::from(self.speed_counter_start) + 2.0;
        // 5·k·d² + d − 5·k·c² = 0, solved for d.
        let k = 5.0 * deviation;
        let difference = ((1.0 + 4.0 * k * k * center * center).sqrt() - 1.0) / (2.0 * k);
        (difference as i16) as u16
    }

    /// Register 0x0930.
    pub fn speed_counter_start(&self) -> u16 {
        self.speed_counter_start
    }
}
