//! The friction that is counted on: what the estimate supports, less after each slip, more with each metre of grip.

use super::PLANNED;
use crate::config::GripPlan;
use crate::signals::GripReport;

/// So many standard deviations below what was found: of twenty estimates one is worse (a normal distribution).
const SIGMAS: f64 = 1.645;
/// Friction of wet ice: no floor has less.
const LEAST: f64 = 0.01;
/// More than this holds nothing back: the floor is as good as any.
const ENOUGH: f64 = 1.5;
/// Where a wheel slips though less was counted on than it seems to get, something else is wrong: so much less is.
const LESS: f64 = 0.8;
/// A floor is known where it was felt: what is counted on grows to e times as much on so many metres of grip, m, on which a wheel needs
/// all that motions are planned with, and on more by the square of the part that it needs. Each slip doubles them, up to the second; on
/// a floor that is as good as any they are the first again.
const RENEWED_M: [f64; 2] = [3.0, 48.0];

/// What an estimate with its standard deviation supports.
fn supported(friction: f64, sigma: f64) -> f64 {
    (friction - SIGMAS * sigma).max(LEAST)
}

/// The friction that is counted on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reliance {
    /// Whether the robot's file says anything of the floor: without a word nothing is held back, and slip stops the robot.
    counts: bool,
    /// By the robot's file: never more.
    told: Option<f64>,
    /// By what slipped; `None` while nothing did.
    found: Option<f64>,
    renewed_m: f64,
    /// The most that the slip of now leaves; `None` while all wheels grip.
    slip: Option<f64>,
}

impl Reliance {
    pub(super) fn new(plan: &GripPlan) -> Self {
        let found = plan.remembered.map(|floor| supported(floor.friction, floor.friction_sigma));
        let counts = plan.friction.is_some() || plan.memory.is_some();
        Reliance { counts, told: plan.friction, found, renewed_m: RENEWED_M[0], slip: None }
    }

    pub(super) fn friction(&self) -> Option<f64> {
        match (self.told, self.found) {
            _ if !self.counts => None,
            (Some(told), Some(found)) => Some(told.min(found)),
            (told, found) => told.or(found),
        }
    }

