//! What viewers draw of a robot: frames, body, wheels, fence, obstacles and path, from the rows of a recording or of a running robot.

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, TAU};

use omnibase_description::Wheel;
use omnibase_record::run::RunSchema;
use omnibase_record::viewer::{Colour, Drawing, Entity, Placed, Shape, Transform};
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{DriveScale, TurnDirection};
use omnibase_robot::guard::{MAX_OBSTACLES, Obstacle};
use omnibase_robot::signals::{Phase, RequestAnswer, RequestSort};

use crate::mechanics;

/// Between two drawings, ns: thirty in a second.
pub const DRAWN_EVERY_NS: u64 = 33_333_333;
/// Between two scenes with everything in them, ns: who looks from some time on sees all of it this much later at most.
const WHOLE_EVERY_NS: u64 = 1_000_000_000;
/// Most points of a path.
const PATH_POINTS: usize = 200;

const BODY: Colour = [0.2, 0.4, 0.8, 1.0];
const WHEEL: Colour = [0.2, 0.2, 0.2, 1.0];
const SPOKE: Colour = [1.0, 0.8, 0.2, 1.0];
const FENCE: Colour = [0.9, 0.5, 0.1, 1.0];
const OBSTACLE: Colour = [0.8, 0.1, 0.1, 0.6];
const PATH: Colour = [0.1, 0.7, 0.3, 1.0];
/// Thickness of lines, and height of obstacles, m.
const LINE_M: f64 = 0.015;
const OBSTACLE_HEIGHT_M: f64 = 0.3;

/// Draws a robot.
#[derive(Debug)]
pub struct View {
    wheels: Vec<TurningWheel>,
    footprint_m: Vec<[f64; 2]>,
    fence_m: Vec<[f64; 2]>,
    /// Each obstacle, and since when it moves from its centre, ns.
    obstacles: Vec<Option<(Obstacle, u64)>>,
    path_m: Vec<[f64; 2]>,
    columns: Columns,
    whole_ns: Option<u64>,
    /// What was drawn so far.
    drawn: BTreeSet<String>,
}

#[derive(Debug)]
struct TurningWheel {
    wheel: Wheel,
    /// Where its encoder stands in a row.
    column: Option<usize>,
    rad_per_count: f64,
    /// Its last count, and by how much it turned since the first.
    counts: Option<i32>,
    turned_counts: i64,
}

/// Where signals stand in a row.
#[derive(Debug)]
struct Columns {
    pose: Option<[usize; 3]>,
    wished: Option<[usize; 3]>,
    phase: Option<usize>,
    /// Kind, argument, answer, and values from this one on.
    request: Option<[usize; 4]>,
}

impl Columns {
    fn of(schema: &RunSchema) -> Self {
        let pose = |topic: &str| {
            let of = |name| schema.column(topic, name);
            Some([of("pose_x_m")?, of("pose_y_m")?, of("pose_heading_rad")?])
        };
        let request = || {
            let of = |name| schema.column("/request", name);
            let [first, last] = [of("value_1")?, of("value_6")?];
            let values = (last == first + 5).then_some(first)?;
            Some([of("kind")?, of("argument")?, of("answer")?, values])
        };
        Columns {
            pose: pose("/state"),
            wished: pose("/wished"),
            phase: schema.column("/cycle", "phase"),
            request: request(),
        }
    }
}

/// Signals without which less is drawn, as patterns.
pub const DRAWN_FROM: [&str; 5] =
    ["cycle.phase", "state.pose_*", "wished.pose_*", "wheel_*.position_counts", "request.*"];

impl View {
    /// Of a robot whose rows have this schema.
    pub fn new(plan: &RobotPlan, schema: &RunSchema) -> Self {
        let described = mechanics::description(plan);
        let wheels = described.wheels.into_iter().zip(&plan.drives).enumerate();
        let obstacles = plan.guard.obstacles.iter().map(|obstacle| Some((*obstacle, 0)));
        let mut obstacles: Vec<_> = obstacles.collect();
        obstacles.resize(MAX_OBSTACLES, None);
        View {
            wheels: wheels
                .map(|(number, (wheel, drive))| TurningWheel {
                    wheel,
                    column: schema.column(&format!("/wheel_{}", number + 1), "position_counts"),
                    rad_per_count: rad_per_count(&drive.scale),
                    counts: None,
                    turned_counts: 0,
                })
                .collect(),
            footprint_m: described.footprint_m,
            fence_m: plan.guard.fence.as_ref().map_or(Vec::new(), |fence| fence.corners_m.clone()),
            obstacles,
            path_m: Vec::new(),
            columns: Columns::of(schema),
            whole_ns: None,
            drawn: BTreeSet::new(),
        }
    }

    /// The obstacles that are there at a time, for whoever doesn't hear every row.
    pub fn set_obstacles(&mut self, time_ns: u64, obstacles: &[Option<Obstacle>]) {
        for (place, obstacle) in self.obstacles.iter_mut().zip(obstacles) {
            if place.is_some() && obstacle.is_none() {
                self.whole_ns = None;
            }
            *place = obstacle.map(|obstacle| (obstacle, time_ns));
        }
    }

