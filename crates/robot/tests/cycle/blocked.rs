//! Ways that obstacles block: refused beforehand, given up in time, and caught up with gently where they open.

use omnibase_platform::Pose2;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{Course, CycleRecord, RequestAnswer, SafetyReason};
use omnibase_robot::{Phase, RequestKind};

use super::support::{BMM, Bench, plan};

/// Two metres ahead in four seconds.
const AHEAD: &str = "[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [4, 2, 0, 0]]\n";

fn bench(more: &str) -> Bench {
    let mut bench = Bench::new(plan(&format!("{BMM}\n{more}\n")));
    bench.enable();
    bench
}

fn standing(x_m: f64, y_m: f64, radius_m: f64) -> Obstacle {
    Obstacle { centre_m: [x_m, y_m], radius_m, velocity_m_s: [0.0; 2] }
}

fn put(bench: &mut Bench, index: u32, obstacle: Obstacle) {
    let record = bench.step(Some(RequestKind::SetObstacle { index, obstacle }));
    assert_eq!(record.answer, RequestAnswer::Taken);
}

/// A corridor from -1 to 5 m, 2 m wide, with a row of obstacles across it.
fn closed_corridor(reference: &str) -> Bench {
    let mut bench = bench(&format!("[fence]\nrectangle_m = [-1.0, -1.0, 5.0, 1.0]\n{reference}"));
    for (index, y_m) in (0..).zip([-0.8, -0.4, 0.0, 0.4, 0.8]) {
        put(&mut bench, index, standing(1.8, y_m, 0.2));
    }
    bench
}

/// The record of the cycle in which it no longer tracks, and that cycle's number.
fn until_it_ends(bench: &mut Bench, most_s: u64) -> (u64, CycleRecord) {
    for cycle in 0..1000 * most_s {
        let record = bench.step(None);
        if bench.robot.phase() != Phase::Tracking {
            return (cycle, record);
        }
    }
    panic!("still under way after {most_s} s");
}

#[test]
fn before_a_closed_corridor_a_path_and_a_way_are_given_up() {
    let path = "[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [12, 3.5, 0, 0]]\n";
    let go = RequestKind::GoTo { odom_from_body: Pose2::new(3.5, 0.0, 0.0) };
    for kind in [RequestKind::Track, go] {
        let mut bench = closed_corridor(path);
        assert_eq!(bench.step(Some(kind)).answer, RequestAnswer::Taken);
        let (cycle, record) = until_it_ends(&mut bench, 40);
        assert_eq!(record.allowed.reason, SafetyReason::WayBlocked, "{kind:?}");
        println!("{kind:?} before a closed corridor: given up after {:.1} s", 1e-3 * cycle as f64);
        // The wall is reached after a few seconds; then the plan waits for 5 s.
        assert!((5_000..25_000).contains(&cycle), "{kind:?}: {cycle}");
        assert_eq!(bench.robot.phase(), Phase::Stopping);
        let record = bench.run(2000);
        assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::WayBlocked));
        // It stands, and nothing brings it back into motion.
        let place = record.setpoint.odom_from_body;
        assert_eq!(bench.run(2000).setpoint.odom_from_body, place);
    }
}

#[test]
fn a_goal_inside_of_an_obstacles_distance_is_refused_beforehand_and_a_start_is_left() {
    let mut bench = bench(AHEAD);
    let go = |x_m: f64| Some(RequestKind::GoTo { odom_from_body: Pose2::new(x_m, 0.0, 0.0) });
    // In the obstacle, and as near as the distance forbids; where it drives on, it counts where it is now.
    put(&mut bench, 3, Obstacle { velocity_m_s: [0.0, 1e-6], ..standing(2.0, 0.0, 0.2) });
    let reach_m = bench.plan.guard.footprint_m.iter().map(|corner| corner[0]).fold(0.0, f64::max);
    for (x_m, answer) in [
        (2.0, RequestAnswer::Blocked),
        (2.0 - 0.2 - reach_m - 0.09, RequestAnswer::Blocked),
        (2.0 - 0.2 - reach_m - 0.15, RequestAnswer::Taken),
    ] {
        assert_eq!(bench.step(go(x_m)).answer, answer, "{x_m}");
        if answer == RequestAnswer::Blocked {
            assert_eq!((bench.robot.phase(), bench.robot.record().course.code()), (Phase::Holding, 0));
        }
    }
    until_it_ends(&mut bench, 10);
    // The path's end; without the obstacle it goes.
    let mut bench = self::bench(AHEAD);
    put(&mut bench, 0, standing(2.0, 0.0, 0.2));
    assert_eq!(bench.step(Some(RequestKind::Track)).answer, RequestAnswer::Blocked);
    assert_eq!(bench.robot.phase(), Phase::Holding);
    // Its start, where the platform stands: it leaves what is too near there.
    put(&mut bench, 0, standing(-reach_m - 0.25, 0.0, 0.2));
    assert_eq!(bench.step(Some(RequestKind::Track)).answer, RequestAnswer::Taken);
    // Its end, for whoever goes on with it.
    bench.run(1500);
    bench.step(Some(RequestKind::Pause));
    until_it_ends(&mut bench, 5);
    bench.run(10);
    put(&mut bench, 0, standing(2.0, 0.0, 0.1));
    assert_eq!(bench.step(Some(RequestKind::Resume)).answer, RequestAnswer::Blocked);
    bench.step(Some(RequestKind::RemoveObstacle { index: 0 }));
    assert_eq!(bench.step(Some(RequestKind::Resume)).answer, RequestAnswer::Taken);
    let (_, record) = until_it_ends(&mut bench, 10);
    assert_eq!(record.stop_reason, SafetyReason::None);
    assert!((bench.run(10).setpoint.odom_from_body.x_m - 2.0).abs() < 1e-3);
}

