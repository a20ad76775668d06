//! What the robot's file says about the time behind a lost SubDevice: stay, or go on with the path without a jump.

use std::time::Duration;

use omnibase_ethercat_sim::{Fault, in_process};
use omnibase_robot::signals::{CycleRecord, Phase};
use omnibase_robot::{RequestKind, RobotPlan};
use omnibase_robot_sim::SharedMachine;
use omnibase_robot_sim::machine::Truth;
use omnibase_run::conductor::{Conductor, Wish};
use omnibase_run::simulated;

use crate::bench::{Bench, plan};

const CIRCLE: &str = "[reference]\nkind = \"circle\"\nradius_m = 0.3\nduration_s = 8.0\n";
/// The cycle in which the drive is lost: in the midst of the circle.
const LOST: u64 = 5000;
/// Without power.
const OFF: Duration = Duration::from_millis(300);
/// Longer than the circle, the stop, the way back to OP and the rest of the circle.
const MOST_CYCLES: u64 = 40_000;
/// The cycle, s.
const CYCLE_S: f64 = 1e-3;
/// Room for rounding, and for the corner of a limit within a cycle.
const ROUNDING: f64 = 1.0 + 1e-6;

/// One cycle of a run.
struct Moment {
    record: CycleRecord,
    phase: Phase,
    truth: Truth,
}

/// A run with a drive that loses its power, led as `omnibase run` leads it.
struct Led {
    moments: Vec<Moment>,
    finished: bool,
    events: Vec<(u64, String)>,
}

fn led(plan: &RobotPlan, off_for: Duration) -> Led {
    let (segment, machine): (_, SharedMachine) = simulated::segment(plan).unwrap();
    let (link, clock) = in_process(segment);
    let mut bench = Bench::with(plan, link, clock);
    let mut conductor = Conductor::new(plan.safety.resume_within_ns);
    let mut moments = Vec::new();
    while !conductor.is_over() && bench.cycles < MOST_CYCLES {
        if bench.cycles == LOST {
            bench.inject(2, Fault::PowerCycle { off_for });
        }
        let request = conductor.next(bench.robot.record(), bench.robot.phase(), Wish::GoOn);
        bench.cycle(request);
        let truth = machine.truth();
        moments.push(Moment { record: *bench.robot.record(), phase: bench.robot.phase(), truth });
    }
    assert!(conductor.is_over(), "the run never ends: {:?}", bench.events);
    Led { moments, finished: conductor.has_finished(), events: bench.events }
}

impl Led {
    /// The cycles behind the loss.
    fn after(&self) -> &[Moment] {
        &self.moments[LOST as usize + 10..]
    }

    /// The cycle in which the drive was told to be in OP again.
    fn back_in_op(&self) -> Option<u64> {
        self.events.iter().find(|(_, text)| text.contains("back in OP")).map(|(cycle, _)| *cycle)
    }
}

#[test]
fn where_the_file_says_resume_the_robot_goes_on_with_its_path_without_a_jump() {
    for stop in ["quick_stop", "ramp", "remove_torque"] {
        resumes(stop);
    }
}

