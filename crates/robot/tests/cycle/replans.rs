//! Motions that begin while another one is under way: it goes over into them without a stop, within every limit.

use omnibase_host::CountingAllocator;
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::config::{PathFrame, ReferenceTable, Timing};
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{
    Batch, Course, CycleRecord, Frame, LimitedBy, RequestAnswer, SafetyReason, StopCategory,
};
use omnibase_robot::stages::Reference;
use omnibase_robot::{Ability, Phase, Registry, RequestKind};

use super::support::{BMM, Bench, Random, plan};

/// A robot whose every setpoint is looked at.
struct Watched {
    bench: Bench,
    before: CycleRecord,
    /// Least speed since it was reset, m/s, and the greatest shares of speed, acceleration and jerk.
    slowest_m_s: f64,
    shares: [f64; 6],
}

impl Watched {
    fn new(more: &str) -> Self {
        let mut bench = Bench::new(plan(&format!("{BMM}\n{more}\n")));
        bench.enable();
        let before = *bench.robot.record();
        Watched { bench, before, slowest_m_s: f64::INFINITY, shares: [0.0; 6] }
    }

    fn step(&mut self, kind: Option<RequestKind>) -> CycleRecord {
        let allocations = CountingAllocator::allocations_of_this_thread();
        let record = self.bench.step(kind);
        assert_eq!(CountingAllocator::allocations_of_this_thread(), allocations, "{kind:?}");
        let limits = &self.bench.plan.limits;
        let (was, is) = (&self.before.setpoint, &record.setpoint);
        let change = |from: Twist2, to: Twist2| {
            Twist2::new(to.vx_m_s - from.vx_m_s, to.vy_m_s - from.vy_m_s, to.w_rad_s - from.w_rad_s)
                .scaled(1e3)
        };
        let acceleration = change(was.twist_in_odom, is.twist_in_odom);
        let jerk = change(was.acceleration_in_odom, is.acceleration_in_odom);
        let shares = [
            is.twist_in_odom.speed_m_s() / limits.speed_m_s,
            acceleration.speed_m_s() / limits.acceleration_m_s2,
            jerk.speed_m_s() / limits.jerk_m_s3,
            is.twist_in_odom.w_rad_s.abs() / limits.turn_speed_rad_s,
            acceleration.w_rad_s.abs() / limits.turn_acceleration_rad_s2,
            jerk.w_rad_s.abs() / limits.turn_jerk_rad_s3,
        ];
        for (greatest, share) in self.shares.iter_mut().zip(shares) {
            assert!(share <= 1.0 + 1e-6, "cycle {}, {kind:?}: {shares:?}", self.bench.index);
            *greatest = greatest.max(share);
        }
        self.slowest_m_s = self.slowest_m_s.min(is.twist_in_odom.speed_m_s());
        self.before = record;
        record
    }

    fn ask(&mut self, kind: RequestKind) -> RequestAnswer {
        self.step(Some(kind)).answer
    }

    fn run(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.step(None);
        }
    }

    fn until_it_holds(&mut self) -> Pose2 {
        for _ in 0..30_000 {
            if self.bench.robot.phase() == Phase::Holding {
                return self.before.setpoint.odom_from_body;
            }
            self.step(None);
        }
        panic!("it still moves: {:?}", self.before.setpoint);
    }

    fn drive(&mut self, twist: Twist2, cycles: u32) {
        for _ in 0..cycles {
            let kind = RequestKind::Velocity { twist, frame: Frame::Odom };
            assert_eq!(self.ask(kind), RequestAnswer::Taken);
        }
    }

    /// Loads a reference; the answer.
    fn load(&mut self, number: u32, table: &ReferenceTable) -> RequestAnswer {
        let reference: Box<dyn Reference> =
            Registry::with_built_in().make_reference(table, &Ability::of(&self.bench.plan)).unwrap();
        drop(self.bench.robot.offer_reference(number, reference));
        self.ask(RequestKind::UseReference { number })
    }
}

fn go(x_m: f64, y_m: f64, heading_rad: f64) -> RequestKind {
    RequestKind::GoTo { odom_from_body: Pose2 { x_m, y_m, heading_rad } }
}

fn path(points: Vec<[f64; 4]>, frame: PathFrame) -> ReferenceTable {
    ReferenceTable {
        kind: Some("path".into()),
        points: Some(points),
        timing: Some(Timing::Fastest),
        frame: Some(frame),
        ..Default::default()
    }
}