    /// Takes in what was found in a cycle in which the platform went so far, m.
    pub(super) fn look(&mut self, grip: &GripReport, way_m: f64) {
        let seen = grip.friction.zip(grip.friction_sigma).map(|(friction, sigma)| supported(friction, sigma));
        if let Some(seen) = seen.filter(|_| grip.slips()) {
            let most = *self.slip.get_or_insert_with(|| {
                if self.found.is_some() {
                    self.renewed_m = (2.0 * self.renewed_m).min(RENEWED_M[1]);
                }
                LESS * self.found.unwrap_or(ENOUGH)
            });
            self.found = Some(seen.min(most).max(LEAST));
            return;
        }
        self.slip = None;
        if let Some(found) = self.found.filter(|_| way_m.is_finite() && grip.felt.is_finite()) {
            // What asks for little shows little.
            let shown = (grip.felt / (PLANNED * found)).clamp(0.0, 1.0);
            let found = found * (1.0 + shown * shown * way_m / self.renewed_m);
            self.found = Some(found).filter(|found| *found < ENOUGH);
            if self.found.is_none() {
                self.renewed_m = RENEWED_M[0];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::RememberedFloor;

    /// A file that keeps what is found, before the first run.
    fn nothing() -> GripPlan {
        GripPlan {
            friction: None,
            height_m: 0.4,
            told_height_m: None,
            memory: Some("floor.toml".into()),
            remembered: None,
        }
    }

    fn slips(friction: f64, friction_sigma: f64) -> GripReport {
        let mut report = GripReport {
            friction: Some(friction),
            friction_sigma: Some(friction_sigma),
            ..Default::default()
        };
        report.slipped_m[1] = 1e-3;
        report
    }

    /// Wheels that grip and push so much of their load.
    fn grips(felt: f64) -> GripReport {
        GripReport { felt, ..Default::default() }
    }

    /// Metres of grip until so much is counted on, while a wheel needs so much of what motions are planned with.
    fn metres_until(reliance: &mut Reliance, part: f64, enough: impl Fn(Option<f64>) -> bool) -> f64 {
        let mut way_m = 0.0;
        while !enough(reliance.friction()) {
            let felt = reliance.found.map_or(0.0, |found| part * PLANNED * found);
            reliance.look(&grips(felt), 1e-3);
            way_m += 1e-3;
            assert!(way_m < 1000.0);
        }
        way_m
    }

    #[test]
    fn nothing_is_counted_on_before_a_slip_and_less_than_was_found_after_it() {
        let mut reliance = Reliance::new(&nothing());
        reliance.look(&GripReport::default(), 1.0);
        assert_eq!(reliance.friction(), None);
        reliance.look(&slips(0.1, 0.02), 1e-3);
        let first = reliance.friction().expect("it slipped");
        assert!((first - (0.1 - 1.645 * 0.02)).abs() < 1e-12, "{first}");
        // The longer it is looked at the better it is known.
        reliance.look(&slips(0.1, 0.005), 1e-3);
        assert!(reliance.friction().expect("it slips") > first);
        // A look that says nothing leaves the least.
        reliance.look(&slips(0.1, 0.2), 1e-3);
        assert_eq!(reliance.friction(), Some(LEAST));
    }

    #[test]
    fn a_file_without_a_word_of_the_floor_holds_nothing_back() {
        let mut reliance = Reliance::new(&GripPlan { memory: None, ..nothing() });
        reliance.look(&slips(0.1, 0.02), 1e-3);
        assert_eq!(reliance.friction(), None);
    }

    #[test]
    fn one_patch_is_forgotten_on_the_way_and_each_further_slip_makes_that_longer() {
        let mut reliance = Reliance::new(&nothing());
        reliance.look(&slips(0.1, 0.01), 1e-3);
        let first_m = metres_until(&mut reliance, 1.0, |friction| friction.is_none());
        // ln(1.5 / 0.0836) times 3 m.
        assert!((first_m - 8.66).abs() < 0.05, "{first_m}");
        reliance.look(&slips(0.1, 0.01), 1e-3);
        let past = |friction: Option<f64>| friction.is_none_or(|friction| friction > 0.1);
        let before_m = metres_until(&mut reliance, 1.0, past);
        reliance.look(&slips(0.1, 0.01), 1e-3);
        let again_m = metres_until(&mut reliance, 1.0, past);
        assert!((again_m / before_m - 2.0).abs() < 0.5, "{before_m} then {again_m}");
    }

    #[test]
    fn who_asks_little_of_a_floor_learns_little_of_it() {
        let metres = |part: f64| {
            let mut reliance = Reliance::new(&nothing());
            reliance.look(&slips(0.1, 0.01), 1e-3);
            metres_until(&mut reliance, part, |friction| friction.is_none_or(|friction| friction > 0.2))
        };
        let all_m = metres(1.0);
        assert!((metres(0.5) / all_m - 4.0).abs() < 0.01, "{all_m}");
        // What is felt beyond that tells no more.
        assert_eq!(metres(2.0), all_m);
        let mut reliance = Reliance::new(&nothing());
        reliance.look(&slips(0.1, 0.0), 1e-3);
        for felt in [0.0, -1.0, f64::NAN] {
            reliance.look(&grips(felt), 10.0);
        }
        assert_eq!(reliance.friction(), Some(0.1));
    }

    #[test]
    fn a_wheel_that_slips_below_what_was_counted_on_lowers_it_all_the_same() {
        let mut reliance = Reliance::new(&nothing());
        reliance.look(&slips(0.1, 0.0), 1e-3);
        reliance.look(&GripReport::default(), 0.0);
        // It seems to get twice as much, and slips.
        reliance.look(&slips(0.2, 0.0), 1e-3);
        assert!((reliance.friction().expect("known") - 0.08).abs() < 1e-12);
    }

    #[test]
    fn what_the_file_tells_is_never_exceeded_and_what_is_remembered_counts_from_the_start() {
        let told = GripPlan { friction: Some(0.3), ..nothing() };
        let mut reliance = Reliance::new(&told);
        reliance.look(&GripReport::default(), 100.0);
        assert_eq!(reliance.friction(), Some(0.3));
        reliance.look(&slips(0.1, 0.0), 1e-3);
        assert_eq!(reliance.friction(), Some(0.1));
        assert!(metres_until(&mut reliance, 1.0, |friction| friction == Some(0.3)) < 10.0);
        let floor = RememberedFloor { friction: 0.2, friction_sigma: 0.02 };
        let reliance = Reliance::new(&GripPlan { remembered: Some(floor), ..nothing() });
        assert!((reliance.friction().expect("remembered") - 0.1671).abs() < 1e-9);
    }

    #[test]
    fn a_way_that_is_no_number_changes_nothing() {
        let mut reliance = Reliance::new(&nothing());
        reliance.look(&slips(0.1, 0.0), f64::NAN);
        reliance.look(&GripReport::default(), f64::NAN);
        assert_eq!(reliance.friction(), Some(0.1));
    }
}
