//! A motion planned dry: how long it takes, which limit binds where, the friction that it needs, and the room that it leaves.

use omnibase_trajectory::fastest::Limit;
use omnibase_trajectory::limits::Quantity;
use omnibase_trajectory::{PlatformBounds, trajectory};

use crate::ability::Ability;
use crate::config::{RobotPlan, motion_limits};
use crate::guard::fence::Fence;
use crate::guard::outline::Outline;
use crate::signals::Setpoint;
use crate::stages::Reference;

/// Between two looks, s; a longer motion is looked at more seldom.
const LOOK_S: f64 = 0.002;
const MOST_LOOKS: f64 = 20_000.0;
/// A limit binds where the motion takes this part of it.
const BINDS: f64 = 0.95;

/// A limit in words.
pub fn limit_name(limit: Limit) -> &'static str {
    match limit {
        Limit::Platform(quantity) => quantity.name_and_unit().0,
        Limit::WheelSpeed => "wheel speed",
        Limit::WheelTorque => "wheel torque",
        Limit::Grip => "grip",
        Limit::Heat => "motor heat",
    }
}

/// A limit's colour in pictures, and that of where none binds.
pub fn limit_colour(limit: Option<Limit>) -> &'static str {
    match limit {
        None => "#9aa4ae",
        Some(Limit::Platform(Quantity::Speed)) => "#0b5fa5",
        Some(Limit::Platform(Quantity::Acceleration)) => "#c4501b",
        Some(Limit::Platform(Quantity::Jerk)) => "#8a6d00",
        Some(Limit::Platform(Quantity::Rate)) => "#3f8fd2",
        Some(Limit::Platform(Quantity::AngularAcceleration)) => "#e08a5a",
        Some(Limit::Platform(Quantity::AngularJerk)) => "#c9aa2c",
        Some(Limit::WheelSpeed) => "#2d8a4e",
        Some(Limit::WheelTorque) => "#7b4ab0",
        Some(Limit::Grip) => "#c2185b",
        Some(Limit::Heat) => "#5d4037",
    }
}

/// A moment of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Since its beginning, s.
    pub time_s: f64,
    /// Where it is, and how it moves.
    pub setpoint: Setpoint,
    /// The limit of which it takes most, and how much, over it; `None` where it stands.
    pub most: Option<(Limit, f64)>,
    /// The friction on which its wheels grip.
    pub friction: f64,
}

impl Moment {
    /// The limit that binds, if one does.
    pub fn binding(&self) -> Option<Limit> {
        self.most.filter(|(_, load)| *load >= BINDS).map(|(limit, _)| limit)
    }
}

/// An end of a way that is passed with a speed, between rest and the way or the way and rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passed {
    /// When, s.
    pub time_s: f64,
    /// The speed there, m/s.
    pub speed_m_s: f64,
    /// How long the run is that leads onto the way or on from it, m.
    pub run_m: f64,
}

/// What a limit is asked of by a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Which limit.
    pub limit: Limit,
    /// The most of it, over itself, and when, s.
    pub most: (f64, f64),
    /// The part of the time in which it binds.
    pub share: f64,
}

/// A motion without an end, or of a stage that can't tell what lies ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the motion has no end, or doesn't say what lies ahead: nothing can be planned dry")]
pub struct NotForeseen;

/// What a motion comes to before anything moves.
#[derive(Clone, Debug, PartialEq)]
pub struct DryRun {
    /// How long it takes, s.
    pub duration_s: f64,
    /// Its way over the floor, m.
    pub way_m: f64,
    /// Its start and its end, where it passes them with a speed.
    pub passed: [Option<Passed>; 2],
    /// Moment by moment.
    pub moments: Vec<Moment>,
    /// Limit by limit.
    pub asked: Vec<Asked>,
    /// The friction on which all wheels grip, and when most of it is needed, s.
    pub friction: (f64, f64),
    /// The least room to the fence, m, and when, s.
    pub fence_room_m: Option<(f64, f64)>,
    /// Likewise to an obstacle, which moves on from the motion's begin.
    pub obstacle_room_m: Option<(f64, f64)>,
    /// What of their heat the motors take that begin cold, over what they bear; `None` where it wasn't planned by that.
    pub heat: Option<f64>,
}

