use omnibase_robot::{Phase, RequestKind};
use omnibase_trials::sensed::*;
fn main() {
    let n: Vec<usize> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let case = Case { set: n[0], floor: n[1], path: n[2] };
    let mut trial = make(&case, 1);
    trial.run(30000);
    trial.enable();
    trial.step(Some(RequestKind::Track));
    let mut k = 0;
    while trial.robot.phase() == Phase::Tracking {
        let r = *trial.step(None);
        k += 1;
        if k % n[3] as u64 == 0 {
            let t = trial.measured_pose();
            let b = r.state.odom_from_body;
            println!(
                "{:.3} true {:.3} {:.3} {:.3} off {:.1} mm {:.1} mrad sigma {:.2} mm {:.2} mrad twist {:.2} {:.2} {:.2} slip {:?} {:?}",
                k as f64 * 1e-3,
                t.x_m,
                t.y_m,
                t.heading_rad,
                1e3 * t.distance_m(b),
                1e3 * (t.heading_rad - b.heading_rad),
                1e3 * r.state.covariance[0].sqrt(),
                1e3 * r.state.covariance[5].sqrt(),
                r.state.twist_in_body.vx_m_s,
                r.state.twist_in_body.vy_m_s,
                r.state.twist_in_body.w_rad_s,
                &r.grip.slipped_m[..3],
                r.fusion.sensors[..4]
                    .iter()
                    .map(|s| format!("{:?} {:.1}", s.verdict, s.nis))
                    .collect::<Vec<_>>()
            );
        }
        if k > 60500 {
            break;
        }
    }
    for j in 0..2500 {
        let r = *trial.step(None);
        if j % 100 == 0 || j < 10 {
            let t = trial.measured_pose();
            let b = r.state.odom_from_body;
            let m = r.fusion.map_from_body;
            let w = r.setpoint.odom_from_body;
            println!(
                "{j} {:?} true-wished {:.2} {:.2} true-odom {:.2} {:.2} true-map {:.2} {:.2} wished {:?}",
                r.phase,
                1e3 * (t.x_m - w.x_m),
                1e3 * (t.y_m - w.y_m),
                1e3 * (t.x_m - b.x_m),
                1e3 * (t.y_m - b.y_m),
                1e3 * (t.x_m - m.x_m),
                1e3 * (t.y_m - m.y_m),
                r.wished.status
            );
        }
    }
    println!("{:?} {:?} {}", trial.robot.record().stop_reason, trial.robot.phase(), k);
}
