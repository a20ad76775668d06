//! The motor: how much of the torque that the drive asks for arrives at the shaft.

/// A servo motor with its current loop, and its gear if it has one.
///
/// The torque limit depends on the temperature of the winding: above nine tenths of the rise that the rated torque
/// gives in the long run it falls from peak to rated torque, as a drive's own overload protection would have it (I²t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorParameters {
    /// Torque that it can hold for ever.
    pub rated_torque_n_m: f64,
    /// Largest torque.
    pub peak_torque_n_m: f64,
    /// Inertia of the rotor.
    pub rotor_inertia_kg_m2: f64,
    /// Speed above which the voltage no longer allows the peak torque.
    pub rated_speed_rad_s: f64,
    /// Speed at which the voltage allows no torque in the direction of motion.
    pub maximum_speed_rad_s: f64,
    /// Time constant of the winding's heating.
    pub heating_time_constant_s: f64,
    /// Temperature of the surroundings, at which it starts.
    pub ambient_temperature_c: f64,
    /// How much warmer the winding gets by the rated torque.
    pub rated_temperature_rise_k: f64,
    /// Time constant of the current loop; 0 is an ideal one.
    pub current_loop_s: f64,
    /// Turns of the motor per turn of the wheel; negative if they turn against each other.
    pub gear_ratio: f64,
    /// What its shaft gives over what its current promises: below 1 for a motor that is weaker than its data sheet says.
    pub torque_ratio: f64,
    /// Torque that comes and goes with the shaft's angle.
    pub waves: Waves,
}

/// Torque of a motor that its drive neither asks for nor sees; none by default.
///
/// Of brushless servo motors cogging is 0.5 to 5 % of the rated torque, by slots and poles (the least common multiple of
/// both is its order), and ripple 1 to 5 % of the present torque, six times in an electrical turn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Waves {
    /// Amplitude of the torque towards the magnets' rest positions.
    pub cogging_n_m: f64,
    /// How often that comes in a turn.
    pub cogging_per_turn: f64,
    /// Amplitude of what is added to the torque, over the torque.
    pub ripple: f64,
    /// How often that comes in a turn.
    pub ripple_per_turn: f64,
}

impl Default for MotorParameters {
    /// A direct-drive motor of 7 N·m rated and 21 N·m peak torque.
    ///
    /// The torques are the BMM's. The others are assumptions of the order that data sheets of direct-drive motors of
    /// 135 mm diameter give (200 and 500 r/min, class A winding: 65 K over 40 °C), with a current loop of 1 kHz and a
    /// heating time constant that allows the peak torque for 12 s from cold.
    fn default() -> Self {
        Self {
            rated_torque_n_m: 7.0,
            peak_torque_n_m: 21.0,
            rotor_inertia_kg_m2: 0.0077,
            rated_speed_rad_s: 20.9,
            maximum_speed_rad_s: 52.4,
            heating_time_constant_s: 100.0,
            ambient_temperature_c: 40.0,
            rated_temperature_rise_k: 65.0,
            current_loop_s: 160e-6,
            gear_ratio: 1.0,
            torque_ratio: 1.0,
            waves: Waves::default(),
        }
    }
}