    /// The path that is drawn from now on, points in odom, m.
    pub fn set_path(&mut self, points_m: impl ExactSizeIterator<Item = [f64; 2]>) {
        let step = points_m.len().div_ceil(PATH_POINTS).max(1);
        let last = points_m.len().saturating_sub(1);
        let kept = points_m.enumerate().filter(|(number, _)| number % step == 0 || *number == last);
        self.path_m =
            kept.map(|(_, point)| point).filter(|point| point.iter().all(|at| at.is_finite())).collect();
        self.whole_ns = None;
    }

    /// Where a row wishes the robot to be, in odom, m; `None` where nothing is followed.
    pub fn wished_m(&self, row: &[f64]) -> Option<[f64; 2]> {
        let phase = row.get(self.columns.phase?).copied()?;
        let [x, y, _] = self.columns.wished?;
        (phase as u64 == Phase::Tracking.code()).then(|| [row[x], row[y]])
    }

    /// Takes in what a row changes; to be called with every row that there is.
    pub fn hear(&mut self, time_ns: u64, row: &[f64]) {
        for wheel in &mut self.wheels {
            let Some(counts) = wheel.column.and_then(|column| row.get(column)) else { continue };
            let counts = *counts as i32;
            // A count of 32 bits goes round.
            let turned = wheel.counts.map_or(0, |before| counts.wrapping_sub(before));
            wheel.turned_counts += i64::from(turned);
            wheel.counts = Some(counts);
        }
        if let Some([kind, argument, answer, values]) = self.columns.request
            && row[answer] as u64 == RequestAnswer::Taken.code()
            && let Some(place) = self.obstacles.get_mut(row[argument] as usize)
        {
            match RequestSort::from_code(row[kind] as u64) {
                Some(RequestSort::SetObstacle) => {
                    let [x, y, radius_m, vx, vy] = [0, 1, 2, 3, 4].map(|n| row[values + n]);
                    *place = Some((Obstacle { centre_m: [x, y], radius_m, velocity_m_s: [vx, vy] }, time_ns));
                }
                Some(RequestSort::RemoveObstacle) => {
                    *place = None;
                    self.whole_ns = None;
                }
                _ => {}
            }
        }
    }

    /// The robot of a row, drawn; the scene as a whole once a second, with what is gone of it, else its obstacles.
    pub fn draw(&mut self, time_ns: u64, row: &[f64]) -> Drawing {
        let placed = |columns: Option<[usize; 3]>| {
            let [x, y, heading] = columns?.map(|column| row[column]);
            (x.is_finite() && y.is_finite() && heading.is_finite()).then(|| Placed::on_floor(x, y, heading))
        };
        let pose = placed(self.columns.pose);
        let mut transforms: Vec<Transform> = Vec::new();
        transforms.extend(pose.map(|placed| transform("odom", "base_link", placed)));
        transforms.extend(self.wheels.iter().map(TurningWheel::transform));
        let is_whole = self.whole_ns.is_none_or(|whole_ns| time_ns >= whole_ns + WHOLE_EVERY_NS);
        let mut drawing =
            Drawing { transforms, pose, wished: placed(self.columns.wished), ..Drawing::default() };
        if is_whole {
            self.whole_ns = Some(time_ns);
            drawing.entities.extend(self.still());
        }
        for (number, obstacle) in self.obstacles.iter().enumerate() {
            if let Some((obstacle, since_ns)) = obstacle {
                let id = format!("obstacle_{}", number + 1);
                drawing.entities.push(round(id, obstacle, time_ns.saturating_sub(*since_ns)));
            }
        }
        if is_whole {
            let is_there = |id: &String| drawing.entities.iter().any(|entity| entity.id == *id);
            drawing.gone = self.drawn.iter().filter(|id| !is_there(id)).cloned().collect();
        }
        self.drawn.extend(drawing.entities.iter().map(|entity| entity.id.clone()));
        drawing
    }

    /// What stands still in its frame.
    fn still(&self) -> Vec<Entity> {
        let line = |points_m: &[[f64; 2]], is_closed, colour| Shape::Line {
            points_m: points_m.iter().map(|[x, y]| [*x, *y, LINE_M]).collect(),
            is_closed,
            thickness_m: LINE_M,
            colour,
        };
        let entity = |id: &str, frame: &str, shape| Entity {
            id: id.to_owned(),
            frame: frame.to_owned(),
            shapes: vec![shape],
        };
        let mut all = vec![entity("footprint", "base_link", line(&self.footprint_m, true, BODY))];
        all.extend(self.wheels.iter().map(TurningWheel::entity));
        if !self.fence_m.is_empty() {
            all.push(entity("fence", "odom", line(&self.fence_m, true, FENCE)));
        }
        if !self.path_m.is_empty() {
            all.push(entity("path", "odom", line(&self.path_m, false, PATH)));
        }
        all
    }
}

impl TurningWheel {
    fn frame(&self) -> String {
        format!("{}_link", self.wheel.name)
    }

