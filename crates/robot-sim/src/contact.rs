//! One step of stick and slip, solved for the velocities at its end.
//!
//! With the normal loads known, the velocities at the end of a step minimise a convex function: the kinetic
//! distance to where the torques alone would bring the machine, plus the work of all dry frictions (J. J.
//! Moreau's time-stepping in velocities).
//!
//! Each friction is a force that opposes a slip speed `s`, `−clamp(k·s, ±limit)`: a very steep line (or the
//! creep of the tread, or an elastic tread's line, see [`tread`](crate::tread)) while it sticks, constant while
//! it slides.
//!
//! Every wheel's speed couples only with the body's three velocities, so each Newton step is one 3×3 system;
//! started from the last step's sticking and sliding contacts it mostly is the only one. Where plain Newton
//! steps wander, an exact line search makes them converge.

/// Slip speed below which a contact counts as sticking. A thousandth of a micrometre a second: it only makes the
/// equations solvable where more contacts stick than there are velocities; a machine that sticks everywhere is put to rest.
pub(crate) const STICTION_M_S: f64 = 1e-9;
/// The same for the friction about an axle.
pub(crate) const STICTION_RAD_S: f64 = 1e-8;
/// Change of speed in one step below which a machine that sticks on elastic contacts is put to rest: where it swings, at
/// 50 to 1000 rad/s, it is then slower than stiction.
const CALM_M_S: f64 = 1e-11;

/// Relative tolerance of the border between sticking and sliding: rounding of a slip speed at 1 m/s is 1e-16 m/s.
const BORDER: f64 = 1e-5;
const PLAIN_STEPS: u32 = 8;
const SEARCH_STEPS: u32 = 60;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Regime {
    #[default]
    Stick,
    Forward,
    Backward,
}

/// One dry friction: the force `−clamp(constant + slope·s, ±limit)` against the slip speed `s`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Friction {
    limit: f64,
    /// Slip speed at which there is no force.
    centre: f64,
    /// How far from there the limit is reached.
    width: f64,
    /// Constant and slope of an elastic contact.
    elastic: Option<(f64, f64)>,
    pub(crate) regime: Regime,
}

impl Friction {
    pub(crate) fn set(&mut self, limit: f64, width: f64) {
        self.limit = limit;
        self.centre = 0.0;
        self.width = width;
        self.elastic = None;
    }

    /// Up to the limit that was set, the resistance of an elastic contact: `constant + slope·s`.
    pub(crate) fn set_line(&mut self, constant: f64, slope: f64) {
        self.centre = -constant / slope;
        self.width = self.limit / slope;
        self.elastic = Some((constant, slope));
    }

    /// Whether there is no friction at all.
    pub(crate) fn is_idle(&self) -> bool {
        self.limit == 0.0
    }

    /// Constant and slope while it sticks: a quotient that what slides doesn't need.
    fn sticking(&self) -> (f64, f64) {
        self.elastic.unwrap_or_else(|| (0.0, self.limit / self.width))
    }

    /// Resistance (the force's negative) as the line `constant + slope·s` of the present regime.
    fn line(&self) -> (f64, f64) {
        match self.regime {
            Regime::Stick => self.sticking(),
            Regime::Forward => (self.limit, 0.0),
            Regime::Backward => (-self.limit, 0.0),
        }
    }

    pub(crate) fn resistance(&self, slip: f64) -> f64 {
        let (_, slope) = self.sticking();
        (slope * (slip - self.centre)).clamp(-self.limit, self.limit)
    }

    /// The regime at a slip speed; the borders belong to both sides, so that rounding can't make it flicker.
    fn regime_at(&self, slip: f64) -> Regime {
        let relative = match self.regime {
            Regime::Stick => 1.0 + BORDER,
            Regime::Forward | Regime::Backward => 1.0 - BORDER,
        };
        let beside = slip - self.centre;
        if beside.abs() <= self.width * relative {
            Regime::Stick
        } else if beside > 0.0 {
            Regime::Forward
        } else {
            Regime::Backward
        }
    }

    /// Takes the regime at `slip`, but never jumps from one sliding direction to the other; `true` if it changed.
    #[inline]
    fn follow(&mut self, slip: f64) -> bool {
        let beside = slip - self.centre;
        let stays = match self.regime {
            Regime::Stick => beside.abs() <= self.width * (1.0 + BORDER),
            Regime::Forward => beside > self.width * (1.0 - BORDER),
            Regime::Backward => -beside > self.width * (1.0 - BORDER),
        };
        if stays {
            return false;
        }
        self.regime = match self.regime {
            Regime::Stick if beside > 0.0 => Regime::Forward,
            Regime::Stick => Regime::Backward,
            Regime::Forward | Regime::Backward => Regime::Stick,
        };
        // Without a limit there is no force, whatever the regime.
        self.limit > 0.0
    }
}

