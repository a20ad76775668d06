//! What the robot's file says about the time behind a lost SubDevice: stay, hold, or move again after a warning; and
//! what forbids it to say more than "stay".

use std::time::Duration;

use omnibase_ethercat_sim::device::servo::Encoder;
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, FaultAction, Injection, Segment, Target, in_process};
use omnibase_robot::signals::{CycleRecord, Phase};
use omnibase_robot::{Exchange, RequestKind, RobotPlan};
use omnibase_robot_sim::machine::Truth;
use omnibase_robot_sim::{RobotSim, SharedMachine};
use omnibase_run::conductor::{Conductor, Wish};
use omnibase_run::simulated;

use crate::bench::{Bench, plan, plan_changed};

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
    moves_again_in_s: Option<f64>,
}

/// A run with a drive that loses its power, led as `omnibase run` leads it.
struct Led {
    moments: Vec<Moment>,
    finished: bool,
    events: Vec<(u64, String)>,
}

fn led(plan: &RobotPlan, off_for: Duration) -> Led {
    let power_cycle = |bench: &mut Bench| {
        if bench.cycles == LOST {
            bench.inject(2, Fault::PowerCycle { off_for });
        }
    };
    led_through(plan, power_cycle)
}

/// A run that something happens to, cycle by cycle.
fn led_through(plan: &RobotPlan, happen: impl FnMut(&mut Bench)) -> Led {
    let (segment, machine) = simulated::segment(plan).unwrap();
    led_on(segment, machine, plan, happen)
}

/// As [`led_through`], with drives of one's own.
fn led_on(
    segment: Segment,
    machine: SharedMachine,
    plan: &RobotPlan,
    mut happen: impl FnMut(&mut Bench),
) -> Led {
    let (link, clock) = in_process(segment);
    let mut bench = Bench::with(plan, link, clock);
    let mut conductor = Conductor::new(plan.safety.comeback);
    let mut moments = Vec::new();
    while !conductor.is_over() && bench.cycles < MOST_CYCLES {
        happen(&mut bench);
        let request = conductor.next(bench.robot.record(), bench.robot.phase(), Wish::GoOn);
        if let Some(note) = conductor.take_note() {
            bench.events.push((bench.cycles, note.to_owned()));
        }
        bench.cycle(request);
        while let Some((wheel, error)) = bench.session.take_said() {
            conductor.drive_said(wheel, error);
        }
        let truth = machine.truth();
        let (record, phase) = (*bench.robot.record(), bench.robot.phase());
        let moves_again_in_s = conductor.moves_again_in_s(record.time.now_ns);
        moments.push(Moment { record, phase, truth, moves_again_in_s });
    }
    assert!(conductor.is_over(), "the run never ends: {:?}", bench.events);
    Led { moments, finished: conductor.has_finished(), events: bench.events }
}

impl Led {
    /// The cycles behind the loss.
    fn after(&self) -> &[Moment] {
        &self.moments[LOST as usize + 10..]
    }

    /// Nothing moved any more once it had stopped.
    fn never_moves_again(&self) {
        assert!(!self.finished, "{:?}", self.events);
        for moment in self.after() {
            let (cycle, phase) = (moment.record.time.index, moment.phase);
            assert!(phase != Phase::Tracking, "it moves again in cycle {cycle}: {:?}", self.events);
        }
    }

    /// Neither moved anything, nor was torque there again.
    fn stays(&self) {
        self.never_moves_again();
        for moment in self.after() {
            let phase = moment.phase;
            assert!(
                !matches!(phase, Phase::Enabling | Phase::Holding),
                "cycle {}: {phase:?}: {:?}",
                moment.record.time.index,
                self.events
            );
            assert!(!matches!(
                moment.record.request.map(|request| request.kind),
                Some(RequestKind::Acknowledge | RequestKind::Enable | RequestKind::Resume)
            ));
        }
        assert_eq!(self.after().last().unwrap().phase, Phase::Fault);
    }

    /// The cycle in which the drive was told to be in OP again.
    fn back_in_op(&self) -> Option<u64> {
        self.events.iter().find(|(_, text)| text.contains("back in OP")).map(|(cycle, _)| *cycle)
    }
}

#[test]
fn where_the_file_says_so_the_robot_moves_again_after_a_warning_without_a_jump() {
    for stop in ["quick_stop", "ramp", "remove_torque"] {
        resumes(stop);
    }
}

/// A run that goes on, with this stop before.
fn resumes(stop: &str) {
    let policy = format!("{UNATTENDED}on_lost_device = \"{stop}\"\nmove_again_warning_ms = 3000\n");
    let plan = plan_changed(&format!("{CIRCLE}\n{policy}"), &[ABSOLUTE]);
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
    // Not before the drives stood for a second, and three seconds of warning while it holds.
    let at = |words: &str| run.events.iter().find(|(_, text)| text.contains(words)).unwrap().0;
    let (warned, moved) = (at("WARNING: what was lost is back"), at("nobody objected"));
    assert!(warned >= back + 1000 && moved >= warned + 3000, "{back}, {warned}, {moved}");
    for moment in &run.moments[warned as usize..moved as usize] {
        assert_eq!(moment.phase, Phase::Holding, "cycle {}", moment.record.time.index);
        assert!(moment.moves_again_in_s.is_some_and(|left_s| left_s <= 3.0));
    }
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
    led(&plan(&format!("{CIRCLE}\n{text}")), off_for).stays();
}

