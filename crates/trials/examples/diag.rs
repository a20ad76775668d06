use omnibase_trials::fast::{Case, MOTIONS, random_path};
use omnibase_trials::robots::{BMM, MECANUM};
use omnibase_trials::{Run, Trial, plan_of};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let robot = if a[1] == "bmm" { BMM } else { MECANUM };
    let law = if a[2] == "t" { "adaptive_torque" } else { "closed_loop_speed" };
    let motion = match a[3].parse::<u64>() {
        Ok(n) => random_path(n),
        _ => MOTIONS.iter().find(|m| m.0 == a[3]).unwrap().1.to_owned(),
    };
    let case = Case {
        robot,
        law,
        motion,
        told: a[4].parse().unwrap(),
        floor: [a[5].parse().unwrap(), a[6].parse().unwrap()],
    };
    let every: u64 = a.get(7).map_or(100, |w| w.parse().unwrap());
    let mut trial = Trial::new(plan_of(&case.text()));
    trial.enable();
    let machine = trial.machine.clone();
    let mut cycle = 0u64;
    let run = Run::track(&mut trial, &mut |r| {
        cycle += 1;
        if cycle % every == 0 {
            let m = machine.lock();
            let truth = m.body().pose();
            let _ = truth;
            let (w, s, b) = (r.wished.odom_from_body, r.setpoint.odom_from_body, r.state.odom_from_body);
            println!(
                "{:6} t {:.3} rate {:.3} lag {:7.2} mm err {:6.2} share {:.3} mass {:.1}+-{:.1} fr {:?} carried {:?} v {:.3} a {:.2} true-believed {:.2} {:.2} mm {:.2} mrad warm {:?}",
                cycle,
                r.reference_time_s,
                r.reference_rate,
                1e3 * w.distance_m(s),
                1e3 * s.distance_m(b),
                r.traction.share,
                r.grip.dynamics.mass_kg,
                r.grip.mass_sigma_kg,
                r.grip.friction,
                r.traction.friction,
                r.setpoint.twist_in_odom.speed_m_s(),
                r.setpoint.acceleration_in_odom.speed_m_s(),
                1e3 * (truth.x_m - b.x_m),
                1e3 * (truth.y_m - b.y_m),
                1e3 * (truth.heading_rad - b.heading_rad),
                r.traction.factor
            );
        }
    });
    println!("{run:?}");
}
