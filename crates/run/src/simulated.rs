//! The simulated robot of a plan: what the file says, and the simulator's documented figures for the rest.

use std::ops::RangeInclusive;

use omnibase_ethercat_sim::device::drive::{DriveKind, SGDV_PRODUCT, SGDV_VENDOR};
use omnibase_ethercat_sim::device::panel::IoPanel;
use omnibase_ethercat_sim::device::servo::Encoder;
use omnibase_ethercat_sim::{Segment, SubDevice};
use omnibase_platform::Wheel;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{
    BusPlace, DrivePlan, EncoderName, Identity, PatchTable, SLIDING_SHARE, SimulationTable, TurnDirection,
};

mod axis;
mod beside;
mod script;
mod sensors;

pub use script::Script;
pub use sensors::Sensors;

use omnibase_robot_sim::machine::DEFAULT_STEP_NS;
use omnibase_robot_sim::{
    BodyParameters, Contact, DriveStation, Floor, MachineParameters, MotorParameters, Patch, Payload, Region,
    RobotSim, RobotSimDescription, SharedMachine, SharedSlide, Slope, Surface, Tread, Waves, WheelDrive,
    WheelParameters, Wire,
};

/// Mass of a platform whose file gives none, kg: that of the BMM without batteries (thesis, chapter 1).
const MASS_KG: f64 = 70.0;
/// Height of a platform's centre of mass whose file gives none, m: batteries and drives lie low.
const CENTRE_HEIGHT_M: f64 = 0.25;
/// Height of a payload's centre of mass whose file gives none, m: it stands on the platform.
const PAYLOAD_HEIGHT_M: f64 = 0.6;

/// Cogging of a motor of 24 slots and 18 poles: their least common multiple.
const COGGING_PER_TURN: u32 = 72;
/// Ripple of a motor of 8 pole pairs: six times in an electrical turn.
const RIPPLE_PER_TURN: u32 = 48;

/// A plan whose robot can't be simulated, in words.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the simulated robot: {0}")]
pub struct SimulationError(pub String);

/// The simulated robot of a plan on a bus of its own, and the truth behind it.
pub fn segment(plan: &RobotPlan) -> Result<(Segment, SharedMachine), SimulationError> {
    robot(plan).map(|robot| (robot.segment, robot.machine))
}

/// A simulated robot on a bus of its own.
pub struct Simulated {
    /// The bus.
    pub segment: Segment,
    /// The truth behind it.
    pub machine: SharedMachine,
    /// The terminals of the SubDevices without a wheel, in the order of the robot's file: inputs to set, outputs to look
    /// at. That of an axis has none.
    pub panels: Vec<IoPanel>,
    /// The axes, in the order of the robot's file.
    pub axes: Vec<SharedSlide>,
}

/// As [`segment`], with a hand on the terminals.
pub fn robot(plan: &RobotPlan) -> Result<Simulated, SimulationError> {
    let in_words = |error: &dyn std::fmt::Display| SimulationError(error.to_string());
    let RobotSim { sub_devices, machine } =
        RobotSim::new(&description(plan)).map_err(|error| in_words(&error))?;
    let (mut panels, mut axes, mut beside) = (Vec::new(), Vec::new(), Vec::new());
    for (number, device) in plan.devices.iter().enumerate() {
        if let Some(axis) = &device.axis {
            let (sub_device, slide) = axis::drive(device, axis, number);
            beside.push(Some(sub_device));
            axes.push(slide);
            panels.push(IoPanel::default());
            continue;
        }
        let generic = beside::terminal(device, number).map_err(|error| in_words(&error))?;
        if let Some(mut told) = sensors::Told::new(plan, number, &machine) {
            generic.panel.feed(Box::new(move |panel, now| told.measure(panel, now)));
        }
        panels.push(generic.panel);
        beside.push(Some(generic.sub_device));
    }
    // The drives come in the order in which they stand there.
    let mut drives = sub_devices.into_iter();
    let of = |member| match member {
        Member::Wheel(_) => drives.next(),
        Member::Beside(number) => beside[number].take(),
    };
    let line: Vec<SubDevice> = line(plan).into_iter().filter_map(of).collect();
    let segment = Segment::line(line).map_err(|error| in_words(&error))?;
    Ok(Simulated { segment, machine, panels, axes })
}