const CIRCLE: &str = "[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 7.2\n";

#[test]
fn a_way_begins_from_whatever_is_under_way_without_a_stop() {
    // From a stick, a way and a path; the goal lies ahead.
    for under_way in 0..3 {
        let mut robot = Watched::new(CIRCLE);
        match under_way {
            0 => robot.drive(Twist2::new(0.6, 0.3, 0.4), 900),
            1 => {
                assert_eq!(robot.ask(go(1.5, 0.75, 0.5)), RequestAnswer::Taken);
                robot.run(900);
            }
            _ => {
                assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
                robot.run(1_500);
            }
        }
        let before = robot.before.setpoint;
        let v = before.twist_in_odom;
        assert!(v.speed_m_s() > 0.3, "{under_way}: {v:?}");
        let pose = before.odom_from_body;
        let goal = [pose.x_m + 2.0 * v.vx_m_s - 0.3, pose.y_m + 2.0 * v.vy_m_s + 0.2];
        robot.slowest_m_s = f64::INFINITY;
        assert_eq!(robot.ask(go(goal[0], goal[1], 0.0)), RequestAnswer::Taken, "{under_way}");
        assert_eq!(robot.before.course, Course::Way);
        let mut lag_m = 0.0_f64;
        for _ in 0..500 {
            let record = robot.step(None);
            lag_m = lag_m.max(record.wished.odom_from_body.distance_m(record.setpoint.odom_from_body));
        }
        // It goes over: nearly as fast all the time, and just as it was planned.
        assert!(robot.slowest_m_s > 0.25, "{under_way}: {} m/s", robot.slowest_m_s);
        assert!(lag_m < 1e-3, "{under_way}: {lag_m}");
        let end = robot.until_it_holds();
        assert!(end.distance_m(Pose2::new(goal[0], goal[1], 0.0)) < 1e-6, "{under_way}: {end:?}");
    }
}

#[test]
fn a_path_that_is_loaded_and_started_while_moving_is_joined_without_a_stop() {
    for frame in [PathFrame::Start, PathFrame::Odom] {
        let mut robot = Watched::new(CIRCLE);
        robot.drive(Twist2::new(0.5, 0.0, 0.0), 1_000);
        assert_eq!(robot.ask(go(1.6, 0.0, 0.0)), RequestAnswer::Taken);
        robot.run(400);
        let here = robot.before.setpoint.odom_from_body;
        let points = vec![
            [0.0, here.x_m, here.y_m, 0.0],
            [2.0, here.x_m + 1.0, 0.6, 0.8],
            [4.0, here.x_m + 2.0, 0.0, 0.0],
        ];
        assert_eq!(robot.load(7, &path(points, frame)), RequestAnswer::Taken);
        robot.slowest_m_s = f64::INFINITY;
        assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken, "{frame:?}");
        assert_eq!(robot.before.course, Course::Onto);
        let mut joined = false;
        for _ in 0..1_550 {
            joined |= robot.step(None).course == Course::Reference;
        }
        assert!(joined && robot.slowest_m_s > 0.2, "{frame:?}: {joined}, {} m/s", robot.slowest_m_s);
        let end = robot.until_it_holds();
        assert!(
            end.distance_m(Pose2::new(here.x_m + 2.0, 0.0, 0.0)) < 0.005,
            "{frame:?}: {end:?} from {here:?}"
        );
    }
}

