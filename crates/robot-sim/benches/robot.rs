//! What simulated time costs. `cargo bench -p omnibase-robot-sim`
//!
//! One item is a millisecond of simulated time, in eight steps.

#[path = "../tests/main_device/mod.rs"]
mod main_device;

use divan::counter::ItemsCount;
use main_device::MainDevice;
use omnibase_ethercat_sim::device::drive::DriveKind;
use omnibase_robot_sim::machine::DEFAULT_STEP_NS;
use omnibase_robot_sim::{
    Body, BodyParameters, DriveStation, Floor, Machine, MachineParameters, MotorParameters, Payload,
    RobotSim, RobotSimDescription, Tread, WheelDrive, WheelParameters,
};

/// Counts allocations: none below `body` and `machine`.
#[global_allocator]
static ALLOCATOR: divan::AllocProfiler = divan::AllocProfiler::system();

fn main() {
    divan::main();
}

/// Simulated milliseconds per round.
const ROUND_MS: u64 = 1_000;

fn parameters(count: usize) -> MachineParameters {
    let wheel = |i: usize| {
        let (sin, cos) = (std::f64::consts::TAU * i as f64 / count as f64).sin_cos();
        WheelDrive {
            wheel: WheelParameters::omni([0.35 * cos, 0.35 * sin], [-sin, cos], 0.1),
            motor: MotorParameters::default(),
        }
    };
    MachineParameters {
        body: BodyParameters {
            mass_kg: 100.0,
            yaw_inertia_kg_m2: 8.0,
            center_of_mass_m: [0.01, -0.02],
            center_of_mass_height_m: 0.4,
        },
        payload: Payload::default(),
        floor: Floor::default(),
        wheels: (0..count).map(wheel).collect(),
        step_ns: DEFAULT_STEP_NS,
        wires: Vec::new(),
    }
}

fn torques(time_ms: u64) -> [f64; 4] {
    let phase = 0.006 * (time_ms % 100_000) as f64;
    [2.0 * phase.sin(), -1.5 * (0.7 * phase).cos(), 1.0 - phase.cos(), phase.sin()]
}

/// Body and wheels alone, rolling with torques that change.
#[divan::bench(args = [3, 4])]
fn body(bencher: divan::Bencher, wheels: usize) {
    let parameters = parameters(wheels);
    let mounted: Vec<WheelParameters> = parameters.wheels.iter().map(|drive| drive.wheel).collect();
    let mut body = Body::new(parameters.body, &mounted).expect("a sound machine");
    let mut time_ms = 0;
    bencher.counter(ItemsCount::new(ROUND_MS)).bench_local(move || {
        for _ in 0..ROUND_MS {
            time_ms += 1;
            let torques = torques(time_ms);
            for _ in 0..8 {
                body.step(divan::black_box(&torques[..wheels]), 125e-6);
            }
        }
        body.pose()
    });
}

/// With motors, asked by every drive once a millisecond.
#[divan::bench(args = [3, 4])]
fn machine(bencher: divan::Bencher, wheels: usize) {
    drive(bencher, &parameters(wheels));
}

/// The same on elastic treads.
#[divan::bench(args = [3, 4])]
fn machine_on_elastic_treads(bencher: divan::Bencher, wheels: usize) {
    let mut parameters = parameters(wheels);
    parameters.wheels.iter_mut().for_each(|drive| drive.wheel.contact.tread = Some(Tread::default()));
    drive(bencher, &parameters);
}

fn drive(bencher: divan::Bencher, parameters: &MachineParameters) {
    let wheels = parameters.wheels.len();
    let mut machine = Machine::new(parameters).expect("a sound machine");
    let mut time_ms = 0;
    bencher.counter(ItemsCount::new(ROUND_MS)).bench_local(move || {
        for _ in 0..ROUND_MS {
            time_ms += 1;
            let torques = torques(time_ms);
            for (i, torque) in torques.iter().enumerate().take(wheels) {
                machine.advance(time_ms * 1_000_000);
                divan::black_box(machine.shaft(i));
                machine.ask(i, *torque);
            }
        }
        machine.truth()
    });
}

/// The whole robot: frames, chips, firmware, drives in speed mode, machine; one exchange a millisecond.
#[divan::bench(args = [3, 4])]
fn robot(bencher: divan::Bencher, wheels: usize) {
    let drives = (0..wheels).map(|wheel| DriveStation::new(DriveKind::Generic, wheel)).collect();
    let description = RobotSimDescription { machine: parameters(wheels), drives };
    let robot = RobotSim::new(&description).expect("a sound robot");
    let (segment, machine) = robot.into_line().expect("a line");
    let mut main = MainDevice::bring_up(segment, 9, 1_000_000);
    let mut time_ms = 0;
    bencher.counter(ItemsCount::new(ROUND_MS)).bench_local(move || {
        for _ in 0..ROUND_MS {
            time_ms += 1;
            for (output, share) in main.outputs.iter_mut().zip(torques(time_ms)) {
                output.speed_counts_s = (share * 100_000.0) as i32;
            }
            main.cycle();
        }
        divan::black_box(&main.inputs);
        machine.truth()
    });
}