/// One wheel in the equations of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wheel {
    /// Slip along the force direction is `along·v − arm_along·speed`.
    pub(crate) along: [f64; 3],
    pub(crate) arm_along: f64,
    /// Slip across it is `across·v − arm_across·speed`.
    pub(crate) across: [f64; 3],
    pub(crate) arm_across: f64,
    /// Spin inertia over step, plus viscous friction.
    pub(crate) stiffness: f64,
    /// Spin inertia over step times speed before, plus motor torque.
    pub(crate) drive: f64,
    /// Its contact gives way while it sticks.
    pub(crate) is_elastic: bool,
    pub(crate) grip: Friction,
    pub(crate) roller: Friction,
    pub(crate) axle: Friction,
    pub(crate) speed: f64,
    pub(crate) trial: Trial,
}

/// What the last Newton step says about a wheel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Trial {
    /// Its speed, as `free + pull_along·(along·v) + pull_across·(across·v)`.
    speed: f64,
    free: f64,
    pull_along: f64,
    pull_across: f64,
    /// Its slip speeds.
    pub(crate) along: f64,
    pub(crate) across: f64,
}

/// The body in the equations of a step: mass, mass and yaw inertia over step, and their momentum over step with forces.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mass {
    pub(crate) stiffness: [f64; 3],
    pub(crate) drive: [f64; 3],
}

pub(crate) fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Wheel {
    pub(crate) fn slip_along(&self, v: &[f64; 3], speed: f64) -> f64 {
        dot(&self.along, v) - self.arm_along * speed
    }

    pub(crate) fn slip_across(&self, v: &[f64; 3], speed: f64) -> f64 {
        dot(&self.across, v) - self.arm_across * speed
    }

    /// Forces of the floor on the wheel, along and across, at the slip speeds of the last Newton step.
    pub(crate) fn forces(&self) -> [f64; 2] {
        [-self.grip.resistance(self.trial.along), -self.roller.resistance(self.trial.across)]
    }

    fn try_at(&mut self, v: &[f64; 3]) {
        let (along, across) = (dot(&self.along, v), dot(&self.across, v));
        let trial = &mut self.trial;
        trial.speed = trial.free + trial.pull_along * along + trial.pull_across * across;
        trial.along = along - self.arm_along * trial.speed;
        trial.across = across - self.arm_across * trial.speed;
    }

    fn follow(&mut self) -> bool {
        let grip = self.grip.follow(self.trial.along);
        let roller = self.roller.follow(self.trial.across);
        let axle = self.axle.follow(self.trial.speed);
        grip | roller | axle
    }

    /// Whether friction holds the wheel, on its axle and on the floor.
    fn at_rest(&self) -> bool {
        self.grip.limit > 0.0
            && self.axle.limit > 0.0
            && self.grip.regime == Regime::Stick
            && self.roller.regime == Regime::Stick
            && self.axle.regime == Regime::Stick
    }
}

/// Solves the step; leaves each wheel's speed in `speed` and returns the body's velocities.
pub(crate) fn solve(mass: &Mass, wheels: &mut [Wheel], start: [f64; 3]) -> [f64; 3] {
    let v = balance(mass, wheels, start);
    // What sticks on an elastic contact may still swing: then it also has to be slow, and to stay so.
    let is_calm =
        || v.iter().zip(&start).all(|(v, start)| v.abs() < STICTION_M_S && (v - start).abs() < CALM_M_S);
    if wheels.iter().all(Wheel::at_rest) && (is_calm() || !wheels.iter().any(|wheel| wheel.is_elastic)) {
        wheels.iter_mut().for_each(|wheel| wheel.speed = 0.0);
        return [0.0; 3];
    }
    v
}

/// Finds the velocities at which all forces balance, stiction as the steep line that it is here.
fn balance(mass: &Mass, wheels: &mut [Wheel], start: [f64; 3]) -> [f64; 3] {
    for _ in 0..PLAIN_STEPS {
        let v = newton(mass, wheels);
        let mut changed = false;
        for wheel in wheels.iter_mut() {
            wheel.try_at(&v);
            changed |= wheel.follow();
        }
        if !changed {
            wheels.iter_mut().for_each(|wheel| wheel.speed = wheel.trial.speed);
            return v;
        }
    }
    search(mass, wheels, start)
}