#[test]
fn a_path_goes_over_into_another_one_that_was_loaded_while_it_was_followed() {
    let ahead = path(vec![[0.0, 0.0, 0.0, 0.0], [2.0, 1.5, 0.0, 0.0]], PathFrame::Start);
    let mut robot = Watched::new(CIRCLE);
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
    robot.run(1_500);
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::WrongPhase, "it is followed already");
    let time_s = robot.before.reference_time_s;
    assert_eq!(robot.load(3, &ahead), RequestAnswer::Taken);
    robot.run(100);
    let numbers = |robot: &Watched| [robot.before.reference, robot.before.reference_next];
    assert_eq!(numbers(&robot), [0, 3], "the circle is followed");
    assert!((robot.before.reference_time_s - time_s - 0.101).abs() < 1e-9, "and goes on");
    // One that is loaded meanwhile takes the place of the next.
    assert_eq!(robot.load(4, &ahead), RequestAnswer::Taken);
    assert_eq!(numbers(&robot), [0, 4]);
    robot.slowest_m_s = f64::INFINITY;
    let here = robot.before.setpoint.odom_from_body;
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
    assert_eq!(numbers(&robot), [4, 4]);
    let lag_m = |at: &CycleRecord| at.wished.odom_from_body.distance_m(at.setpoint.odom_from_body);
    let mut greatest_m = 0.0_f64;
    while robot.before.course == Course::Onto {
        let record = robot.step(None);
        greatest_m = greatest_m.max(lag_m(&record));
        assert!(record.reference_time_s >= 0.0);
    }
    assert!(greatest_m < 1e-4, "as planned: {greatest_m}");
    assert!(robot.slowest_m_s > 0.05, "without a stop: {}", robot.slowest_m_s);
    let end = robot.until_it_holds();
    assert!((end.distance_m(here) - 1.5).abs() < 2e-3, "{here:?} {end:?}");
    assert_eq!((numbers(&robot), robot.before.reference_begun), ([4, 4], 0));
}

#[test]
fn a_path_that_waits_is_begun_when_it_can_be_and_takes_the_place_of_one_that_ended() {
    let ahead = path(vec![[0.0, 0.0, 0.0, 0.0], [2.0, 1.5, 0.0, 0.0]], PathFrame::Start);
    let far = path(vec![[0.0, 9.0, 0.0, 0.0], [2.0, 9.5, 0.0, 0.0]], PathFrame::Odom);
    let mut robot = Watched::new(CIRCLE);
    robot.ask(RequestKind::Track);
    robot.run(1_500);
    // What can't begin changes nothing: the circle goes on, and its time.
    assert_eq!(robot.load(5, &far), RequestAnswer::Taken);
    let time_s = robot.before.reference_time_s;
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::TooFar);
    robot.run(99);
    let numbers = |robot: &Watched| [robot.before.reference, robot.before.reference_next];
    assert_eq!(numbers(&robot), [0, 5]);
    assert!((robot.before.reference_time_s - time_s - 0.1).abs() < 1e-9);
    assert_eq!(robot.load(6, &ahead), RequestAnswer::Taken);
    // Paused it is the circle that is gone on with.
    assert_eq!(robot.ask(RequestKind::Pause), RequestAnswer::Taken);
    robot.until_it_holds();
    assert_eq!(numbers(&robot), [0, 6]);
    assert_eq!(robot.ask(RequestKind::Resume), RequestAnswer::Taken);
    let end = robot.until_it_holds();
    assert!(end.distance_m(Pose2::default()) < 1e-5, "the circle is closed: {end:?}");
    // At its end nothing is left of it.
    assert_eq!(numbers(&robot), [6, 6]);
    assert_eq!(robot.ask(RequestKind::Resume), RequestAnswer::Refused);
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
    let end = robot.until_it_holds();
    assert!((end.x_m - 1.5).abs() < 1e-5, "{end:?}");
    // Who left his path for a way to a pose loads another one at once, and nothing is left of the first.
    robot.ask(go(0.0, 0.0, 0.0));
    robot.run(300);
    assert_eq!(robot.load(7, &ahead), RequestAnswer::Taken);
    assert_eq!((robot.before.course, numbers(&robot)), (Course::Way, [7, 7]));
    robot.ask(RequestKind::Stop(StopCategory::RampAndHold));
    robot.until_it_holds();
    assert_eq!(robot.ask(RequestKind::Resume), RequestAnswer::Refused);
}

