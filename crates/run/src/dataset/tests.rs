use super::*;
use crate::channels::{CycleExtras, Known, Rows};
use omnibase_robot::Registry;
use omnibase_robot::signals::{CycleRecord, CycleTime};

fn plan() -> RobotPlan {
    let text = format!(
        "{}\n[[source]]\nname = \"mocap\"\ncarries = \"pose\"\n\n[[source]]\nname = \"gyro\"\ninput = [{{ name = \"turn\", unit = \"rad/s\" }}]\n",
        include_str!("../../../../robots/bmm.toml")
    );
    let no_files = |name: &str| Err(name.to_owned());
    RobotPlan::from_toml(&text, &Registry::with_built_in(), &no_files).unwrap()
}

/// A hundred cycles in which each wheel turns by 1, 2 and 3 mrad; a pose comes in each tenth, a turn in each fifth.
fn recorded(plan: &RobotPlan, change: impl Fn(u64, &mut CycleRecord)) -> RecordedRun {
    let layout = plan.record_layout();
    let mut rows = Rows::new(&layout, Known::BeliefAlone);
    let mut run = RecordedRun { schema: rows.schema().clone(), ..RecordedRun::default() };
    for index in 0..100 {
        let mut cycle = CycleRecord { exchange: Exchange::Complete, ..CycleRecord::default() };
        cycle.time = CycleTime::on_grid(index, plan.bus.cycle_ns);
        cycle.measurements.wheels = 3;
        cycle.signals.shape = layout.signals.shape();
        for wheel in 0..3 {
            cycle.measurements.drives[wheel].increment_rad = 1e-3 * (wheel + 1) as f64;
        }
        cycle.signals.heard = u64::from(index % 10 == 0) | u64::from(index % 5 == 0) << 1;
        let heard_ns = [index / 10 * 10, index / 5 * 5].map(|index| index * plan.bus.cycle_ns);
        for (place, heard_ns) in heard_ns.into_iter().enumerate() {
            cycle.signals.instants_ns[place] = heard_ns.saturating_sub(300_000);
        }
        let x_m = 1e-3 * index as f64;
        let pose = [x_m, -2.0, 0.5, 1e-6, 0.0, 0.0, 4e-6, 0.0, 9e-6];
        cycle.signals.inputs[..9].copy_from_slice(&pose);
        cycle.signals.inputs[9] = 0.25;
        change(index, &mut cycle);
        run.times_ns.push(cycle.time.now_ns);
        run.values.extend(rows.of(&cycle, &CycleExtras::default()));
    }
    run
}

fn by_source() -> Witnesses {
    Witnesses {
        poses: Some(PosesFrom::Source { name: "mocap".to_owned(), sigma: [0.0; 2] }),
        gyro: Some(GyroFrom::Input("gyro.turn".to_owned())),
        seed: 0,
    }
}

#[test]
fn wheels_poses_and_turns_come_with_their_own_instants() {
    let plan = plan();
    // Of a lost exchange nothing is counted: its increment is that of an earlier one.
    let lost = |index: u64, cycle: &mut CycleRecord| {
        if index == 50 {
            cycle.exchange = Exchange::Lost;
        }
    };
    let run = run_of(&recorded(&plan, lost), &plan, "run", &by_source()).unwrap();
    assert_eq!((run.steps.len(), run.poses.len(), run.turns.len()), (98, 10, 20));
    // Encoders were read half a cycle before.
    assert!((run.begin_s + 0.5e-3).abs() < 1e-12 && (run.end_s() - 98.5e-3).abs() < 1e-12);
    assert_eq!(run.steps[7].turned_rad[..], [1e-3, 2e-3, 3e-3]);
    let pose = run.poses[3];
    assert!((pose.instant_s - 29.7e-3).abs() < 1e-12, "{pose:?}");
    assert_eq!((pose.world_from_sensor.x_m, pose.world_from_sensor.heading_rad), (0.03, 0.5));
    assert!((pose.sigma_m - 2.5e-6_f64.sqrt()).abs() < 1e-12 && (pose.sigma_rad - 3e-3).abs() < 1e-12);
    assert_eq!(run.turns[1].rate_rad_s, 0.25);
}

#[test]
fn a_sensors_own_noise_is_added_to_covariances_and_does_without_them() {
    let plan = plan();
    let sigma = |change: &dyn Fn(u64, &mut CycleRecord)| {
        let poses = Some(PosesFrom::Source { name: "mocap".to_owned(), sigma: [2e-3, 4e-3] });
        let witnesses = Witnesses { poses, ..Witnesses::default() };
        let run = run_of(&recorded(&plan, change), &plan, "run", &witnesses).unwrap();
        [run.poses[3].sigma_m, run.poses[3].sigma_rad]
    };
    // As motion capture tells them that says nothing of how well it knows.
    let untold = sigma(&|_, cycle| cycle.signals.inputs[3..9].fill(0.0));
    assert!((untold[0] - 2e-3).abs() < 1e-12 && (untold[1] - 4e-3).abs() < 1e-12, "{untold:?}");
    let told = sigma(&|_, _| {});
    assert!((told[0] - 6.5e-6_f64.sqrt()).abs() < 1e-12 && (told[1] - 5e-3).abs() < 1e-12, "{told:?}");
}

#[test]
fn what_a_recording_lacks_is_told() {
    let plan = plan();
    let words = |change: &dyn Fn(u64, &mut CycleRecord), witnesses: &Witnesses| {
        run_of(&recorded(&plan, change), &plan, "run", witnesses).unwrap_err().to_string()
    };
    let same = |_: u64, _: &mut CycleRecord| {};
    let gap = |index: u64, cycle: &mut CycleRecord| {
        if index >= 60 {
            cycle.time = CycleTime::on_grid(index + 3, cycle.time.period_ns);
        }
    };
    let silent = |_: u64, cycle: &mut CycleRecord| cycle.signals.heard = 0;
    let certain = |_: u64, cycle: &mut CycleRecord| cycle.signals.inputs[6] = 0.0;
    let poses = |name: &str| {
        let from = PosesFrom::Source { name: name.to_owned(), sigma: [0.0; 2] };
        Witnesses { poses: Some(from), ..Witnesses::default() }
    };
    let simulator =
        Witnesses { poses: Some(PosesFrom::Simulator(PoseSensor::default())), ..Witnesses::default() };
    let gyro = Witnesses { gyro: Some(GyroFrom::Input("gyro.rate".to_owned())), ..Witnesses::default() };
    for (found, expected) in [
        (
            words(&gap, &by_source()),
            "the recording lacks cycles before 63: what the wheels turned in them isn't known",
        ),
        (words(&silent, &by_source()), "`mocap` said nothing in this run"),
        (
            words(&certain, &by_source()),
            "`mocap`, 0.000 s: covariance_yy is 0, expected a variance above 0, or a `[[sensor]]` of these poses: it says how far a pose is believed",
        ),
        (
            words(&same, &poses("gyro")),
            "`gyro`: expected a `[[source]]` with carries = \"pose\", found one that carries something else",
        ),
        (
            words(&same, &poses("camera")),
            "`camera`: expected a `[[source]]` with carries = \"pose\", found mocap, gyro",
        ),
        (
            words(&same, &simulator),
            "the recording has no `truth.pose_x_m`: only simulated runs know the truth",
        ),
        (
            words(&same, &gyro),
            "`gyro.rate`: expected an input of a `[[source]]` or a SubDevice, as gyro.turn; the robot's file has mocap.x, ",
        ),
    ] {
        assert!(found.starts_with(expected), "{found}");
    }
}