impl MotorParameters {
    /// The field that has no meaning, with its value and what it must be.
    pub fn problem(&self) -> Option<(&'static str, f64, &'static str)> {
        let positive = [
            ("rated_torque_n_m", self.rated_torque_n_m),
            ("peak_torque_n_m", self.peak_torque_n_m),
            ("rated_speed_rad_s", self.rated_speed_rad_s),
            ("maximum_speed_rad_s", self.maximum_speed_rad_s),
            ("heating_time_constant_s", self.heating_time_constant_s),
            ("rated_temperature_rise_k", self.rated_temperature_rise_k),
        ];
        if let Some((name, value)) = positive.into_iter().find(|(_, v)| !v.is_finite() || *v <= 0.0) {
            return Some((name, value, "positive"));
        }
        let Waves { cogging_n_m, cogging_per_turn, ripple, ripple_per_turn } = self.waves;
        let not_negative = [
            ("rotor_inertia_kg_m2", self.rotor_inertia_kg_m2),
            ("current_loop_s", self.current_loop_s),
            ("torque_ratio", self.torque_ratio),
            ("cogging_n_m", cogging_n_m),
            ("cogging_per_turn", cogging_per_turn),
            ("ripple", ripple),
            ("ripple_per_turn", ripple_per_turn),
        ];
        if let Some((name, value)) = not_negative.into_iter().find(|(_, v)| !v.is_finite() || *v < 0.0) {
            return Some((name, value, "zero or positive"));
        }
        if !self.ambient_temperature_c.is_finite() {
            return Some(("ambient_temperature_c", self.ambient_temperature_c, "a finite number"));
        }
        if !self.gear_ratio.is_finite() || self.gear_ratio == 0.0 {
            return Some(("gear_ratio", self.gear_ratio, "a finite number other than zero"));
        }
        if self.peak_torque_n_m < self.rated_torque_n_m {
            return Some(("peak_torque_n_m", self.peak_torque_n_m, "at least rated_torque_n_m"));
        }
        (self.maximum_speed_rad_s <= self.rated_speed_rad_s).then_some((
            "maximum_speed_rad_s",
            self.maximum_speed_rad_s,
            "more than rated_speed_rad_s",
        ))
    }
}

/// Fraction of the rated temperature rise from which the torque limit falls.
const WARM: f64 = 0.9;

/// Nearer than this to what is asked for, the torque has arrived.
const ARRIVED_N_M: f64 = 1e-9;

/// One motor and the state of its winding.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    parameters: MotorParameters,
    /// Of the way to a new torque, in one step.
    current_step: f64,
    /// Of the way to a new temperature, in one step.
    heating_step: f64,
    step_s: f64,
    wanted_n_m: f64,
    torque_n_m: f64,
    /// Temperature rise over that of the rated torque.
    heat: f64,
    /// The largest torque of a cold winding.
    cold_limit_n_m: f64,
}

impl Motor {
    /// A cold motor, advanced in steps of `step_s`.
    pub fn new(parameters: MotorParameters, step_s: f64) -> Self {
        let share = |time_constant_s: f64| -(-step_s / time_constant_s).exp_m1();
        Self {
            parameters,
            current_step: if parameters.current_loop_s > 0.0 {
                share(parameters.current_loop_s)
            } else {
                1.0
            },
            heating_step: share(parameters.heating_time_constant_s),
            step_s,
            wanted_n_m: 0.0,
            torque_n_m: 0.0,
            heat: 0.0,
            cold_limit_n_m: parameters.rated_torque_n_m
                + (parameters.peak_torque_n_m - parameters.rated_torque_n_m),
        }
    }

    /// Asks for a torque at the shaft, until the next call; anything but a number is none.
    pub fn ask(&mut self, torque_n_m: f64) {
        self.wanted_n_m = if torque_n_m.is_finite() { torque_n_m } else { 0.0 };
    }

    /// The torque that was asked for.
    pub fn asked_n_m(&self) -> f64 {
        self.wanted_n_m
    }

    /// The torque that its current promises now, as its drive sees it.
    pub fn torque_n_m(&self) -> f64 {
        self.torque_n_m
    }

    /// The torque at the shaft now, at this angle.
    pub fn shaft_torque_n_m(&self, angle_rad: f64) -> f64 {
        let given_n_m = self.parameters.torque_ratio * self.torque_n_m;
        let waves = &self.parameters.waves;
        if waves.cogging_n_m == 0.0 && waves.ripple == 0.0 {
            return given_n_m;
        }
        let ripple = 1.0 + waves.ripple * (waves.ripple_per_turn * angle_rad).sin();
        given_n_m * ripple - waves.cogging_n_m * (waves.cogging_per_turn * angle_rad).sin()
    }