#[test]
fn who_was_kept_from_his_path_gets_back_onto_it_by_a_plan() {
    // Past an obstacle beside a straight path, and from before one that is taken away, by whatever law of avoidance.
    for is_taken_away in [false, true] {
        let mut robot = Watched::new("[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [7, 4, 0, 0]]\n");
        let lag_m = |at: &CycleRecord| at.wished.odom_from_body.distance_m(at.setpoint.odom_from_body);
        assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
        robot.run(1_500);
        let centre_m = [robot.before.setpoint.odom_from_body.x_m + 1.0, 0.05];
        let obstacle = Obstacle { centre_m, radius_m: 0.2, velocity_m_s: [0.0; 2] };
        robot.ask(RequestKind::SetObstacle { index: 0, obstacle });
        let (mut greatest_m, mut off_plan_m, mut hindered, mut led) = (0.0_f64, 0.0_f64, false, 0_u32);
        let mut cycles = 0_u32;
        while robot.bench.robot.phase() == Phase::Tracking {
            let kind = (is_taken_away && cycles == 1_600).then_some(RequestKind::RemoveObstacle { index: 0 });
            let record = robot.step(kind);
            cycles += 1;
            greatest_m = greatest_m.max(lag_m(&record));
            let is_hindered = record.guard.limited_by != LimitedBy::Nothing;
            hindered |= is_hindered;
            if record.course == Course::Onto && !is_hindered {
                led += 1;
                off_plan_m = off_plan_m.max(lag_m(&record));
            }
            assert!(cycles < 30_000, "it arrives");
        }
        let end = robot.before.setpoint.odom_from_body;
        assert_eq!(robot.before.stop_reason, SafetyReason::None);
        assert!(end.distance_m(Pose2::new(4.0, 0.0, 0.0)) < 1e-5, "{end:?}");
        assert!(hindered && greatest_m > 0.1 && led > 200, "{hindered} {greatest_m} {led}");
        println!(
            "taken away {is_taken_away}: {greatest_m:.3} m off, {led} cycles by plan, {off_plan_m:.6} m off that"
        );
    }
}

#[test]
fn what_cannot_be_joined_or_leads_out_is_refused_and_what_is_under_way_goes_on() {
    let fence = "[fence]\nrectangle_m = [-1.0, -1.0, 1.6, 1.0]\n";
    let mut robot = Watched::new(&format!("{fence}{CIRCLE}"));
    // Towards the fence as fast as it may: to a goal aside the way out is too near.
    assert_eq!(robot.ask(go(1.1, 0.0, 0.0)), RequestAnswer::Taken);
    while robot.before.setpoint.odom_from_body.x_m < 0.75 {
        robot.step(None);
    }
    assert_eq!(robot.ask(go(0.0, 0.0, 0.0)), RequestAnswer::Taken, "there is room to turn back");
    robot.until_it_holds();
    assert_eq!(robot.ask(go(1.1, 0.0, 0.0)), RequestAnswer::Taken);
    while robot.before.setpoint.odom_from_body.x_m < 0.75 {
        robot.step(None);
    }
    // A path that ends before the platform could be on it.
    let short = path(vec![[0.0, 0.0, 0.0, 0.0], [2.0, -0.01, 0.0, 0.0]], PathFrame::Start);
    assert_eq!(robot.load(5, &short), RequestAnswer::Taken);
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Moving);
    // A goal that is no number, and one out of the fence.
    assert_eq!(robot.ask(go(f64::NAN, 0.0, 0.0)), RequestAnswer::Refused);
    assert_eq!(robot.ask(go(1.5, 0.0, 0.0)), RequestAnswer::OutsideFence);
    let end = robot.until_it_holds();
    assert!(end.distance_m(Pose2::new(1.1, 0.0, 0.0)) < 1e-6, "{end:?}");
}

#[test]
fn a_reference_is_resumed_from_a_stick_and_while_it_is_being_paused() {
    let mut robot = Watched::new(CIRCLE);
    robot.ask(RequestKind::Track);
    robot.run(1_500);
    robot.ask(RequestKind::Pause);
    robot.run(50);
    assert_eq!(robot.ask(RequestKind::Resume), RequestAnswer::Taken);
    robot.run(300);
    assert_eq!((robot.before.course, robot.before.reference_rate), (Course::Reference, 1.0));
    robot.drive(Twist2::new(0.0, 0.4, 0.0), 600);
    assert_eq!(robot.ask(RequestKind::Resume), RequestAnswer::Taken);
    assert_eq!(robot.before.course, Course::Way);
    let end = robot.until_it_holds();
    assert!(end.distance_m(Pose2::default()) < 1e-5, "the circle is closed: {end:?}");
}

#[test]
fn a_stop_amid_every_takeover_stops_and_nothing_moves_afterwards() {
    for cycles in [1, 2, 3, 10, 40, 150] {
        let mut robot = Watched::new(CIRCLE);
        robot.drive(Twist2::new(0.6, -0.3, 0.4), 800);
        assert_eq!(robot.ask(go(0.0, 1.0, 2.0)), RequestAnswer::Taken);
        robot.run(cycles);
        robot.ask(RequestKind::Stop(StopCategory::RampAndHold));
        for _ in 0..1_000 {
            if robot.bench.robot.phase() == Phase::Holding {
                break;
            }
            assert_eq!(robot.ask(go(0.0, 1.0, 2.0)), RequestAnswer::WrongPhase, "it stops first");
        }
        let end = robot.until_it_holds();
        robot.run(500);
        assert_eq!(robot.before.setpoint.odom_from_body, end, "{cycles}");
    }
}