#[test]
fn where_it_says_stay_or_nothing_the_robot_stays_where_it_stopped() {
    for text in ["", "[safety]\nafter_lost_device = \"stay\"\n"] {
        stays(text, OFF);
    }
}

#[test]
fn a_drive_that_comes_back_too_late_is_not_waited_for() {
    stays(&format!("{UNATTENDED}lost_device_wait_ms = 200\n"), Duration::from_secs(3));
}

/// The value of `after_lost_device` under which a run goes on without a person.
const UNATTENDED: &str = "[safety]\nafter_lost_device = \"move_again_unattended\"\n";
/// Encoders that keep their count without supply.
const ABSOLUTE: &str = "drive_defaults.encoder = \"absolute\"";

/// The metres and radians by which the robot isn't where it believes to be.
fn astray(moment: &Moment) -> (f64, f64) {
    let (is, believed) = (moment.truth.pose, moment.record.state.odom_from_body);
    let way_m = (is.x_m - believed.x_m).hypot(is.y_m - believed.y_m);
    (way_m, omnibase_platform::wrap_angle_rad(is.heading_rad - believed.heading_rad).abs())
}

#[test]
fn a_drive_fault_during_a_loss_is_not_acknowledged_by_itself() {
    let run = led_through(&plan(&format!("{CIRCLE}\n{UNATTENDED}")), |bench| match bench.cycles {
        LOST => bench.inject(2, Fault::PowerCycle { off_for: OFF }),
        n if n == LOST + 100 => bench.inject(1, Fault::Application(ApplicationFault::DriveFault(0x2310))),
        _ => {}
    });
    run.stays();
}

#[test]
fn an_emergency_stop_that_cuts_the_supply_is_not_undone_by_its_return() {
    let run = led_through(&plan(&format!("{CIRCLE}\n{UNATTENDED}")), |bench| {
        if bench.cycles == LOST {
            (0..3)
                .for_each(|drive| bench.inject(drive, Fault::PowerCycle { off_for: Duration::from_secs(1) }));
        }
    });
    run.stays();
}

#[test]
fn where_a_wheel_rolled_unread_the_pose_is_unknown_and_nothing_moves_again() {
    for off_for in [OFF, Duration::from_secs(12)] {
        let run = led(&plan(&format!("{CIRCLE}\n{UNATTENDED}")), off_for);
        let (before, last) = (&run.moments[LOST as usize - 1], run.moments.last().unwrap());
        let [xx, _, _, yy, _, hh] = last.record.state.covariance;
        let ((way_m, turn_rad), state) = (astray(last), last.record.state);
        println!(
            "{off_for:?}: astray by {way_m:.4} m, {turn_rad:.4} rad; sigma {:.4} m, {:.4} rad",
            xx.sqrt(),
            hh.sqrt()
        );
        assert!(before.record.state.pose_known && !state.pose_known);
        // It isn't where it believes to be, and what it believes says so.
        assert!(way_m > 0.02 && turn_rad > 0.02, "{way_m} m, {turn_rad} rad");
        assert!(
            way_m < 3.0 * xx.min(yy).sqrt() && turn_rad < 3.0 * hh.sqrt(),
            "{way_m} m, {turn_rad} rad: {state:?}"
        );
        // As far as a wheel of that speed goes meanwhile, and not for ever: the bound is of use.
        assert!(xx.sqrt() < 0.5 * off_for.as_secs_f64() + 0.5, "{} m", xx.sqrt());
        assert!(run.events.iter().any(|(_, text)| text.contains("the pose is unknown: a person sets it")));
        run.never_moves_again();
    }
}

#[test]
fn an_absolute_encoder_that_was_read_across_the_gap_tells_what_its_wheel_rolled() {
    let plan = plan_changed(&format!("{CIRCLE}\n{UNATTENDED}"), &[ABSOLUTE]);
    let run = led(&plan, OFF);
    let goes_on = run.after().iter().find(|moment| moment.phase == Phase::Tracking).unwrap();
    let (way_m, turn_rad) = astray(goes_on);
    println!(
        "astray by {way_m:.4} m, {turn_rad:.4} rad, sigma {:.4} m",
        goes_on.record.state.covariance[0].sqrt()
    );
    assert!(way_m < 0.01 && turn_rad < 0.01, "{way_m} m, {turn_rad} rad");
    assert!(run.moments.iter().all(|moment| moment.record.state.pose_known) && run.finished);
}