/// What a plan says about its simulated robot.
pub fn description(plan: &RobotPlan) -> RobotSimDescription {
    let table = &plan.simulation;
    let wheels = plan.kinematics.wheels();
    let mass_kg = table.mass_kg.unwrap_or(MASS_KG);
    let drives = wheels.iter().zip(&plan.drives).enumerate();
    RobotSimDescription {
        machine: MachineParameters {
            body: BodyParameters {
                mass_kg,
                yaw_inertia_kg_m2: table.inertia_kg_m2.unwrap_or_else(|| disc_kg_m2(mass_kg, wheels)),
                center_of_mass_m: table.centre_of_mass_m.unwrap_or_default(),
                center_of_mass_height_m: table.centre_of_mass_height_m.unwrap_or(CENTRE_HEIGHT_M),
            },
            payload: payload(table, wheels),
            floor: floor(table),
            wheels: drives.map(|(index, (wheel, drive))| wheel_drive(table, index, wheel, drive)).collect(),
            step_ns: table.step_us.map_or(DEFAULT_STEP_NS, |step_us| step_us.saturating_mul(1000)),
            wires: wires(plan),
        },
        drives: stations(plan),
    }
}

/// Moment of inertia of a disc that reaches out to the wheels, kg·m².
fn disc_kg_m2(mass_kg: f64, wheels: &[Wheel]) -> f64 {
    let squares = wheels.iter().map(|wheel| wheel.position_m[0].powi(2) + wheel.position_m[1].powi(2));
    0.5 * mass_kg * squares.sum::<f64>() / wheels.len().max(1) as f64
}

/// The payload of the robot's file.
fn payload(table: &SimulationTable, wheels: &[Wheel]) -> Payload {
    let mass_kg = table.payload_kg.unwrap_or(0.0);
    Payload {
        mass_kg,
        yaw_inertia_kg_m2: table.payload_inertia_kg_m2.unwrap_or_else(|| disc_kg_m2(mass_kg, wheels)),
        position_m: table.payload_position_m.unwrap_or_default(),
        height_m: table.payload_height_m.unwrap_or(PAYLOAD_HEIGHT_M),
    }
}

/// The floor of the robot's file.
fn floor(table: &SimulationTable) -> Floor {
    let patch = |patch: &PatchTable| {
        let static_friction = patch.static_friction?;
        let sliding_friction = patch.sliding_friction.unwrap_or(SLIDING_SHARE * static_friction);
        let place = match patch.rectangle_m {
            Some([x_min, y_min, x_max, y_max]) => {
                Region::Rectangle { from_m: [x_min, y_min], to_m: [x_max, y_max] }
            }
            None => Region::Disc { centre_m: patch.centre_m?, radius_m: patch.radius_m? },
        };
        Some(Patch { place, surface: Surface { static_friction, sliding_friction } })
    };
    Floor {
        slope: Slope {
            angle_rad: table.slope_rad.unwrap_or(0.0),
            downhill_rad: table.slope_direction_rad.unwrap_or(0.0),
        },
        patches: table.patch.iter().filter_map(patch).collect(),
    }
}

fn wheel_drive(table: &SimulationTable, index: usize, wheel: &Wheel, drive: &DrivePlan) -> WheelDrive {
    let standard = Contact::default();
    let mut parameters = WheelParameters::mecanum(
        wheel.position_m,
        wheel.rolling_direction,
        wheel.force_direction,
        wheel.radius_m,
    );
    parameters.contact = Contact {
        static_friction: table.static_friction.unwrap_or(standard.static_friction),
        sliding_friction: table.sliding_friction.unwrap_or(standard.sliding_friction),
        rolling_resistance: table.rolling_resistance.unwrap_or(standard.rolling_resistance),
        roller_resistance: table.roller_resistance.unwrap_or(standard.roller_resistance),
        creep: table.creep.unwrap_or(standard.creep),
        tread: table.tread_stiffness_n_m.map(|stiffness_n_m| Tread {
            stiffness_n_m,
            damping_ratio: table.tread_damping_ratio.unwrap_or(Tread::default().damping_ratio),
        }),
    };
    if let Some(inertia_kg_m2) = table.wheel_inertia_kg_m2 {
        parameters.inertia_kg_m2 = inertia_kg_m2;
    }
    let mut motor = motor(table, drive);
    motor.torque_ratio = torque_ratio(table, index);
    WheelDrive { wheel: parameters, motor }
}

/// How the robot's file says that the simulated drives are wired.
fn wires(plan: &RobotPlan) -> Vec<Wire> {
    let table = &plan.simulation;
    let place = |name: &String| plan.drives.iter().position(|drive| drive.name == *name);
    let named =
        |names: &Option<Vec<String>>| names.iter().flatten().filter_map(place).collect::<Vec<usize>>();
    let mut wires: Vec<Wire> = (0..plan.drives.len()).map(Wire::straight).collect();
    if let [one, other] = named(&table.swapped_drives)[..] {
        wires.swap(one, other);
    }
    for drive in named(&table.turned_drives) {
        (wires[drive].turns_motor, wires[drive].turns_encoder) = (true, true);
    }
    for drive in named(&table.turned_encoders) {
        wires[drive].turns_encoder ^= true;
    }
    wires
}