#[test]
fn replans_of_all_sorts_keep_every_limit() {
    let mut random = Random(0x5EED);
    let mut robot = Watched::new(CIRCLE);
    let (mut taken, mut moving) = (0, 0);
    for _ in 0..250 {
        robot.run(1 + (random.within(200.0).abs()) as u32);
        let moves = robot.before.setpoint.twist_in_odom.speed_m_s() > 0.02;
        let kind = match random.next() % 6 {
            0 => RequestKind::Set { index: 0, value: 0.55 + random.within(0.45), batch: Batch::ALONE },
            1 => {
                let twist = Twist2::new(random.within(0.6), random.within(0.6), random.within(1.0));
                RequestKind::Velocity { twist, frame: Frame::Odom }
            }
            2 => RequestKind::Track,
            3 => RequestKind::Resume,
            _ => go(random.within(2.0), random.within(2.0), random.within(2.0)),
        };
        let is_taken = robot.ask(kind) == RequestAnswer::Taken;
        taken += u32::from(is_taken);
        moving += u32::from(is_taken && moves);
    }
    let last = &robot.before;
    assert!(
        taken > 150 && moving > 100,
        "{taken} {moving} {:?} {:?} {:?}",
        robot.shares,
        last.phase,
        last.stop_reason
    );
    assert!(robot.shares.iter().all(|share| *share > 0.3), "{:?}", robot.shares);
}

#[test]
fn a_pause_on_a_way_stops_and_a_path_that_it_led_to_can_be_resumed() {
    let mut robot = Watched::new(CIRCLE);
    // A way to a pose: nothing is left to be gone on with.
    assert_eq!(robot.ask(go(1.5, 0.0, 0.0)), RequestAnswer::Taken);
    robot.run(800);
    assert_eq!(robot.ask(RequestKind::Pause), RequestAnswer::Taken);
    let here = robot.until_it_holds();
    assert!(here.x_m < 1.0, "{here:?}");
    assert_eq!(robot.ask(RequestKind::Resume), RequestAnswer::Refused);
    // A way onto the circle.
    robot.drive(Twist2::new(0.5, 0.0, 0.0), 800);
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
    robot.run(100);
    assert_eq!(robot.before.course, Course::Onto);
    assert_eq!(robot.ask(RequestKind::Pause), RequestAnswer::Taken);
    let here = robot.until_it_holds();
    robot.run(300);
    assert_eq!(robot.before.setpoint.odom_from_body, here);
    assert_eq!(robot.ask(RequestKind::Resume), RequestAnswer::Taken);
    robot.until_it_holds();
    assert_eq!(robot.before.reference_begun, 0, "it came to its end");
}

#[test]
fn a_way_that_leads_out_of_the_fence_is_refused_while_it_moves_and_what_is_under_way_goes_on() {
    // A corner points into the room.
    let corners = "[[-1.0, -1.0], [3.0, -1.0], [3.0, 1.0], [1.2, 1.0], [1.2, 3.0], [-1.0, 3.0]]";
    let mut robot = Watched::new(&format!("[fence]\npolygon_m = {corners}\n{CIRCLE}"));
    assert_eq!(robot.ask(go(0.0, 2.0, 0.0)), RequestAnswer::Taken);
    robot.until_it_holds();
    let around = go(0.0, 0.5, 0.0);
    assert_eq!(robot.ask(around), RequestAnswer::Taken);
    robot.run(600);
    let there = go(2.2, 0.0, 0.0);
    assert_eq!(robot.ask(there), RequestAnswer::OutsideFence, "across the corner");
    while robot.before.setpoint.odom_from_body.y_m > 0.6 {
        robot.step(None);
    }
    assert_eq!((robot.before.course, robot.ask(there)), (Course::Way, RequestAnswer::Taken), "past it");
    let end = robot.until_it_holds();
    assert!(end.distance_m(Pose2::new(2.2, 0.0, 0.0)) < 1e-6, "{end:?}");
}