impl DryRun {
    /// A reference of a plan from its start pose, or from the origin of odom.
    pub fn of(plan: &RobotPlan, reference: &mut dyn Reference) -> Result<DryRun, NotForeseen> {
        let ability = Ability::of(plan);
        let bounds = PlatformBounds { limits: motion_limits(&plan.limits), ..ability.bounds.clone() };
        let duration_s = reference.duration_s().ok_or(NotForeseen)?;
        reference.start(&Setpoint::at_rest(reference.start_pose().unwrap_or_default()));
        let count = (duration_s / LOOK_S).ceil().clamp(1.0, MOST_LOOKS);
        let step_s = duration_s / count;
        let mut run = DryRun {
            duration_s,
            way_m: 0.0,
            passed: [None; 2],
            moments: Vec::with_capacity(count as usize + 1),
            asked: Vec::new(),
            friction: (0.0, 0.0),
            fence_room_m: None,
            obstacle_room_m: None,
            heat: reference.planned_for().map(|plan| plan.heat),
        };
        let outline = Outline::new(&plan.guard.footprint_m);
        let fence = plan.guard.fence.as_ref().map(|fence| Fence::new(&fence.corners_m));
        for at in 0..=count as usize {
            let time_s = step_s * at as f64;
            let setpoint = reference.preview(time_s).ok_or(NotForeseen)?;
            let next = reference.preview((time_s + step_s).min(duration_s)).ok_or(NotForeseen)?;
            let friction = ability.friction_needed(&setpoint);
            let moment = run.moment(&bounds, time_s, step_s, [&setpoint, &next]);
            run.moments.push(Moment { friction, ..moment });
            if friction > run.friction.0 {
                run.friction = (friction, time_s);
            }
            run.way_m += step_s * setpoint.twist_in_odom.speed_m_s();
            let body = outline.placed(&setpoint.odom_from_body);
            if let Some(fence) = &fence {
                least(&mut run.fence_room_m, fence.room_m(&body), time_s);
            }
            for obstacle in &plan.guard.obstacles {
                let room_m = body.distance_to_m(obstacle.centre_after_m(time_s)) - obstacle.radius_m;
                least(&mut run.obstacle_room_m, room_m, time_s);
            }
        }
        run.passed = run.passed_ends(reference);
        for asked in &mut run.asked {
            asked.share /= run.moments.len() as f64;
        }
        run.asked.sort_by(|one, other| {
            other.share.total_cmp(&one.share).then(other.most.0.total_cmp(&one.most.0))
        });
        Ok(run)
    }

    fn passed_ends(&self, reference: &dyn Reference) -> [Option<Passed>; 2] {
        // To the nearest look.
        let at = |time_s: f64| self.moments.partition_point(|moment| moment.time_s < time_s);
        let length_m = |moments: &[Moment]| -> f64 {
            let pairs = moments.windows(2).map(|pair| (pair[0].setpoint, pair[1].setpoint));
            pairs.map(|(from, to)| from.odom_from_body.distance_m(to.odom_from_body)).sum()
        };
        let [start_s, end_s] = reference.passes_s();
        let passed = |time_s: Option<f64>, run: &dyn Fn(usize) -> f64| {
            let time_s = time_s?;
            let speed_m_s = reference.preview(time_s)?.twist_in_odom.speed_m_s();
            Some(Passed { time_s, speed_m_s, run_m: run(at(time_s)) })
        };
        [
            passed(start_s, &|at| length_m(&self.moments[..=at.min(self.moments.len() - 1)])),
            passed(end_s, &|at| length_m(&self.moments[at.min(self.moments.len())..])),
        ]
    }

    /// What a moment takes of every limit.
    fn moment(
        &mut self,
        bounds: &PlatformBounds,
        time_s: f64,
        step_s: f64,
        [setpoint, next]: [&Setpoint; 2],
    ) -> Moment {
        let (a, b) = (setpoint.acceleration_in_odom, next.acceleration_in_odom);
        let jerk = |from: f64, to: f64| (to - from) / step_s;
        let whole = trajectory::Setpoint {
            odom_from_base: setpoint.odom_from_body,
            twist_in_odom: setpoint.twist_in_odom,
            acceleration_in_odom: a,
            jerk_in_odom: omnibase_platform::Twist2::new(
                jerk(a.vx_m_s, b.vx_m_s),
                jerk(a.vy_m_s, b.vy_m_s),
                jerk(a.w_rad_s, b.w_rad_s),
            ),
        };
        let mut most: Option<(Limit, f64)> = None;
        bounds.loads(&whole, |limit, taken, may| {
            let load = taken / may;
            let found = self.asked.iter_mut().find(|asked| asked.limit == limit);
            match found {
                Some(asked) if load > asked.most.0 => asked.most = (load, time_s),
                Some(_) => {}
                None => self.asked.push(Asked { limit, most: (load, time_s), share: 0.0 }),
            }
            if load > most.map_or(0.0, |(_, most)| most) {
                most = Some((limit, load));
            }
        });
        let moment = Moment { time_s, setpoint: *setpoint, most, friction: 0.0 };
        if let Some(binding) = moment.binding()
            && let Some(asked) = self.asked.iter_mut().find(|asked| asked.limit == binding)
        {
            asked.share += 1.0;
        }
        moment
    }
}