/// What a wheel's motor gives over what its current promises.
fn torque_ratio(table: &SimulationTable, wheel: usize) -> f64 {
    table.torque_ratio.as_ref().and_then(|ratios| ratios.get(wheel)).copied().unwrap_or(1.0)
}

/// A motor behind a gear is, seen from the wheel, like the simulator's direct-drive motor.
fn motor(table: &SimulationTable, drive: &DrivePlan) -> MotorParameters {
    let standard = MotorParameters::default();
    let gear = drive.scale.gear_ratio;
    let rated_speed_rad_s = table.motor_rated_speed_rad_s.unwrap_or(standard.rated_speed_rad_s * gear);
    MotorParameters {
        rated_torque_n_m: drive.scale.rated_torque_nm,
        peak_torque_n_m: table.motor_torque_limit_nm.unwrap_or(drive.scale.peak_torque_nm),
        rotor_inertia_kg_m2: table
            .rotor_inertia_kg_m2
            .unwrap_or(standard.rotor_inertia_kg_m2 / (gear * gear)),
        rated_speed_rad_s,
        maximum_speed_rad_s: table
            .motor_greatest_speed_rad_s
            .unwrap_or(rated_speed_rad_s * standard.maximum_speed_rad_s / standard.rated_speed_rad_s),
        heating_time_constant_s: table.heating_time_constant_s.unwrap_or(standard.heating_time_constant_s),
        gear_ratio: match drive.scale.direction {
            TurnDirection::Forward => gear,
            TurnDirection::Backward => -gear,
        },
        waves: Waves {
            cogging_n_m: table.cogging_nm.unwrap_or(0.0),
            cogging_per_turn: f64::from(table.cogging_per_turn.unwrap_or(COGGING_PER_TURN)),
            ripple: table.torque_ripple.unwrap_or(0.0),
            ripple_per_turn: f64::from(table.torque_ripple_per_turn.unwrap_or(RIPPLE_PER_TURN)),
        },
        ..standard
    }
}

/// Who stands on the simulated bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Member {
    /// The drive of a wheel.
    Wheel(usize),
    /// A SubDevice without a wheel, by its number in the robot's file.
    Beside(usize),
}

/// Everybody in the order of the bus: who is known by position stands there, and who is known by alias or a switch on the
/// places between, wheels first and hot-connect groups last. Places that nobody is left for aren't there.
fn line(plan: &RobotPlan) -> Vec<Member> {
    let wheels = (0..).map(Member::Wheel).zip(plan.drives.iter().map(|drive| drive.place));
    let beside = (0..).map(Member::Beside).zip(plan.devices.iter().map(|device| device.place));
    let (mut fixed, mut free) = (Vec::new(), Vec::new());
    for (member, place) in wheels.chain(beside) {
        match place {
            BusPlace::Position(position) => fixed.push((usize::from(position), member)),
            BusPlace::Alias(_) | BusPlace::Identification(_) => free.push(member),
        }
    }
    fixed.sort_by_key(|(position, _)| *position);
    // A hot-connect group is plugged in behind those that are always there.
    let is_optional = |member: &Member| match member {
        Member::Wheel(_) => false,
        Member::Beside(number) => plan.devices[*number].group.is_some(),
    };
    free.sort_by_key(is_optional);
    let (mut fixed, mut free) = (fixed.into_iter().peekable(), free.into_iter());
    let mut line = Vec::new();
    loop {
        let here = fixed.next_if(|(position, _)| *position <= line.len()).map(|(_, member)| member);
        let next = here.or_else(|| free.next()).or_else(|| fixed.next().map(|(_, member)| member));
        let Some(member) = next else { return line };
        line.push(member);
    }
}

/// Indices that the standard leaves to makers (ETG.1000.6, object dictionary): a simulated drive takes what the file writes there.
const MAKERS_OWN: RangeInclusive<u16> = 0x2000..=0x5FFF;

/// The simulated drive of a product.
fn kind(identity: &Identity) -> DriveKind {
    let is_sgdv = (identity.vendor_id, identity.product_code) == (Some(SGDV_VENDOR), Some(SGDV_PRODUCT));
    if is_sgdv { DriveKind::Sgdv } else { DriveKind::Generic }
}