    /// Makes it weaker, or as strong again; see [`MotorParameters::torque_ratio`].
    pub fn set_torque_ratio(&mut self, ratio: f64) {
        self.parameters.torque_ratio = ratio;
    }

    /// The largest torque that the winding's temperature allows.
    pub fn thermal_limit_n_m(&self) -> f64 {
        if self.heat <= WARM {
            return self.cold_limit_n_m;
        }
        let p = &self.parameters;
        let cool = ((1.0 - self.heat) / (1.0 - WARM)).max(0.0);
        p.rated_torque_n_m + cool * (p.peak_torque_n_m - p.rated_torque_n_m)
    }

    /// Temperature of the winding.
    pub fn winding_temperature_c(&self) -> f64 {
        self.parameters.ambient_temperature_c + self.heat * self.parameters.rated_temperature_rise_k
    }

    /// Temperature rise over that which the rated torque gives in the long run; the limit is 1.
    pub fn thermal_load(&self) -> f64 {
        self.heat
    }

    /// Its parameters.
    pub fn parameters(&self) -> &MotorParameters {
        &self.parameters
    }

    /// Moves on by one step at this speed of the shaft; the torque that its current promises during it.
    pub fn step(&mut self, speed_rad_s: f64) -> f64 {
        let p = &self.parameters;
        let limit = self.thermal_limit_n_m();
        // Braking is always possible; driving only as far as the voltage reaches.
        let reached = if speed_rad_s.abs() <= p.rated_speed_rad_s {
            p.peak_torque_n_m
        } else {
            let range = p.maximum_speed_rad_s - p.rated_speed_rad_s;
            p.peak_torque_n_m * ((p.maximum_speed_rad_s - speed_rad_s.abs()) / range).max(0.0)
        };
        let driving = if reached < limit { reached } else { limit };
        let (low, high) = if speed_rad_s >= 0.0 { (-limit, driving) } else { (-driving, limit) };
        let target = self.wanted_n_m.clamp(low, high);
        let missing = target - self.torque_n_m;
        let next =
            if missing.abs() < ARRIVED_N_M { target } else { self.torque_n_m + self.current_step * missing };
        self.torque_n_m = next.clamp(low, high);
        let load = self.torque_n_m / p.rated_torque_n_m;
        self.heat += self.heating_step * (load * load - self.heat);
        self.torque_n_m
    }

    /// Whether a rest of any length leaves it as it is but for its temperature: what is asked for has arrived and is allowed for ever.
    pub(crate) fn settled(&self) -> bool {
        self.torque_n_m == self.wanted_n_m && self.wanted_n_m.abs() <= self.parameters.rated_torque_n_m
    }