/// Keeps the least room, and when it was, s.
fn least(slot: &mut Option<(f64, f64)>, room_m: f64, time_s: f64) {
    if slot.is_none_or(|(least_m, _)| room_m < least_m) {
        *slot = Some((room_m, time_s));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Registry;

    const BMM: &str = include_str!("../../../robots/bmm.toml");

    fn dry(more: &str) -> DryRun {
        let no_files = |_: &str| Err(String::new());
        let registry = Registry::with_built_in();
        let plan = RobotPlan::from_toml(&format!("{BMM}{more}"), &registry, &no_files)
            .unwrap_or_else(|problems| panic!("{problems:?}"));
        let mut reference = registry.make_reference(&plan.reference, &Ability::of(&plan)).unwrap();
        DryRun::of(&plan, &mut *reference).unwrap()
    }

    #[test]
    fn a_straight_way_says_what_binds_it_and_what_it_needs() {
        let line =
            "\n[reference]\nkind = \"path\"\ntiming = \"fastest\"\npoints = [[0, 0, 0, 0], [1, 3, 0, 0]]\n";
        let run = dry(&format!("{line}[fence]\npolygon_m = [[-2, -2], [5, -2], [5, 2], [-2, 2]]\n"));
        // v/a and the way, each a little slower than the limits, and what the jerk costs.
        assert!((3.0 + 1.0 / 1.5..3.9).contains(&run.duration_s), "{}", run.duration_s);
        assert!((run.way_m - 3.0).abs() < 0.01, "{}", run.way_m);
        let share = |quantity| {
            let of = |asked: &&Asked| asked.limit == Limit::Platform(quantity);
            run.asked.iter().find(of).map_or(0.0, |asked| asked.share)
        };
        assert!(share(Quantity::Speed) > 0.5 && share(Quantity::Acceleration) > 0.3, "{:?}", run.asked);
        // 1.5 m/s² from three wheels of which two push, with a centre of mass at 0.4 m: between a/g and three times as much.
        assert!((0.15..0.45).contains(&run.friction.0), "{:?}", run.friction);
        let (room_m, at_s) = run.fence_room_m.unwrap();
        assert!((1.0..1.7).contains(&room_m) && at_s <= run.duration_s, "{room_m} at {at_s}");
        assert_eq!(run.obstacle_room_m, None);
    }

    #[test]
    fn an_obstacle_that_moves_is_where_it_is_by_then() {
        let room_m = |velocity: &str| {
            let line = "\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [10, 3, 0, 0]]\n";
            let obstacle = format!("[[obstacle]]\ncentre_m = [1.5, 2.0]\nradius_m = 0.2\n{velocity}");
            dry(&format!("{line}{obstacle}")).obstacle_room_m.unwrap()
        };
        let (stands_m, _) = room_m("");
        assert!((1.2..1.6).contains(&stands_m), "{stands_m}");
        // Half of the way is reached after 5 s, when it has come there, too.
        let (comes_m, at_s) = room_m("velocity_m_s = [0.0, -0.4]");
        assert!(comes_m < 0.0 && (4.0..6.0).contains(&at_s), "{comes_m} at {at_s}");
    }

    #[test]
    fn ends_that_are_passed_are_told_with_their_runs() {
        let line = "\n[reference]\nkind = \"path\"\ntiming = \"fastest\"\nend_speed_m_s = 0.6\n\
                    points = [[0, 0, 0, 0], [1, 3, 0, 0]]\n";
        let run = dry(line);
        let [None, Some(end)] = run.passed else { panic!("{:?}", run.passed) };
        assert!((end.speed_m_s - 0.6).abs() < 3e-3, "{end:?}");
        // v²/2a at 1.5 m/s², a tenth and what the jerk takes.
        let least_m = 0.6 * 0.6 / 3.0;
        assert!((least_m..1.1 * least_m + 0.04).contains(&end.run_m), "{end:?}");
        assert!((run.way_m - 3.0 - end.run_m).abs() < 0.01 && end.time_s < run.duration_s, "{end:?}");
    }

    #[test]
    fn the_friction_that_is_needed_is_what_was_planned_with() {
        let high = BMM
            .replace("\nacceleration_m_s2 = 1.5", "\nacceleration_m_s2 = 6.0")
            .replace("\njerk_m_s3 = 40.0", "\njerk_m_s3 = 400.0");
        let no_files = |_: &str| Err(String::new());
        let registry = Registry::with_built_in();
        let text = format!(
            "{high}\n[grip]\nfriction = 0.5\n[reference]\nkind = \"circle\"\nradius_m = 0.5\ntiming = \"fastest\"\n"
        );
        let plan = RobotPlan::from_toml(&text, &registry, &no_files).unwrap();
        let mut reference = registry.make_reference(&plan.reference, &Ability::of(&plan)).unwrap();
        let run = DryRun::of(&plan, &mut *reference).unwrap();
        assert!((0.36..0.405).contains(&run.friction.0), "{:?}", run.friction);
        assert!(run.heat.is_some_and(|heat| (0.05..1.0).contains(&heat)), "{:?}", run.heat);
        assert!(
            run.asked.iter().any(|asked| asked.limit == Limit::Grip && asked.share > 0.3),
            "{:?}",
            run.asked
        );
        // Told of no floor it keeps to the platform's limits alone.
        let untold = RobotPlan::from_toml(&text.replace("friction = 0.5", ""), &registry, &no_files).unwrap();
        let mut reference = registry.make_reference(&untold.reference, &Ability::of(&untold)).unwrap();
        assert_eq!(reference.planned_for(), None);
        let run = DryRun::of(&untold, &mut *reference).unwrap();
        assert!(run.friction.0 > 0.5, "{:?}", run.friction);
    }
}
