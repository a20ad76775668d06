//! What the control computation of one cycle costs, from the drives' bytes to the drives' bytes.
//!
//! `cargo bench -p omnibase-robot`: time per cycle, and allocations per cycle (none) where there are any.

use divan::{AllocProfiler, Bencher, black_box};
use omnibase_robot::config::{FencePlan, TaskFrame};
use omnibase_robot::guard::{MAX_OBSTACLES, Obstacle};
use omnibase_robot::signals::{Heard, MAX_SOURCE_VALUES};
use omnibase_robot::{
    CycleRecord, CycleTime, Exchange, ImageBuffer, Phase, Registry, Request, RequestKind, Robot, RobotPlan,
};

#[global_allocator]
static ALLOCATOR: AllocProfiler = AllocProfiler::system();

const CIRCLE: &str =
    "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nturns = 100000\nduration_s = 1000000\n";

fn main() {
    divan::main();
}

fn plan(robot: &str, controller: &str) -> RobotPlan {
    let text = robot.replace("closed_loop_speed", controller) + CIRCLE;
    RobotPlan::from_toml(&text, &Registry::with_built_in(), &|_| Err(String::new()))
        .expect("the shipped robot")
}

/// A robot under way, its drives in operation and obedient.
struct Running {
    robot: Robot,
    image: ImageBuffer,
    index: u64,
    period_ns: u64,
}

impl Running {
    fn new(plan: &RobotPlan) -> Running {
        let robot = Robot::build(plan, &Registry::with_built_in()).expect("the shipped robot");
        let mut running =
            Running { robot, image: ImageBuffer::new(plan), index: 0, period_ns: plan.bus.cycle_ns };
        for _ in 0..100 {
            let request = match running.robot.phase() {
                Phase::Disabled => Some(RequestKind::Enable),
                Phase::Holding => Some(RequestKind::Track),
                _ => None,
            };
            running.cycle(request.map(Request::lasting));
        }
        assert_eq!(running.robot.phase(), Phase::Tracking);
        running
    }

    fn cycle(&mut self, request: Option<Request>) -> &CycleRecord {
        for (inputs, outputs) in self.image.inputs.iter_mut().zip(&self.image.outputs) {
            // The status word that follows the control word, and the mode that was asked for.
            let status = match outputs[0] & 0x0F {
                0x0F => 0x0237_u16,
                0x07 => 0x0233,
                0x06 => 0x0231,
                _ => 0x0250,
            };
            inputs[..2].copy_from_slice(&status.to_le_bytes());
            match outputs.len() {
                20 => inputs[12] = outputs[14],
                _ => inputs[2] = outputs[2],
            }
        }
        let time = CycleTime::on_grid(self.index, self.period_ns);
        self.index += 1;
        self.robot.compute(time, Exchange::Complete, request, &mut self.image)
    }
}

const BMM: &str = include_str!("../../../robots/bmm.toml");
const MECANUM: &str = include_str!("../../../robots/mecanum.toml");

#[divan::bench(args = ["open_loop", "closed_loop_speed", "adaptive_torque"])]
fn three_wheels(bencher: Bencher<'_, '_>, controller: &str) {
    let mut running = Running::new(&plan(BMM, controller));
    bencher.bench_local(|| black_box(running.cycle(None).allowed.commands.values[0]));
}

#[divan::bench]
fn four_wheels(bencher: Bencher<'_, '_>) {
    let mut running = Running::new(&plan(MECANUM, "closed_loop_speed"));
    bencher.bench_local(|| black_box(running.cycle(None).allowed.commands.values[0]));
}

/// All that is known of grip at once, under way: the law of torque on treads that the file tells, a floor that holds the platform back,
/// and a gyro. The wheels turn as the set point asks.
#[divan::bench]
fn all_of_grip(bencher: Bencher<'_, '_>) {
    let treads = "tread_stiffness_n_m = [1e6, 4e6]\ntread_damping_ratio = 0.3\n";
    let text = BMM.replace("closed_loop_speed", "adaptive_torque");
    let text = text.replace("[controller]\n", &format!("[controller]\n{treads}"));
    let circle = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nturns = 10\nduration_s = 100\n[grip]\nfriction = 0.2\n";
    let gyro = "[[source]]\nname = \"gyro\"\n[[source.input]]\nname = \"turn\"\n[safety]\ngyro_input = \"gyro.turn\"\n";
    let plan = RobotPlan::from_toml(&format!("{text}{circle}{gyro}"), &Registry::with_built_in(), &|_| {
        Err(String::new())
    })
    .expect("a robot with all of it");
    let mut running = Running::new(&plan);
    let mut turned_rad = [0.0; 3];
    let period_s = running.period_ns as f64 * 1e-9;
    let counts_per_rad = plan.drives[0].scale.counts_per_revolution as f64 / std::f64::consts::TAU;
    let mut cycle = move || {
        let set = running.robot.record().setpoint;
        let in_body = set.twist_in_odom.rotated(-set.odom_from_body.heading_rad);
        let speeds_rad_s = plan.kinematics.wheel_speeds_rad_s(in_body);
        for (wheel, turned_rad) in turned_rad.iter_mut().enumerate() {
            *turned_rad += period_s * speeds_rad_s[wheel];
            // Object 6064 of an SGDV's map.
            let counts = (*turned_rad * counts_per_rad) as i32;
            running.image.inputs[wheel][2..6].copy_from_slice(&counts.to_le_bytes());
        }
        let mut heard = Heard { instant_ns: running.index * running.period_ns, ..Heard::NOTHING };
        heard.values[0] = in_body.w_rad_s;
        running.robot.hear(0, &heard);
        let record = running.cycle(None);
        (record.phase, record.traction.share, record.allowed.commands.values[0])
    };
    let under_way = (0..5000).map(|_| cycle()).last();
    assert!(matches!(under_way, Some((Phase::Tracking, share, _)) if share < 1.0), "{under_way:?}");
    bencher.bench_local(|| black_box(cycle()));
}