#[test]
fn the_same_way_asked_again_and_again_is_the_same_way() {
    let goal = go(1.2, 0.9, 0.7);
    let drive = |every: Option<u32>| {
        let mut robot = Watched::new(CIRCLE);
        assert_eq!(robot.ask(goal), RequestAnswer::Taken);
        let mut cycles = 0;
        while robot.bench.robot.phase() == Phase::Tracking {
            cycles += 1;
            // Where it brakes with all it has, what the last cycle's rounding adds to its way takes a moment more.
            match every.filter(|every| cycles < 1000 && cycles % every == 0) {
                Some(_) => assert_eq!(robot.ask(goal), RequestAnswer::Taken),
                None => robot.run(1),
            }
        }
        (cycles, robot.before.setpoint.odom_from_body)
    };
    let (cycles, end) = drive(None);
    let (again, there) = drive(Some(20));
    assert!(again.abs_diff(cycles) < 25, "{again} {cycles}");
    assert!(end.distance_m(there) < 1e-5, "{end:?} {there:?}");
}

#[test]
fn a_path_may_begin_behind_a_platform_that_moves_along_it_and_not_beside_it() {
    let odom = |y_m: f64| {
        path(vec![[0.0, 0.0, y_m, 0.0], [2.0, 0.5, y_m, 0.0], [4.0, 2.0, y_m + 0.5, 0.0]], PathFrame::Odom)
    };
    let mut robot = Watched::new(CIRCLE);
    robot.drive(Twist2::new(0.5, 0.0, 0.0), 900);
    let x_m = robot.before.setpoint.odom_from_body.x_m;
    assert!(x_m > 0.3, "{x_m}");
    robot.load(1, &odom(0.2));
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::TooFar);
    robot.load(2, &odom(0.0));
    robot.slowest_m_s = f64::INFINITY;
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
    robot.run(500);
    assert!(robot.slowest_m_s > 0.2, "without a stop: {}", robot.slowest_m_s);
    let end = robot.until_it_holds();
    assert!(end.distance_m(Pose2::new(2.0, 0.5, 0.0)) < 1e-5, "{end:?}");
    // Who stands there is too far from its start.
    robot.ask(go(0.4, 0.0, 0.0));
    robot.until_it_holds();
    assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::TooFar);
}

/// A straight way along x in odom that is passed with speeds at its ends.
fn passed(from_m: f64, to_m: f64, speeds_m_s: [Option<f64>; 2]) -> ReferenceTable {
    let points = vec![[0.0, from_m, 0.0, 0.0], [1.0, to_m, 0.0, 0.0]];
    let [start_speed_m_s, end_speed_m_s] = speeds_m_s;
    ReferenceTable { start_speed_m_s, end_speed_m_s, ..path(points, PathFrame::Odom) }
}

#[test]
fn a_way_that_ends_with_a_speed_stops_behind_it_where_nothing_follows_and_goes_over_where_something_does() {
    let speed_m_s = 0.5;
    for follows in [false, true] {
        let mut robot = Watched::new(CIRCLE);
        let first = passed(0.0, 1.5, [None, Some(speed_m_s)]);
        assert_eq!(robot.load(1, &first), RequestAnswer::Taken);
        assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
        while robot.before.setpoint.odom_from_body.x_m < 1.5 {
            robot.step(None);
        }
        let at_end_m_s = robot.before.setpoint.twist_in_odom.speed_m_s();
        assert!((at_end_m_s / speed_m_s - 1.0).abs() < 0.01, "{at_end_m_s}");
        if follows {
            let next = passed(1.5, 3.0, [Some(speed_m_s), None]);
            assert_eq!(robot.load(2, &next), RequestAnswer::Taken);
            robot.slowest_m_s = f64::INFINITY;
            assert_eq!(robot.ask(RequestKind::Track), RequestAnswer::Taken);
            while robot.before.setpoint.odom_from_body.x_m < 2.0 {
                robot.step(None);
            }
            assert!(robot.slowest_m_s > 0.6 * speed_m_s, "{}", robot.slowest_m_s);
            assert!((robot.until_it_holds().x_m - 3.0).abs() < 1e-6);
        } else {
            // v²/2a, a tenth and what the jerk takes.
            let run_m = robot.until_it_holds().x_m - 1.5;
            let least_m = speed_m_s * speed_m_s / (2.0 * robot.bench.plan.limits.acceleration_m_s2);
            assert!((least_m..1.1 * least_m + 0.04).contains(&run_m), "{run_m} m, at least {least_m}");
        }
    }
}
