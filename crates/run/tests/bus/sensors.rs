//! Sensors whose values stand in the process data of a SubDevice: the simulated one measures as it would.

use omnibase_fusion::Verdict;
use omnibase_robot::{Registry, RobotPlan};
use omnibase_run::stepped::{Leader, Stepped};

use crate::bench::plan;

/// A gyro and a laser tracker of no noise on the bus, the one in each cycle, the other in each `every`-th; a circle within 8 s.
fn on_the_bus(every: u16, more: &str) -> RobotPlan {
    plan(&format!(
        "[estimator]\nkind = \"fused\"\n\
         [reference]\nkind = \"circle\"\nradius_m = 0.5\nturns = 1.0\nduration_s = 8.0\n\
         [[device]]\nname = \"imu\"\nposition = 3\nkind = \"io\"\n\
         inputs = [{{ pdo = \"0x1A00\", map = \"6000.1:16\" }}]\n\
         input = [{{ name = \"turn\", object = \"6000.1\", type = \"i16\", scale = 1e-4, unit = \"rad/s\" }}]\n\
         [[device]]\nname = \"tracker\"\nposition = 4\nkind = \"io\"\nevery = {every}\n{more}\
         inputs = [{{ pdo = \"0x1A00\", map = \"6000.1:32 6000.2:32 6000.3:32\" }}]\n\
         input = [{{ name = \"x\", object = \"6000.1\", type = \"i32\", scale = 1e-6, unit = \"m\" }}, \
                  {{ name = \"y\", object = \"6000.2\", type = \"i32\", scale = 1e-6, unit = \"m\" }}, \
                  {{ name = \"heading\", object = \"6000.3\", type = \"f32\", unit = \"rad\" }}]\n\
         [[sensor]]\nname = \"gyro\"\nkind = \"gyro\"\nfrom = \"imu.turn\"\nsigma_rad_s = 0.002\nheading_rad = 1.0\n\
         [[sensor]]\nname = \"place\"\nkind = \"pose\"\nfrom = \"tracker\"\nposition_m = [0.1, -0.05]\ndelay_ms = 8\n\
         sigma_m = 1e-4\nsigma_rad = 2e-4\n\
         [[simulation.sensor]]\nname = \"gyro\"\nbias_rad_s = 0.01\n\
         [[simulation.sensor]]\nname = \"place\"\nnoise = 0.0\nturn_noise = 0.0\n"
    ))
}

#[test]
fn what_a_subdevice_measures_counts_from_when_it_measured() {
    // A terminal that follows its inputs; firmware that is roused by frames, then by its clock, each time and each fourth time.
    let firmware = "parameters = [{ object = \"8000.1\", type = \"u8\", value = 1 }]\n";
    let clock = format!("{firmware}dc = {{ sync0_shift_us = 200 }}\n");
    for (every, more, bound_m) in [(1, "", 5e-4), (1, firmware, 5e-4), (1, &clock, 1e-4), (4, &clock, 1e-4)] {
        let plan = on_the_bus(every, more);
        let mut robot = Stepped::begin(plan, &Registry::with_built_in(), Leader::Plan, &mut |_| {}).unwrap();
        let (mut greatest_m, mut fastest_m_s, mut biased) = (0.0_f64, 0.0_f64, false);
        while !robot.is_over() {
            let record = *robot.step(None).unwrap();
            let truth = robot.truth();
            let [gyro, place, ..] = record.fusion.sensors;
            if record.state.twist_in_body.vx_m_s.hypot(record.state.twist_in_body.vy_m_s) > 0.2 {
                assert_eq!([gyro.verdict, place.verdict], [Verdict::Good; 2], "every {every} {more}");
                greatest_m = greatest_m.max(record.fusion.map_from_body.distance_m(truth.odom_from_body));
            }
            fastest_m_s = fastest_m_s.max(truth.twist_in_body.vx_m_s.hypot(truth.twist_in_body.vy_m_s));
            biased |= (record.signals.inputs[0] - 0.01).abs() < 3e-3;
        }
        assert!(robot.has_finished() && biased);
        // A millisecond of the instant is 0.7 mm of the place; of those without a clock half a cycle isn't known.
        assert!(fastest_m_s > 0.7, "{fastest_m_s} m/s");
        assert!(greatest_m < bound_m, "{greatest_m} m, every {every} {more}");
    }
}