/// Gyro in each cycle, two mice at 125 Hz, poses at 100 Hz, late by so many milliseconds: what came in between is computed
/// again.
#[divan::bench(args = [0, 20, 1000], sample_size = 1000)]
fn sensors(bencher: Bencher<'_, '_>, late_ms: u64) {
    let mut text = format!("{BMM}\n[estimator]\nkind = \"fused\"\n");
    for (name, inputs) in [("imu", "{ name = \"turn\" }"), ("left", XY), ("right", XY)] {
        text += &format!("[[source]]\nname = \"{name}\"\ninput = [{inputs}]\n");
    }
    text += "[[source]]\nname = \"tracker\"\ncarries = \"pose\"\nmax_age_ms = 2000\n";
    for (name, kind, from) in [
        ("gyro", "gyro", "imu.turn"),
        ("left", "flow", "left"),
        ("right", "flow", "right"),
        ("mocap", "pose", "tracker"),
    ] {
        text += &format!("[[sensor]]\nname = \"{name}\"\nkind = \"{kind}\"\nfrom = \"{from}\"\n");
    }
    let mut plan = plan(&text, "closed_loop_speed");
    plan.estimator.unknown_sigma_m = Some(10.0);
    plan.estimator.task_frame = Some(TaskFrame::Odom);
    let mut running = Running::new(&plan);
    let mut cycle = move || {
        let now_ns = running.index * running.period_ns;
        let mut hear = |source: usize, instant_ns: u64| {
            // Never twice the same, and at rest all the time.
            let value = 1e-6 * (running.index % 3) as f64;
            running.robot.hear(source, &Heard { instant_ns, values: [value; MAX_SOURCE_VALUES] });
        };
        hear(0, now_ns);
        if now_ns.is_multiple_of(8_000_000) {
            hear(1, now_ns);
            hear(2, now_ns);
        }
        if now_ns.is_multiple_of(10_000_000) {
            hear(3, now_ns.saturating_sub(late_ms * 1_000_000));
        }
        running.cycle(None).allowed.commands.values[0]
    };
    for _ in 0..5000 {
        black_box(cycle());
    }
    bencher.bench_local(|| black_box(cycle()));
}

const XY: &str = "{ name = \"x\" }, { name = \"y\" }";

/// So many named values of another program, all of them new in each cycle.
#[divan::bench(args = [0, 32])]
fn inputs_of_a_program(bencher: Bencher<'_, '_>, count: usize) {
    let mut text = String::from(BMM);
    if count > 0 {
        text += "\n[[source]]\nname = \"program\"\n";
        text.extend((0..count).map(|number| format!("[[source.input]]\nname = \"value_{number}\"\n")));
    }
    let mut running = Running::new(&plan(&text, "closed_loop_speed"));
    bencher.bench_local(|| {
        let instant_ns = running.index * running.period_ns;
        running.robot.hear(0, &Heard { instant_ns, values: [0.5; MAX_SOURCE_VALUES] });
        black_box(running.cycle(None).allowed.commands.values[0])
    });
}

/// So many obstacles all around, so far from the footprint's furthest corner, in a fence of 4 m by 4 m.
#[divan::bench(args = [(0, 0.6), (1, 0.6), (4, 0.6), (8, 0.6), (16, 0.6), (16, 0.05)])]
fn in_a_fence(bencher: Bencher<'_, '_>, (count, distance_m): (u32, f64)) {
    let mut plan = plan(BMM, "closed_loop_speed");
    let radius_m = plan.guard.footprint_m.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
    let corners_m = vec![[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
    plan.guard.fence = Some(FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 });
    let mut running = Running::new(&plan);
    // Under way already: nothing begins where an obstacle is nearer than it should be.
    for index in 0..count {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(index) / MAX_OBSTACLES as f64).sin_cos();
        let away_m = radius_m + 0.02 + distance_m;
        let obstacle =
            Obstacle { centre_m: [away_m * cos, away_m * sin], radius_m: 0.02, velocity_m_s: [1e-9; 2] };
        running.cycle(Some(Request::lasting(RequestKind::SetObstacle { index, obstacle })));
    }
    bencher.bench_local(|| black_box(running.cycle(None).allowed.commands.values[0]));
}

/// A record's values into a buffer, as the recorder's thread does it.
#[divan::bench]
fn record_to_values(bencher: Bencher<'_, '_>) {
    let mut running = Running::new(&plan(BMM, "adaptive_torque"));
    let record = *running.cycle(None);
    let mut values = Vec::new();
    record.values(&mut values);
    bencher.bench_local(|| record.values(black_box(&mut values)));
}