/// Solves the equations with every friction on the line of its regime; what a wheel's speed follows from goes to `trial`.
fn newton(mass: &Mass, wheels: &mut [Wheel]) -> [f64; 3] {
    let [mut h00, mut h11, mut h22] = mass.stiffness;
    let (mut h01, mut h02, mut h12) = (0.0, 0.0, 0.0);
    let mut rhs = mass.drive;
    for wheel in wheels.iter_mut() {
        let (grip, grip_slope) = wheel.grip.line();
        let (roller, roller_slope) = wheel.roller.line();
        let (axle, axle_slope) = wheel.axle.line();
        let (a, t) = (&wheel.along, &wheel.across);
        // The wheel's own equation gives its speed from the body's velocities; put into the body's equations so that
        // the steep slopes never appear as a difference of large numbers.
        let e = wheel.stiffness + axle_slope;
        let stick_a = wheel.arm_along * wheel.arm_along * grip_slope;
        let stick_t = wheel.arm_across * wheel.arm_across * roller_slope;
        let inverse = 1.0 / (e + stick_a + stick_t);
        let drive = wheel.drive - axle + wheel.arm_along * grip + wheel.arm_across * roller;
        let pull_along = grip_slope * wheel.arm_along * inverse;
        let pull_across = roller_slope * wheel.arm_across * inverse;
        let push_a = pull_along * drive - grip;
        let push_t = pull_across * drive - roller;
        let aa = grip_slope * (e + stick_t) * inverse;
        let (m0, m1, m2) = (aa * a[0], aa * a[1], aa * a[2]);
        h00 += a[0] * m0;
        h01 += a[0] * m1;
        h02 += a[0] * m2;
        h11 += a[1] * m1;
        h12 += a[1] * m2;
        h22 += a[2] * m2;
        if roller_slope > 0.0 {
            let tt = roller_slope * (e + stick_a) * inverse;
            let at = -pull_along * wheel.arm_across * roller_slope;
            let (n0, n1, n2) = (at * a[0] + tt * t[0], at * a[1] + tt * t[1], at * a[2] + tt * t[2]);
            h00 += t[0] * (at * a[0] + n0);
            h01 += at * a[0] * t[1] + t[0] * n1;
            h02 += at * a[0] * t[2] + t[0] * n2;
            h11 += t[1] * (at * a[1] + n1);
            h12 += at * a[1] * t[2] + t[1] * n2;
            h22 += t[2] * (at * a[2] + n2);
        }
        rhs[0] += a[0] * push_a + t[0] * push_t;
        rhs[1] += a[1] * push_a + t[1] * push_t;
        rhs[2] += a[2] * push_a + t[2] * push_t;
        let trial = &mut wheel.trial;
        (trial.free, trial.pull_along, trial.pull_across) = (drive * inverse, pull_along, pull_across);
    }
    // LDLᵀ of a positive definite matrix: no pivoting needed.
    let d0 = 1.0 / h00;
    let (l10, l20) = (h01 * d0, h02 * d0);
    let d1 = 1.0 / (h11 - l10 * h01);
    let s12 = h12 - l10 * h02;
    let l21 = s12 * d1;
    let d2 = 1.0 / (h22 - l20 * h02 - l21 * s12);
    let y0 = rhs[0];
    let y1 = rhs[1] - l10 * y0;
    let y2 = rhs[2] - l20 * y0 - l21 * y1;
    let v2 = y2 * d2;
    let v1 = y1 * d1 - l21 * v2;
    let v0 = y0 * d0 - l10 * v1 - l20 * v2;
    [v0, v1, v2]
}

/// Newton's method with exact line search on the convex function; used where plain steps cycle between regimes.
fn search(mass: &Mass, wheels: &mut [Wheel], start: [f64; 3]) -> [f64; 3] {
    let mut v = start;
    for _ in 0..SEARCH_STEPS {
        let mut changed = false;
        for wheel in wheels.iter_mut() {
            let (along, across) = (wheel.slip_along(&v, wheel.speed), wheel.slip_across(&v, wheel.speed));
            wheel.grip.regime = wheel.grip.regime_at(along);
            wheel.roller.regime = wheel.roller.regime_at(across);
            wheel.axle.regime = wheel.axle.regime_at(wheel.speed);
        }
        let target = newton(mass, wheels);
        for wheel in wheels.iter_mut() {
            wheel.try_at(&target);
            changed |= wheel.grip.regime_at(wheel.trial.along) != wheel.grip.regime
                || wheel.roller.regime_at(wheel.trial.across) != wheel.roller.regime
                || wheel.axle.regime_at(wheel.trial.speed) != wheel.axle.regime;
        }
        let t = if changed { minimum_along(mass, wheels, &v, &target) } else { 1.0 };
        for i in 0..3 {
            v[i] += t * (target[i] - v[i]);
        }
        for wheel in wheels.iter_mut() {
            wheel.speed += t * (wheel.trial.speed - wheel.speed);
        }
        if !changed {
            return target;
        }
    }
    v
}

/// Where on the way from the present velocities (0) to the Newton step's (1) the convex function is least.
fn minimum_along(mass: &Mass, wheels: &[Wheel], v: &[f64; 3], target: &[f64; 3]) -> f64 {
    let slope = |t: f64| -> f64 {
        let at = [0, 1, 2].map(|i| v[i] + t * (target[i] - v[i]));
        let mut sum: f64 =
            (0..3).map(|i| (mass.stiffness[i] * at[i] - mass.drive[i]) * (target[i] - v[i])).sum();
        for wheel in wheels {
            let change = wheel.trial.speed - wheel.speed;
            let speed = wheel.speed + t * change;
            let direction = [0, 1, 2].map(|i| target[i] - v[i]);
            sum += (wheel.stiffness * speed - wheel.drive + wheel.axle.resistance(speed)) * change;
            sum += wheel.grip.resistance(wheel.slip_along(&at, speed)) * wheel.slip_along(&direction, change);
            sum += wheel.roller.resistance(wheel.slip_across(&at, speed))
                * wheel.slip_across(&direction, change);
        }
        sum
    };
    if slope(1.0) <= 0.0 {
        return 1.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    // 60 halvings reach the last bit of a number below one.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if slope(middle) > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests;