    /// Its frame turns with it about its axis.
    fn transform(&self) -> Transform {
        let ([x, y], [axis_x, axis_y]) = (self.wheel.position_m, self.wheel.axis());
        let angle_rad = (self.turned_counts as f64 * self.rad_per_count).rem_euclid(TAU);
        let placed = Placed::about([x, y, self.wheel.radius_m], [axis_x, axis_y, 0.0], angle_rad);
        transform("base_link", &self.frame(), placed)
    }

    fn entity(&self) -> Entity {
        let ([axis_x, axis_y], radius_m) = (self.wheel.axis(), self.wheel.radius_m);
        // From z to the axis: a quarter of a turn about what is across both.
        let lying = Placed::about([0.0; 3], [-axis_y, axis_x, 0.0], FRAC_PI_2);
        let tread = Shape::Cylinder { placed: lying, radius_m, height_m: radius_m / 2.0, colour: WHEEL };
        let out = radius_m / 4.0 + LINE_M;
        // By which one sees that it turns.
        let spoke = Shape::Line {
            points_m: vec![[axis_x * out, axis_y * out, 0.0], [axis_x * out, axis_y * out, radius_m]],
            is_closed: false,
            thickness_m: LINE_M,
            colour: SPOKE,
        };
        Entity { id: self.wheel.name.clone(), frame: self.frame(), shapes: vec![tread, spoke] }
    }
}

fn transform(parent: &str, child: &str, placed: Placed) -> Transform {
    Transform { parent: parent.to_owned(), child: child.to_owned(), placed }
}

fn round(id: String, obstacle: &Obstacle, moved_ns: u64) -> Entity {
    let ([x, y], [vx, vy]) = (obstacle.centre_m, obstacle.velocity_m_s);
    let moved_s = moved_ns as f64 * 1e-9;
    let at_m = [x + vx * moved_s, y + vy * moved_s, OBSTACLE_HEIGHT_M / 2.0];
    let placed = Placed { at_m, turned: [0.0, 0.0, 0.0, 1.0] };
    let shape = Shape::Cylinder {
        placed,
        radius_m: obstacle.radius_m,
        height_m: OBSTACLE_HEIGHT_M,
        colour: OBSTACLE,
    };
    Entity { id, frame: "odom".to_owned(), shapes: vec![shape] }
}

/// By how much a wheel turns with a count of its drive.
fn rad_per_count(scale: &DriveScale) -> f64 {
    let sign = match scale.direction {
        TurnDirection::Forward => 1.0,
        TurnDirection::Backward => -1.0,
    };
    sign * TAU / f64::from(scale.counts_per_revolution) / scale.gear_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RobotText;
    use crate::channels::{CycleExtras, Known, Rows};
    use omnibase_robot::Registry;
    use omnibase_robot::signals::CycleRecord;

    #[test]
    fn what_is_taken_away_is_gone_from_the_drawing_the_last_obstacle_too() {
        let text = include_str!("../../../robots/bmm.toml").into();
        let robot = RobotText { text, ..RobotText::default() }.load(&Registry::with_built_in()).unwrap();
        let layout = robot.plan.record_layout();
        let mut rows = Rows::new(&layout, Known::Truth);
        let mut view = View::new(&robot.plan, rows.schema());
        let mut record = CycleRecord::default();
        record.measurements.wheels = robot.plan.drives.len();
        let row = rows.of(&record, &CycleExtras::default());
        let ids = |drawing: &Drawing| -> Vec<String> {
            let ids = drawing.entities.iter().map(|entity| entity.id.clone());
            ids.filter(|id| id.starts_with("obstacle") || id == "path").collect()
        };
        let obstacle = Obstacle { centre_m: [1.0, 2.0], radius_m: 0.3, velocity_m_s: [0.5, 0.0] };
        view.set_path([[0.0, 0.0], [1.0, 0.0]].into_iter());
        assert_eq!(ids(&view.draw(0, row)), ["path"]);
        // It comes and goes between two whole scenes, and moves meanwhile.
        view.set_obstacles(100_000_000, &[None, Some(obstacle)]);
        assert_eq!(ids(&view.draw(100_000_000, row)), ["obstacle_2"]);
        let moved = view.draw(600_000_000, row);
        let Shape::Cylinder { placed, .. } = &moved.entities[0].shapes[0] else { panic!("{moved:?}") };
        assert!((placed.at_m[0] - 1.25).abs() < 1e-12 && placed.at_m[1] == 2.0, "{placed:?}");
        view.set_obstacles(600_000_000, &[None, None]);
        view.set_path(std::iter::empty());
        let gone = view.draw(600_000_000, row);
        assert_eq!((ids(&gone), gone.gone), (vec![], vec!["obstacle_2".to_owned(), "path".to_owned()]));
        // Said again with the next whole scene, for whoever came between.
        assert_eq!(view.draw(700_000_000, row).gone, Vec::<String>::new());
        assert_eq!(view.draw(1_600_000_000, row).gone.len(), 2);
    }
}