/// A run that goes on, with this stop before.
fn resumes(stop: &str) {
    let policy = format!("on_lost_device = \"{stop}\"\nafter_lost_device = \"resume\"");
    let plan = plan(&format!("{CIRCLE}\n[safety]\n{policy}\n"));
    let run = led(&plan, OFF);
    assert!(run.finished, "{:?}", run.events);
    let back = run.back_in_op().expect("it came back");
    for moment in run.after() {
        let cycle = moment.record.time.index;
        let is_tracking = moment.phase == Phase::Tracking;
        assert!(!is_tracking || cycle > back, "cycle {cycle}: it moves before the drive is back ({back})");
    }
    let resumed = run.after().iter().position(|moment| moment.phase == Phase::Tracking).unwrap();
    let (left, goes_on) = (&run.moments[LOST as usize - 1], &run.after()[resumed..]);
    // From where it was left, not from the start: but for the cycles until the loss was noticed.
    let begins_s = goes_on[0].record.reference_time_s;
    let late_s = begins_s - left.record.reference_time_s;
    assert!(
        (0.0..0.1).contains(&late_s),
        "left at {} s, goes on at {begins_s} s",
        left.record.reference_time_s
    );
    // It begins where the robot stands, as the robot knows it.
    let here = goes_on[0].record.state.odom_from_body;
    let first = goes_on[0].record.setpoint;
    assert!(first.odom_from_body.distance_m(here) < 1e-4, "{first:?}, {here:?}");
    let limits = &plan.limits;
    let (mut most_m_s2, mut most_rad_s2, mut step_m, mut wished_m_s2) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for pair in goes_on.array_windows::<2>() {
        if pair.iter().any(|moment| moment.phase != Phase::Tracking) {
            break;
        }
        let [before, now] = [&pair[0].record.setpoint, &pair[1].record.setpoint];
        let (was, is) = (before.twist_in_odom, now.twist_in_odom);
        most_m_s2 = most_m_s2.max((is.vx_m_s - was.vx_m_s).hypot(is.vy_m_s - was.vy_m_s) / CYCLE_S);
        most_rad_s2 = most_rad_s2.max((is.w_rad_s - was.w_rad_s).abs() / CYCLE_S);
        let [was, is] = pair.each_ref().map(|moment| moment.record.wished.twist_in_odom);
        wished_m_s2 = wished_m_s2.max((is.vx_m_s - was.vx_m_s).hypot(is.vy_m_s - was.vy_m_s) / CYCLE_S);
        step_m = step_m.max(now.odom_from_body.distance_m(before.odom_from_body));
    }
    println!(
        "{stop}: back in OP in cycle {back}, goes on {resumed} cycles behind the loss; at most {most_m_s2:.3} m/s² and \
         {most_rad_s2:.3} rad/s² wished, {:.3} mm in a cycle; {wished_m_s2:.3} m/s² before the limits",
        1e3 * step_m
    );
    assert!(most_m_s2 > 0.01, "it moved");
    assert!(wished_m_s2 <= limits.acceleration_m_s2 * ROUNDING, "{wished_m_s2} m/s²");
    assert!(most_m_s2 <= limits.acceleration_m_s2 * ROUNDING, "{most_m_s2} m/s²");
    assert!(most_rad_s2 <= limits.turn_acceleration_rad_s2 * ROUNDING, "{most_rad_s2} rad/s²");
    assert!(step_m <= limits.speed_m_s * CYCLE_S * ROUNDING, "{step_m} m");
    // What really moves: no jump either.
    let steps = goes_on.windows(3).map(|three| {
        let [a, b, c] = [three[0].truth.pose, three[1].truth.pose, three[2].truth.pose];
        (c.x_m - 2.0 * b.x_m + a.x_m).hypot(c.y_m - 2.0 * b.y_m + a.y_m) / (CYCLE_S * CYCLE_S)
    });
    let real_m_s2 = steps.fold(0.0, f64::max);
    println!("the machine itself: at most {real_m_s2:.3} m/s²");
    assert!(real_m_s2 < 2.0 * limits.acceleration_m_s2, "{real_m_s2} m/s²");
}

/// A run after which nothing moved again.
fn stays(text: &str, off_for: Duration) {
    let run = led(&plan(&format!("{CIRCLE}\n{text}")), off_for);
    assert!(!run.finished, "{:?}", run.events);
    for moment in run.after() {
        let phase = moment.phase;
        assert!(
            !matches!(phase, Phase::Enabling | Phase::Tracking | Phase::Holding),
            "cycle {}: {phase:?}",
            moment.record.time.index
        );
        assert!(!matches!(
            moment.record.request.map(|request| request.kind),
            Some(RequestKind::Acknowledge | RequestKind::Enable | RequestKind::Resume)
        ));
    }
    assert_eq!(run.after().last().unwrap().phase, Phase::Fault);
}

#[test]
fn where_it_says_stay_or_nothing_the_robot_stays_where_it_stopped() {
    for text in ["", "[safety]\nafter_lost_device = \"stay\"\n"] {
        stays(text, OFF);
    }
}

#[test]
fn a_drive_that_comes_back_too_late_is_not_waited_for() {
    let text = "[safety]\nafter_lost_device = \"resume\"\nlost_device_wait_ms = 200\n";
    stays(text, Duration::from_secs(3));
}