#[test]
fn a_plan_that_is_held_back_within_a_millimetre_of_its_end_ends_too() {
    for left_m in [8e-4, 1e-4, 1e-5] {
        let mut bench = bench("");
        let goal = Pose2::new(0.5, 0.0, 0.0);
        bench.step(Some(RequestKind::GoTo { odom_from_body: goal }));
        while bench.run(1).setpoint.odom_from_body.distance_m(goal) > left_m {}
        // Too near all around: nowhere does a motion lead away from all of them.
        for index in 0..12 {
            let (sin, cos) = (f64::from(index) * std::f64::consts::TAU / 12.0).sin_cos();
            put(&mut bench, index, standing(0.5 + 0.75 * cos, 0.75 * sin, 0.3));
        }
        let (cycle, record) = until_it_ends(&mut bench, 20);
        assert_eq!(record.allowed.reason, SafetyReason::WayBlocked, "{left_m}");
        // The way may have come to its end in the very cycle in which so little was left.
        assert!((4_999..6_000).contains(&cycle), "{left_m}: {cycle}");
        let lacks_m = record.setpoint.odom_from_body.distance_m(goal);
        assert!(lacks_m > 1e-6 && lacks_m <= left_m, "{left_m}: {lacks_m}");
    }
}

#[test]
fn a_path_whose_start_is_refused_is_gone_on_with_where_it_was() {
    // A refusal changes nothing: a path that begins where the platform stands isn't laid anew.
    let mut bench = bench(AHEAD);
    bench.step(Some(RequestKind::Track));
    bench.run(2000);
    bench.step(Some(RequestKind::Pause));
    until_it_ends(&mut bench, 5);
    bench.run(10);
    let here = bench.robot.record().setpoint.odom_from_body;
    put(&mut bench, 0, standing(here.x_m + 2.0, 0.0, 0.05));
    assert_eq!(bench.step(Some(RequestKind::Track)).answer, RequestAnswer::Blocked);
    assert_eq!(bench.step(Some(RequestKind::Resume)).answer, RequestAnswer::Taken);
    until_it_ends(&mut bench, 10);
    assert!((bench.run(10).setpoint.odom_from_body.x_m - 2.0).abs() < 1e-3);
}

#[test]
fn a_goal_that_an_obstacle_took_under_way_is_given_up_and_the_time_can_be_set() {
    let mut found = Vec::new();
    for give_up_s in [1.0, 5.0] {
        let mut bench = bench(&format!("[avoidance]\ngive_up_s = {give_up_s:?}\n"));
        bench.step(Some(RequestKind::GoTo { odom_from_body: Pose2::new(1.5, 0.0, 0.0) }));
        bench.run(500);
        put(&mut bench, 0, standing(1.5, 0.0, 0.2));
        let (cycle, record) = until_it_ends(&mut bench, 30);
        assert_eq!(record.allowed.reason, SafetyReason::WayBlocked);
        println!("a goal inside an obstacle, {give_up_s} s: given up after {:.1} s", 1e-3 * cycle as f64);
        found.push(cycle);
    }
    assert!((3_000..12_000).contains(&(found[1] - found[0])), "{found:?}");
}

#[test]
fn who_waits_for_a_moving_obstacle_to_pass_goes_on_and_a_pause_is_no_block() {
    // It crosses the corridor's width and leaves room again after about three seconds.
    let mut bench = bench(&format!("[fence]\nrectangle_m = [-1.0, -0.8, 5.0, 0.8]\n{AHEAD}"));
    put(&mut bench, 0, Obstacle { velocity_m_s: [0.0, -0.5], ..standing(1.3, 1.5, 0.3) });
    assert_eq!(bench.step(Some(RequestKind::Track)).answer, RequestAnswer::Taken);
    let mut waited = 0_u32;
    let record = loop {
        let record = bench.step(None);
        waited += u32::from(record.reference_rate < 0.05);
        if bench.robot.phase() != Phase::Tracking {
            break record;
        }
        assert!(bench.index < 40_000, "it goes on");
    };
    assert_eq!(record.allowed.reason, SafetyReason::None);
    assert!(waited > 300, "it had to wait: {waited} cycles");
    assert!((bench.run(10).setpoint.odom_from_body.x_m - 2.0).abs() < 1e-3);
    // A robot that is paused in the middle of it holds, for whatever time.
    let mut bench = self::bench(AHEAD);
    bench.step(Some(RequestKind::Track));
    bench.run(1500);
    bench.step(Some(RequestKind::Pause));
    let record = bench.run(20_000);
    assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::None));
}