    /// Lets `steps` pass at rest with the present torque.
    pub(crate) fn rest(&mut self, steps: u64) {
        let load = self.torque_n_m / self.parameters.rated_torque_n_m;
        let passed_s = steps as f64 * self.step_s;
        let fade = (-passed_s / self.parameters.heating_time_constant_s).exp();
        self.heat = load * load + (self.heat - load * load) * fade;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 125e-6;

    fn run(motor: &mut Motor, seconds: f64, speed_rad_s: f64) -> f64 {
        let mut torque = 0.0;
        for _ in 0..(seconds / STEP_S).round() as usize {
            torque = motor.step(speed_rad_s);
        }
        torque
    }

    #[test]
    fn torque_is_limited_to_the_peak_and_comes_with_the_current_loop() {
        let mut motor = Motor::new(MotorParameters::default(), STEP_S);
        motor.ask(100.0);
        let first = motor.step(0.0);
        // 1 − e^(−125/160) of the way.
        assert!((first - 21.0 * 0.542_2).abs() < 1e-3, "{first}");
        assert!((run(&mut motor, 0.01, 0.0) - 21.0).abs() < 1e-9);
        motor.ask(f64::NAN);
        assert!(run(&mut motor, 0.01, 0.0).abs() < 1e-9);
    }

    #[test]
    fn rated_torque_heats_with_the_time_constant_and_is_never_limited() {
        let mut motor = Motor::new(MotorParameters::default(), STEP_S);
        motor.ask(7.0);
        run(&mut motor, 100.0, 1.0);
        // One time constant: 1 − 1/e of 65 K over 40 °C.
        let exact = 40.0 + 65.0 * (1.0 - (-1.0_f64).exp());
        assert!((motor.winding_temperature_c() - exact).abs() < 0.01, "{}", motor.winding_temperature_c());
        let torque = run(&mut motor, 900.0, 1.0);
        assert!((torque - 7.0).abs() < 1e-9, "{torque}");
        assert!((motor.winding_temperature_c() - 105.0).abs() < 0.01, "{}", motor.winding_temperature_c());
    }

    #[test]
    fn peak_torque_lasts_some_seconds_then_falls_to_rated() {
        let mut motor = Motor::new(MotorParameters::default(), STEP_S);
        motor.ask(21.0);
        let mut held_s = 0.0;
        while run(&mut motor, 0.1, 1.0) > 21.0 - 1e-6 {
            held_s += 0.1;
            assert!(held_s < 100.0);
        }
        // Heat reaches 0.9 at −T·ln(1 − 0.9/9).
        assert!((held_s - 100.0 * -(0.9_f64).ln()).abs() < 0.2, "{held_s}");
        let torque = run(&mut motor, 500.0, 1.0);
        assert!((torque - 7.0).abs() < 0.1, "{torque}");
        assert!(motor.thermal_load() < 1.01, "{}", motor.thermal_load());
        // Rest cools it, and the peak is back.
        motor.ask(0.0);
        run(&mut motor, 300.0, 0.0);
        motor.ask(21.0);
        assert!((run(&mut motor, 0.1, 1.0) - 21.0).abs() < 1e-6);
    }

    #[test]
    fn voltage_limits_driving_but_not_braking() {
        let mut motor = Motor::new(MotorParameters::default(), STEP_S);
        motor.ask(21.0);
        assert!((run(&mut motor, 0.01, 20.0) - 21.0).abs() < 1e-6);
        let half = 0.5 * (20.9 + 52.4);
        assert!((run(&mut motor, 0.01, half) - 10.5).abs() < 1e-6);
        assert_eq!(run(&mut motor, 0.01, 60.0), 0.0);
        assert!((run(&mut motor, 0.01, -60.0) - 21.0).abs() < 1e-6);
    }

    #[test]
    fn a_rest_in_one_go_cools_like_one_in_steps() {
        let mut stepped = Motor::new(MotorParameters::default(), STEP_S);
        stepped.ask(15.0);
        run(&mut stepped, 5.0, 1.0);
        stepped.ask(0.0);
        run(&mut stepped, 0.1, 0.0);
        let mut at_once = stepped;
        run(&mut stepped, 20.0, 0.0);
        at_once.rest(160_000);
        assert!((stepped.thermal_load() - at_once.thermal_load()).abs() < 1e-9);
    }

    #[test]
    fn figures_without_meaning_are_named() {
        let sound = MotorParameters::default();
        assert_eq!(sound.problem(), None);
        let weak = MotorParameters { peak_torque_n_m: 5.0, ..sound };
        assert_eq!(weak.problem(), Some(("peak_torque_n_m", 5.0, "at least rated_torque_n_m")));
        let ungeared = MotorParameters { gear_ratio: 0.0, ..sound };
        assert_eq!(ungeared.problem(), Some(("gear_ratio", 0.0, "a finite number other than zero")));
        let hot = MotorParameters { heating_time_constant_s: -1.0, ..sound };
        assert_eq!(hot.problem(), Some(("heating_time_constant_s", -1.0, "positive")));
    }
}
