//! What the control computation costs in instructions. What it is in a release stands in docs/measurements.md.

#[path = "../../../trials/tests/callgrind.rs"]
mod callgrind;

use omnibase_robot::config::FencePlan;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::{
    CycleTime, Exchange, ImageBuffer, Phase, Registry, Request, RequestKind, Robot, RobotPlan,
};

const BMM: &str = include_str!("../../../../robots/bmm.toml");
const CIRCLE: &str =
    "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nturns = 100000\nduration_s = 1000000\n";
fn running(obstacles: Option<u32>) -> impl FnMut(Option<RequestKind>) -> Phase {
    let registry = Registry::with_built_in();
    let no_files = |_: &str| Err(String::new());
    let mut plan = RobotPlan::from_toml(&format!("{BMM}{CIRCLE}"), &registry, &no_files).expect("a robot");
    if obstacles.is_some() {
        let corners_m = vec![[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
        plan.guard.fence = Some(FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 });
    }
    let mut robot = Robot::build(&plan, &registry).unwrap_or_else(|error| panic!("{error}"));
    let (mut image, period_ns, mut index) = (ImageBuffer::new(&plan), plan.bus.cycle_ns, 0);
    move |kind| {
        for (inputs, outputs) in image.inputs.iter_mut().zip(&image.outputs) {
            // The status word that follows the control word, and the mode that was asked for.
            let status = match outputs[0] & 0x0F {
                0x0F => 0x0237_u16,
                0x07 => 0x0233,
                0x06 => 0x0231,
                _ => 0x0250,
            };
            inputs[..2].copy_from_slice(&status.to_le_bytes());
            inputs[12] = outputs[14];
        }
        let time = CycleTime::on_grid(index, period_ns);
        index += 1;
        robot.compute(time, Exchange::Complete, kind.map(Request::lasting), &mut image);
        robot.phase()
    }
}

/// A cycle on a circle, in a fence of 4 m by 4 m with so many obstacles (`None`: without a fence), may cost so many instructions.
fn costs_at_most(most: u64, test: &str, obstacles: Option<u32>) {
    let test = format!("counts::{test}");
    callgrind::a_cycle_costs_at_most(most, &test, &["*Robot::compute*"], [200, 400], |cycles| {
        let mut cycle = running(obstacles);
        let mut phase = Phase::Disabled;
        for _ in 0..100 {
            phase = cycle(match phase {
                Phase::Disabled => Some(RequestKind::Enable),
                Phase::Holding => Some(RequestKind::Track),
                _ => None,
            });
        }
        for index in 0..obstacles.unwrap_or(0) {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(index) / 16.0).sin_cos();
            let obstacle =
                Obstacle { centre_m: [1.2 * cos, 1.2 * sin], radius_m: 0.02, velocity_m_s: [0.0; 2] };
            cycle(Some(RequestKind::SetObstacle { index, obstacle }));
        }
        for _ in 0..cycles {
            phase = cycle(None);
        }
        assert_eq!(phase, Phase::Tracking);
    });
}

#[test]
fn a_cycle_costs_no_more_than_it_may() {
    costs_at_most(25_000, "a_cycle_costs_no_more_than_it_may", None);
}

#[test]
fn a_cycle_in_a_fence_with_an_obstacle_costs_no_more_than_it_may() {
    costs_at_most(38_700, "a_cycle_in_a_fence_with_an_obstacle_costs_no_more_than_it_may", Some(1));
}

#[test]
fn a_cycle_among_sixteen_obstacles_costs_no_more_than_it_may() {
    costs_at_most(57_800, "a_cycle_among_sixteen_obstacles_costs_no_more_than_it_may", Some(16));
}