#[test]
fn a_slow_path_is_caught_up_with_at_little_more_than_its_own_speed() {
    // 0.19 m/s at most, and an obstacle that drives across it.
    let slow = "[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [20, 2.53, 0, 0]]\n";
    for (setting, factor) in [("", 1.2), ("[avoidance]\ncatch_up_factor = 2.0\n", 2.0)] {
        let mut bench = bench(&format!("{slow}{setting}"));
        put(&mut bench, 0, Obstacle { velocity_m_s: [0.0, -0.15], ..standing(2.0, 1.3, 0.3) });
        assert_eq!(bench.step(Some(RequestKind::Track)).answer, RequestAnswer::Taken);
        let (mut own_m_s, mut fastest_m_s, mut lag_m) = (0.0_f64, 0.0_f64, 0.0_f64);
        let record = loop {
            let record = bench.step(None);
            let (wished, setpoint) = (&record.wished, &record.setpoint);
            if record.course == Course::Reference {
                own_m_s = own_m_s.max(wished.twist_in_odom.speed_m_s());
            }
            fastest_m_s = fastest_m_s.max(setpoint.twist_in_odom.speed_m_s());
            lag_m = lag_m.max(wished.odom_from_body.distance_m(setpoint.odom_from_body));
            if bench.robot.phase() != Phase::Tracking {
                break record;
            }
            assert!(bench.index < 80_000, "it arrives");
        };
        assert_eq!(record.allowed.reason, SafetyReason::None);
        assert!((bench.run(10).setpoint.odom_from_body.x_m - 2.53).abs() < 1e-3, "it arrives");
        println!("catching up, factor {factor}: {fastest_m_s:.3} m/s on a path of {own_m_s:.3} m/s");
        assert!((own_m_s - 0.19).abs() < 0.003, "{own_m_s}");
        assert!(lag_m > 0.2, "it had to give way: {lag_m}");
        assert!(fastest_m_s <= 1.001 * factor * own_m_s, "{fastest_m_s} on a path of {own_m_s}");
        assert!(fastest_m_s > 0.95 * factor * own_m_s, "what is allowed is used: {fastest_m_s}");
    }
}

#[test]
fn what_was_missed_is_caught_up_with_gently_after_the_obstacle_was_taken_away() {
    let slow = "[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [20, 2.53, 0, 0]]\n";
    let mut bench = bench(slow);
    bench.step(Some(RequestKind::Track));
    bench.run(6000);
    let x_m = bench.robot.record().setpoint.odom_from_body.x_m;
    // Where it stands before it, the plan's time goes on in it; then nothing is there any more.
    put(&mut bench, 0, standing(x_m + 0.9, 0.0, 0.3));
    bench.run(5000);
    let record = bench.step(Some(RequestKind::RemoveObstacle { index: 0 }));
    let lag_m = record.wished.odom_from_body.distance_m(record.setpoint.odom_from_body);
    assert!(lag_m > 0.1, "{lag_m}");
    while bench.robot.phase() == Phase::Tracking {
        let speed_m_s = bench.step(None).setpoint.twist_in_odom.speed_m_s();
        assert!(speed_m_s <= 1.2 * 0.1905, "{speed_m_s}");
        assert!(bench.index < 80_000);
    }
    assert!((bench.run(10).setpoint.odom_from_body.x_m - 2.53).abs() < 1e-3);
}

#[test]
fn who_is_paused_beside_an_obstacle_holds_there_and_stays_when_it_is_taken_away() {
    for pause_at in [1_900, 2_400, 3_000] {
        let mut bench = bench(AHEAD);
        bench.step(Some(RequestKind::Track));
        bench.run(800);
        put(&mut bench, 0, standing(1.3, 0.05, 0.3));
        bench.run(pause_at - 800);
        let lag_m =
            |record: &CycleRecord| record.wished.odom_from_body.distance_m(record.setpoint.odom_from_body);
        assert!(lag_m(bench.robot.record()) > 0.05, "{pause_at}: {}", lag_m(bench.robot.record()));
        assert_eq!(bench.step(Some(RequestKind::Pause)).answer, RequestAnswer::Taken);
        until_it_holds(&mut bench);
        let held = bench.run(1).setpoint;
        bench.step(Some(RequestKind::RemoveObstacle { index: 0 }));
        let record = bench.run(2000);
        assert_eq!(record.phase, Phase::Holding);
        assert!(
            record.setpoint.odom_from_body.distance_m(held.odom_from_body) < 1e-6,
            "{pause_at}: it moved"
        );
        // A person goes on with it.
        assert_eq!(bench.step(Some(RequestKind::Resume)).answer, RequestAnswer::Taken);
        until_it_holds(&mut bench);
        assert!((bench.run(10).setpoint.odom_from_body.x_m - 2.0).abs() < 1e-3, "{pause_at}");
    }
}

fn until_it_holds(bench: &mut Bench) {
    for _ in 0..30_000 {
        if bench.robot.phase() == Phase::Holding {
            return;
        }
        bench.step(None);
    }
    panic!("it still moves");
}