fn stations(plan: &RobotPlan) -> Vec<DriveStation> {
    let station = |wheel: usize| {
        let drive = &plan.drives[wheel];
        let mut station = DriveStation::new(kind(&drive.identity), wheel);
        station.encoder = match drive.encoder {
            EncoderName::Incremental => Encoder::Incremental,
            EncoderName::Absolute => Encoder::Absolute,
        };
        station.counts_per_revolution = drive.scale.counts_per_revolution;
        let drift_ppm = plan.simulation.clock_drift_ppm.as_ref().and_then(|drifts| drifts.get(wheel));
        station.piece.dc_drift_ppm = drift_ppm.copied().unwrap_or(station.piece.dc_drift_ppm);
        let own = drive.parameters.iter().filter(|parameter| MAKERS_OWN.contains(&parameter.index));
        station.parameters = own.flat_map(beside::entries).collect();
        match drive.place {
            BusPlace::Alias(alias) => station.piece.alias = alias,
            BusPlace::Identification(number) => station.piece.identification = Some(number),
            BusPlace::Position(_) => {}
        }
        station
    };
    let wheel = |member| match member {
        Member::Wheel(wheel) => Some(wheel),
        Member::Beside(_) => None,
    };
    line(plan).into_iter().filter_map(wheel).map(station).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::devices::Cia402Device;
    use omnibase_robot::registry::{Kind, Registry};

    /// Devices by position before, between and behind drives by alias, and a gap that nobody is left for.
    #[test]
    fn who_is_known_by_position_stands_there() {
        let bmm = include_str!("../../../robots/bmm.toml");
        let device = |number: usize, place: &str| {
            format!("[[device]]\nname = \"d{number}\"\nkind = \"ignore\"\n{place}\n")
        };
        let line_of = |places: &[&str]| {
            let devices: String = (0..).zip(places).map(|(number, place)| device(number, place)).collect();
            let text = bmm
                .replace("position = ", "alias = 10")
                .replace("[platform]", &format!("{devices}\n[platform]"));
            let plan = RobotPlan::from_toml(&text, &Registry::with_built_in(), &|name| Err(name.to_owned()))
                .unwrap();
            assert!(plan.drives.iter().all(|drive| matches!(drive.place, BusPlace::Alias(_))));
            line(&plan)
        };
        let wheel = Member::Wheel;
        let beside = Member::Beside;
        let found = line_of(&["position = 5", "position = 0", "position = 2", "alias = 9"]);
        assert_eq!(found, [beside(1), wheel(0), beside(2), wheel(1), wheel(2), beside(0), beside(3)]);
        let found = line_of(&["alias = 8\ngroup = \"arm\"", "alias = 9", "position = 4"]);
        assert_eq!(found, [wheel(0), wheel(1), wheel(2), beside(1), beside(2), beside(0)]);
        assert_eq!(line_of(&["position = 3"]), [wheel(0), wheel(1), wheel(2), beside(0)]);
        assert_eq!(line_of(&["position = 7"]), [wheel(0), wheel(1), wheel(2), beside(0)]);
    }

    #[test]
    fn a_users_device_is_simulated_as_the_drive_that_it_expects() {
        let bmm = include_str!("../../../robots/bmm.toml");
        for (like, kind) in [("sgdv", DriveKind::Sgdv), ("cia402", DriveKind::Generic)] {
            let mut registry = Registry::with_built_in();
            let mut defaults = registry.devices.defaults(like).cloned().unwrap();
            defaults.counts_per_revolution = Some(1 << 20);
            let mine = Kind { name: "mine", meaning: "For a test", keys: Vec::new() };
            registry.devices.add(mine, defaults, Cia402Device::new);
            let text = bmm.replace("\"sgdv\"", "\"mine\"");
            let plan = RobotPlan::from_toml(&text, &registry, &|name| Err(name.to_owned())).unwrap();
            assert!(description(&plan).drives.iter().all(|station| station.kind == kind), "{like}");
        }
    }

    #[test]
    fn the_file_says_what_is_wired_wrongly() {
        let wires = |keys: &str| {
            let text = format!("{}\n{keys}\n", include_str!("../../../robots/bmm.toml"));
            let none = |name: &str| Err(name.to_owned());
            description(&RobotPlan::from_toml(&text, &Registry::with_built_in(), &none).unwrap())
                .machine
                .wires
        };
        let straight = [0, 1, 2].map(Wire::straight);
        assert_eq!(wires(""), straight);
        assert_eq!(
            wires("swapped_drives = [\"wheel_3\", \"wheel_1\"]"),
            [straight[2], straight[1], straight[0]]
        );
        let turned = wires("turned_drives = [\"wheel_2\"]\nturned_encoders = [\"wheel_3\"]");
        let [second, third] = [
            Wire { turns_motor: true, turns_encoder: true, ..straight[1] },
            Wire { turns_encoder: true, ..straight[2] },
        ];
        assert_eq!(turned, [straight[0], second, third]);
    }
}
