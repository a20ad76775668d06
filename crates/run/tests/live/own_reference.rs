//! A motion that a user registered: loaded while the robot runs, followed, and computed again to the bit.

use crate::hands::{BMM, Hands, plan, played_with};
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::RequestKind;
use omnibase_robot::config::Source;
use omnibase_robot::registry::{Kind, Registry, needed};
use omnibase_robot::signals::{Phase, ReferenceStatus, Setpoint};
use omnibase_robot::stages::Reference;
use omnibase_run::live::{Ask, Client};
use omnibase_run::replay::ReplayError;
use omnibase_run::{RobotText, replay};

/// To the left and back within four seconds: y = left · sin⁴(π·t/4).
struct Sway {
    left_m: f64,
    from: Pose2,
}

const TIME_S: f64 = 4.0;

impl Reference for Sway {
    fn start(&mut self, from: &Setpoint) {
        self.from = from.odom_from_body;
    }

    fn sample(&mut self, since_start_s: f64) -> Setpoint {
        let w = std::f64::consts::PI / TIME_S;
        let (sin, cos) = (w * since_start_s.min(TIME_S)).sin_cos();
        let y_m = self.from.y_m + self.left_m * sin.powi(4);
        Setpoint {
            twist_in_odom: Twist2::new(0.0, self.left_m * w * 4.0 * sin.powi(3) * cos, 0.0),
            status: if since_start_s < TIME_S { ReferenceStatus::Moving } else { ReferenceStatus::Finished },
            ..Setpoint::at_rest(Pose2 { y_m, ..self.from })
        }
    }

    fn duration_s(&self) -> Option<f64> {
        Some(TIME_S)
    }
}

fn registry() -> Registry {
    let mut registry = Registry::with_built_in();
    let keys = vec![needed("left_m").number("How far to the left, m", 0.0..=0.5)];
    registry.references.add(Kind { name: "sway", meaning: "To the left and back", keys }, |table, _| {
        Ok(Sway { left_m: table.custom.number("left_m")?, from: Pose2::default() })
    });
    registry
}

#[test]
fn a_users_motion_is_loaded_followed_and_replayed_to_the_bit_and_never_becomes_a_hold() {
    let robot = RobotText { text: BMM.into(), ..RobotText::default() };
    let page = Client::Page(0);
    let run = played_with(&registry(), robot, 9.0, |hands: &mut Hands| {
        hands.alive(0.4, 9.0, page);
        hands.send(0.5, page, Ask::Robot(RequestKind::Enable));
        hands.at(1.5, move |live, _| {
            let source = Source::read_reference("kind = \"sway\"\ncustom.left_m = 0.4", "sway.toml");
            let checked = plan().check_reference(source, &registry(), &|_| Err(String::new()));
            let (table, made) = checked.unwrap();
            live.load(page, table, made).unwrap();
            live.send(page, Ask::Robot(RequestKind::Track)).unwrap();
        });
        hands.at(3.6, |_, seen| {
            assert_eq!((seen.phase, seen.reference), (Phase::Tracking, 1));
            let y_m = seen.record.state.odom_from_body.y_m;
            assert!((y_m - 0.4).abs() < 0.01, "{y_m} m to the left at half of its time");
        });
        hands.at(8.9, |_, seen| assert_eq!(seen.phase, Phase::Holding));
    });
    assert!(run.last.record.state.odom_from_body.y_m.abs() < 2e-3);
    assert_eq!((run.replayed.difference, run.replayed.cycles > 9000), (None, true));
    // Who doesn't know the kind is told so, and computes nothing else in its place.
    let error = replay(&run.recorded, &Registry::with_built_in()).unwrap_err();
    assert!(matches!(error, ReplayError::Robot(_)), "{error}");
    let says = error.to_string();
    assert!(says.contains("reference.kind = \"sway\": nothing is registered by this name"), "{says}");
}
