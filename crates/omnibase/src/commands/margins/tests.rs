//! Whose margins are shown: the laws are those of the registry, built in or a user's own.

use clap::Parser;
use omnibase_robot::controllers::{AdaptiveTorque, DisturbanceObserver};
use omnibase_robot::registry::{Kind, Made};
use omnibase_robot::signals::{Commands, CycleTime, PlatformState, Quantity, Setpoint};
use omnibase_robot::stages::Controller;
use omnibase_robot::torque_loop::TorqueDesign;
use omnibase_robot::{Registry, RobotPlan};

use super::{Arguments, run};

/// A user's own law of torque, with a design or without one.
struct Own(Option<TorqueDesign>);

impl Controller for Own {
    fn quantity(&self) -> Quantity {
        Quantity::Torque
    }
    fn update(&mut self, _: &CycleTime, _: &PlatformState, _: &Setpoint) -> Commands {
        Commands { quantity: Quantity::Torque, ..Commands::default() }
    }
    fn design(&self) -> Option<&TorqueDesign> {
        self.0.as_ref()
    }
}

fn with(name: &'static str, make: impl Fn(&RobotPlan) -> Made<Own> + Send + Sync + 'static) -> Registry {
    let mut registry = Registry::with_built_in();
    registry.controllers.add(Kind { name, meaning: "For a test", keys: Vec::new() }, make);
    registry
}

fn softer(plan: &RobotPlan) -> Made<Own> {
    let mut design = AdaptiveTorque::new(plan)?.design().cloned().expect("a law of torque has one");
    design.gains.iter_mut().for_each(|gains| gains.kp_1_s *= 0.5);
    Ok(Own(Some(design)))
}

fn shown(registry: &Registry, kind: &str) -> String {
    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
    let set = format!("controller.kind={kind}");
    let line = Line::parse_from(["margins", file, "--set", &set]);
    let mut output = Vec::new();
    run(&line.arguments, registry, &mut output).expect("margins");
    String::from_utf8(output).expect("text")
}

/// The Kp along x of what is shown, 1/s.
fn kp_1_s(shown: &str) -> f64 {
    let (_, rest) = shown.split_once("Kp = ").expect("a Kp");
    rest.split_whitespace().next().and_then(|number| number.parse().ok()).expect("a number")
}

#[test]
fn the_files_law_is_shown_with_its_own_gains_also_a_users() {
    let built_in = Registry::with_built_in();
    let integral = shown(&built_in, "adaptive_torque");
    assert!(integral.contains("gains of adaptive_torque with their margins\n"), "{integral}");
    let observer = shown(&built_in, "disturbance_observer");
    assert!(observer.contains("gains of disturbance_observer with their margins\n"), "{observer}");
    assert!(observer.contains(", observer ") && !integral.contains(", observer "), "{observer}");
    let own = shown(&with("softer", softer), "softer");
    assert!(own.contains("gains of softer with their margins\n"), "{own}");
    assert_eq!(kp_1_s(&own), 0.5 * kp_1_s(&integral));
}

#[test]
fn where_the_files_law_has_no_such_gains_the_first_registered_law_that_has_is_shown() {
    let other = " (no law of the file has such gains)\n";
    for (registry, kind) in
        [(Registry::with_built_in(), "closed_loop_speed"), (with("own", |_| Ok(Own(None))), "own")]
    {
        let text = shown(&registry, kind);
        assert!(
            text.contains(&format!("gains of adaptive_torque with their margins{other}")),
            "{kind}: {text}"
        );
    }
    // In the place of a built-in one: what it has counts, not its name.
    let text = shown(&with("adaptive_torque", |_| Ok(Own(None))), "closed_loop_speed");
    assert!(text.contains(&format!("gains of disturbance_observer with their margins{other}")), "{text}");
    let swapped = with("adaptive_torque", |plan| Ok(Own(DisturbanceObserver::new(plan)?.design().cloned())));
    let text = shown(&swapped, "adaptive_torque");
    assert!(text.contains("gains of adaptive_torque with") && text.contains(", observer "), "{text}");
}