#[test]
fn an_encoder_that_is_said_to_be_absolute_and_counts_anew_is_not_believed() {
    let plan = plan_changed(&format!("{CIRCLE}\n{UNATTENDED}"), &[ABSOLUTE]);
    let mut description = simulated::description(&plan);
    description.drives[2].encoder = Encoder::Incremental;
    let (segment, machine) = RobotSim::new(&description).unwrap().into_line().unwrap();
    let run = led_on(segment, machine, &plan, |bench| {
        if bench.cycles == LOST {
            bench.inject(2, Fault::PowerCycle { off_for: OFF });
        }
    });
    assert!(!run.moments.last().unwrap().record.state.pose_known);
    run.never_moves_again();
}

#[test]
fn frames_that_are_lost_while_it_moves_leave_the_pose_known() {
    // Drives that keep their supply go on counting: what they rolled comes with the next exchange.
    for frames in [10, 3000, 12_000] {
        let mut bench = Bench::new(&plan(CIRCLE));
        bench.enable();
        bench.cycle(Some(RequestKind::Track));
        bench.run(3000);
        {
            let mut link = bench.link.0.borrow_mut();
            let next = link.counts().frames;
            for frame in next..next + frames {
                link.inject(Injection { target: Target::Frame(frame), action: FaultAction::DropRequest });
            }
        }
        let before = *bench.robot.record();
        bench.run(frames + 3000);
        let after = *bench.robot.record();
        assert!(after.state.pose_known && after.exchange == Exchange::Complete, "{frames}: {after:?}");
        let rolled_m = after.state.odom_from_body.distance_m(before.state.odom_from_body);
        assert!(rolled_m > 0.05, "{frames} frames: it rolled out, and {rolled_m} m of it were counted");
        let [xx, .., hh] = after.state.covariance;
        assert!(xx.sqrt() < 0.1 && hh.sqrt() < 0.1, "{frames}: {:?}", after.state.covariance);
    }
}

#[test]
fn drives_that_only_missed_frames_are_acknowledged_and_those_behind_come_back() {
    let plan = plan(&format!("{CIRCLE}\n{UNATTENDED}"));
    let run = led_through(&plan, |bench| match bench.cycles {
        LOST => bench.inject(0, Fault::CableCut { port: 1 }),
        n if n == LOST + 300 => bench.inject(0, Fault::CableRestored { port: 1 }),
        _ => {}
    });
    let faults = run.events.iter().filter(|(_, text)| text.contains("drive fault")).count();
    println!("{faults} drives showed a fault: {:#?}", run.events);
    assert!(
        run.finished && run.moments.iter().all(|moment| moment.record.state.pose_known),
        "{:#?}",
        run.events
    );
}

#[test]
fn a_loss_during_a_drives_fault_stays_a_fault() {
    for stop in ["quick_stop", "ramp", "remove_torque"] {
        let text = format!("{CIRCLE}\n{UNATTENDED}on_lost_device = \"{stop}\"\n");
        led_through(&plan(&text), |bench| match bench.cycles {
            LOST => bench.inject(1, Fault::Application(ApplicationFault::DriveFault(0x2310))),
            n if n == LOST + 5 => bench.inject(2, Fault::PowerCycle { off_for: OFF }),
            _ => {}
        })
        .stays();
    }
}

#[test]
fn a_robot_that_only_holds_again_ends_a_run_that_nobody_leads() {
    stays("[safety]\nafter_lost_device = \"hold\"\n", OFF);
}

#[test]
fn a_terminal_that_was_lost_comes_back_as_a_drive_does_unless_its_input_stops() {
    let text = format!(
        "{CIRCLE}[safety]\nafter_lost_device = \"move_again_unattended\"\nmove_again_warning_ms = 3000\n\
         stop_input = \"buttons.stop\"\n[[device]]\nname = \"buttons\"\nposition = 3\nkind = \"io\"\n\
         inputs = [{{ pdo = \"0x1A00\", map = \"6000.1:1\" }}]\ninput = [{{ name = \"stop\", object = \"6000.1\" }}]\n"
    );
    let plan = plan(&text);
    // For how long somebody presses it, from 500 cycles after the loss.
    for pressed in [0, 100, 100_000] {
        let simulated::Simulated { segment, machine, panels, .. } = simulated::robot(&plan).unwrap();
        let led = led_on(segment, machine, &plan, |bench| {
            if bench.cycles == LOST {
                bench.inject(3, Fault::PowerCycle { off_for: OFF });
            }
            let since = bench.cycles.saturating_sub(LOST + 500);
            let object = omnibase_ethercat::wire::coe::ObjectAddress::new(0x6000, 1);
            panels[0].set_input(object, (since > 0 && since <= pressed).into());
        });
        let fault = led.moments.iter().position(|moment| moment.phase == Phase::Fault).expect("it stops");
        let goes_on = led.moments[fault..].iter().any(|moment| moment.phase == Phase::Tracking);
        assert_eq!((goes_on, led.finished), (pressed == 0, pressed == 0), "{pressed}: {:?}", led.events);
    }
}
