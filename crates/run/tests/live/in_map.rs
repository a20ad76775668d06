//! Taught, gone to and repeated in map: motion capture falls silent on the way, and map jumps where it is heard again.

use std::sync::{Arc, Mutex};

use omnibase_platform::{Pose2, Twist2, wrap_angle_rad};
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Frame, Heard, MAX_SOURCE_VALUES, Phase, RequestAnswer};
use omnibase_run::RobotText;
use omnibase_run::live::{Answer, Ask, Client, Live, Snapshot, StickWish};
use omnibase_run::teach::{Sampling, taught};

use crate::hands::{BMM, Hands, played_by, reference};

const BY: Client = Client::Command;
/// When nobody tells poses, s.
const SILENT: [[f64; 2]; 2] = [[6.2, 7.4], [14.3, 15.6]];
/// How near is meant, m; poses are told without noise, as they are to the millimetre.
const NEAR_M: f64 = 1.5e-3;

/// What was seen, cycle by cycle.
#[derive(Default)]
struct Kept {
    before: Option<(Pose2, Pose2)>,
    /// The greatest step of map and of odom in a cycle, m.
    steps_m: [f64; 2],
    /// Ends of the taught path; where the platform truly stood after it was led, at the start again, at the end again.
    taught: Vec<Pose2>,
    places: Vec<Pose2>,
}

fn truth(seen: &Snapshot) -> Pose2 {
    seen.extras.truth.expect("simulated").odom_from_body
}

/// A tracker whose body is in the middle of the platform.
fn tell(live: &Live, seen: &Snapshot) {
    let at = truth(seen);
    let mut heard = Heard { instant_ns: live.clock_ns(), ..Heard::NOTHING };
    // No covariance of its own.
    heard.values = [0.0; MAX_SOURCE_VALUES];
    heard.values[..3].copy_from_slice(&[at.x_m, at.y_m, at.heading_rad]);
    live.send_inputs(0, &heard).unwrap();
}

fn near(one: Pose2, other: Pose2) -> (f64, f64) {
    (one.distance_m(other), wrap_angle_rad(one.heading_rad - other.heading_rad).abs())
}

#[test]
fn what_is_taught_and_gone_to_is_the_same_place_after_map_has_jumped() {
    // Treads that creep much, on a slope: wheels alone are wrong by a centimetre and more.
    let text = BMM.replace(
        "[simulation]\n",
        "[simulation]\nslope_rad = 0.02\nslope_direction_rad = 1.2\ncreep = 0.1\n",
    ) + "\n[estimator]\nkind = \"fused\"\n\n[[source]]\nname = \"tracker\"\ncarries = \"pose\"\nmax_age_ms = 1000\n\n\
           [[sensor]]\nname = \"mocap\"\nkind = \"pose\"\nfrom = \"tracker\"\nsigma_m = 0.001\nsigma_rad = 0.002\n";
    assert!(text.contains("slope_rad"));
    let kept = Arc::new(Mutex::new(Kept::default()));
    let seen_by_all = kept.clone();
    let run = played_by(RobotText { text, ..RobotText::default() }, 24.0, move |hands: &mut Hands| {
        for n in 5..2390_u32 {
            let time_s = f64::from(n) * 0.01;
            if !SILENT.iter().any(|[from_s, to_s]| (*from_s..*to_s).contains(&time_s)) {
                hands.at(time_s, tell);
            }
        }
        let watched = seen_by_all.clone();
        hands.between(1.0, 23.9, move |_, seen| {
            let now = (seen.record.fusion.map_from_body, seen.record.state.odom_from_body);
            let mut watched = watched.lock().unwrap();
            if let Some(before) = watched.before.replace(now) {
                let steps = [before.0.distance_m(now.0), before.1.distance_m(now.1)];
                watched.steps_m = [0, 1].map(|n| watched.steps_m[n].max(steps[n]));
            }
        });
        for time_s in [5.9, 13.4, 23.8] {
            let places = seen_by_all.clone();
            hands.at(time_s, move |_, seen| {
                assert_eq!(seen.phase, Phase::Holding, "at {time_s} s: {:?}", seen.record.stop_reason);
                places.lock().unwrap().places.push(truth(seen));
            });
        }
        hands.ask(0.5, BY, Ask::Robot(RequestKind::Enable), Answer::Robot(RequestAnswer::Taken));
        let held = |vx, vy, w| StickWish::Held { twist: Twist2::new(vx, vy, w), frame: Frame::Body };
        hands.stick(1.0, 3.0, Client::Joystick, held(0.4, 0.0, 0.0));
        hands.stick(3.0, 5.0, Client::Joystick, held(0.1, 0.3, 0.3));
        hands.send(5.0, Client::Joystick, Ask::Stick(StickWish::Released));
        let ends = seen_by_all.clone();
        hands.at(6.0, move |live, _| {
            let limits = crate::hands::plan().limits;
            let trace = live.trace_since(0.9);
            let path = taught(&trace, Sampling::Period { period_s: 0.05 }, 0.001, &limits).unwrap();
            let points = path.reference.points.as_ref().unwrap();
            let [start, end] =
                [points[0], points[points.len() - 1]].map(|[_, x, y, turn]| Pose2::new(x, y, turn));
            ends.lock().unwrap().taught = vec![start, end];
            let made = reference(&path.reference);
            live.load(BY, path.reference, made).unwrap();
            live.send(BY, Ask::Robot(RequestKind::GoTo { odom_from_body: start })).unwrap();
        });
        hands.ask(13.5, BY, Ask::Robot(RequestKind::Track), Answer::Robot(RequestAnswer::Taken));
    });
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
    let Kept { taught, places, steps_m, .. } = &*kept.lock().unwrap();
    let meant = [taught[1], taught[0], taught[1]];
    let off: Vec<_> = places.iter().zip(meant).map(|(place, meant)| near(*place, meant)).collect();
    println!("steps {steps_m:?} m; off {off:?}");
    let [map_m, odom_m] = *steps_m;
    assert!(map_m > 5e-3, "map jumped: {map_m} m");
    assert!(odom_m < 1e-3, "odom never does: {odom_m} m");
    assert!(taught[0].distance_m(taught[1]) > 0.5, "it was led");
    for (what, (off_m, off_rad)) in ["what was taught", "go_to", "the repeat"].into_iter().zip(off) {
        assert!(off_m < NEAR_M && off_rad < 3e-3, "{what} ended {off_m} m and {off_rad} rad off");
    }
}
