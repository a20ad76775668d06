//! What doesn't change while a robot runs.

use std::path::PathBuf;
use std::sync::Arc;

use omnibase_robot::check::ReadFile;
use omnibase_robot::config::{AxisMode, DevicePlan, OutputPlan, ReferenceTable, Source};
use omnibase_robot::signals::column_name;
use omnibase_robot::stages::Reference;
use omnibase_robot::{Ability, Registry};
use omnibase_run::LoadedRobot;
use omnibase_run::channels::{Known, Rows};
use omnibase_run::room::Room;
use schemars::JsonSchema;
use serde::Serialize;

use crate::planned::Drawn;
use crate::streams::Streams;

/// The API's version: the first number changes where a client of before would no longer work.
pub const API_VERSION: &str = "1.2.0";

/// What a dashboard is told of its robot.
pub struct RobotInfo {
    /// What its file resolves to.
    pub robot: LoadedRobot,
    /// By which its file was checked, and new references are.
    pub registry: Arc<Registry>,
    /// Whether the truth is known.
    pub known: Known,
    /// The room through which ways are planned.
    pub room: Room,
    /// Where paths are saved.
    pub paths: PathBuf,
    /// Where values go beside the page.
    pub streams: Streams,
}

/// The robot, for the page.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Facts<'a> {
    name: &'a str,
    version: &'static str,
    /// Of the API.
    api: &'static str,
    simulated: bool,
    cycle_s: f64,
    /// What it weighs, as it is simulated, with its payload.
    body: BodyFacts,
    wheels: Vec<WheelFacts<'a>>,
    devices: Vec<DeviceFacts<'a>>,
    /// What tells the estimator of the place beside the wheels.
    sensors: Vec<SensorFacts<'a>>,
    limits: LimitFacts,
    controllers: Vec<&'a str>,
    footprint: &'a [[f64; 2]],
    fence: &'a [[f64; 2]],
    obstacle_places: usize,
    columns: Vec<String>,
    may_command: bool,
}

#[derive(Serialize, JsonSchema)]
struct WheelFacts<'a> {
    name: &'a str,
    device: &'a str,
    position_m: [f64; 2],
    rolling: [f64; 2],
    radius_m: f64,
    /// About its axis.
    inertia_kg_m2: f64,
    /// Seen at the wheel.
    rotor_inertia_kg_m2: f64,
}

#[derive(Serialize, JsonSchema)]
struct BodyFacts {
    mass_kg: f64,
    /// About the vertical axis through its centre of mass.
    inertia_kg_m2: f64,
    /// Centre of mass in base_link.
    centre_m: [f64; 3],
}

/// A SubDevice that drives no wheel.
#[derive(Serialize, JsonSchema)]
struct DeviceFacts<'a> {
    name: &'a str,
    /// What it may be told.
    outputs: Vec<OutputFacts>,
    /// The axis that its drive moves.
    axis: Option<AxisFacts<'a>>,
}

#[derive(Serialize, JsonSchema)]
struct SensorFacts<'a> {
    /// Its verdict and chi² are the columns sensor/NAME_verdict and sensor/NAME_nis.
    name: &'a str,
    /// chi² of a reading over its degrees of freedom, beyond which it is left out.
    gate: f64,
}

#[derive(Serialize, JsonSchema)]
struct OutputFacts {
    /// Its full name, as `lamps.green`.
    name: String,
    unit: String,
    /// Where it stands among the columns.
    column: String,
    /// The least and the greatest value that it can have, where that is known.
    range: Option<[f64; 2]>,
    /// It is either 0 or 1.
    is_switch: bool,
}

#[derive(Serialize, JsonSchema)]
struct AxisFacts<'a> {
    /// Unit of its position.
    unit: &'static str,
    /// Where its position stands among the columns.
    column: String,
    /// The least and the greatest position.
    range: [f64; 2],
    /// Modes in which it may be moved.
    modes: &'a [AxisMode],
    /// Whether it can find its home.
    finds_home: bool,
}

impl<'a> DeviceFacts<'a> {
    fn of(plan: &'a DevicePlan) -> Self {
        let column = |name: &str, unit: &str| format!("{}/{}", plan.name, column_name(name, unit));
        let output = |output: &OutputPlan| {
            let range = output.coding.map(|coding| coding.values());
            OutputFacts {
                name: format!("{}.{}", plan.name, output.name),
                unit: output.unit.clone(),
                column: column(&output.name, &output.unit),
                range,
                is_switch: range == Some([0.0, 1.0]) && output.coding.is_some_and(|coding| coding.bits == 1),
            }
        };
        let axis = plan.axis.as_ref().map(|axis| AxisFacts {
            unit: axis.unit.name(),
            column: column("position", axis.unit.name()),
            range: axis.limits.position,
            modes: &axis.modes,
            finds_home: axis.homing.is_some(),
        });
        DeviceFacts { name: &plan.name, outputs: plan.output.iter().map(output).collect(), axis }
    }
}

#[derive(Serialize, JsonSchema)]
struct LimitFacts {
    speed_m_s: f64,
    turn_speed_rad_s: f64,
    wheel_speed_rad_s: f64,
    wheel_torque_nm: f64,
}

impl RobotInfo {
    pub(crate) fn facts(&self, may_command: bool) -> Facts<'_> {
        let plan = &self.robot.plan;
        let described = omnibase_run::mechanics::description(plan);
        let omnibase_description::Body { mass_kg, inertia_kg_m2, centre_m } = described.body;
        let wheels = described.wheels.iter().zip(&plan.drives);
        Facts {
            name: &plan.name,
            version: env!("CARGO_PKG_VERSION"),
            api: API_VERSION,
            simulated: self.known == Known::Truth,
            cycle_s: plan.bus.cycle_ns as f64 * 1e-9,
            body: BodyFacts { mass_kg, inertia_kg_m2, centre_m },
            wheels: wheels
                .map(|(wheel, drive)| WheelFacts {
                    name: &drive.name,
                    device: &drive.device,
                    position_m: wheel.position_m,
                    rolling: wheel.rolling,
                    radius_m: wheel.radius_m,
                    inertia_kg_m2: wheel.inertia_kg_m2,
                    rotor_inertia_kg_m2: wheel.rotor_inertia_kg_m2,
                })
                .collect(),
            devices: plan.devices.iter().map(DeviceFacts::of).collect(),
            sensors: plan
                .sensors
                .iter()
                .map(|sensor| SensorFacts { name: &sensor.name, gate: sensor.gate() })
                .collect(),
            limits: LimitFacts {
                speed_m_s: plan.limits.speed_m_s,
                turn_speed_rad_s: plan.limits.turn_speed_rad_s,
                wheel_speed_rad_s: plan.limits.wheel_speed_rad_s,
                wheel_torque_nm: plan.limits.wheel_torque_nm,
            },
            controllers: plan.controllers().collect(),
            footprint: &plan.guard.footprint_m,
            fence: plan.guard.fence.as_ref().map_or(&[], |fence| &fence.corners_m),
            obstacle_places: omnibase_robot::guard::MAX_OBSTACLES,
            columns: self.columns(),
            may_command,
        }
    }

    /// Rows of values, as recordings have them.
    pub(crate) fn rows(&self) -> Rows {
        Rows::new(&self.robot.plan.record_layout(), self.known)
    }

    /// Names of the values, as `state/pose_x_m`.
    pub(crate) fn columns(&self) -> Vec<String> {
        let rows = self.rows();
        let topics = rows.schema().topics.iter();
        topics
            .flat_map(|topic| {
                let name = topic.name.trim_start_matches('/').to_owned();
                topic.signals.iter().map(move |signal| format!("{name}/{}", signal.name))
            })
            .collect()
    }

    /// A reference for this robot, with the whole table of it, or every problem in words; `read_file` reads its points.
    pub(crate) fn check(
        &self,
        source: Source<ReferenceTable>,
        read_file: ReadFile<'_>,
    ) -> Result<(ReferenceTable, Box<dyn Reference>), String> {
        let (table, made) =
            self.robot.plan.check_reference(source, &self.registry, read_file).map_err(|problems| {
                problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
            })?;
        // What files said is in the table: nobody needs them any more.
        Ok((self.registry.with_files(table, |_| None), made))
    }

    /// What is drawn of a reference: one that is made for it, for drawing leaves its traces in it.
    pub(crate) fn drawn(&self, table: &ReferenceTable) -> Result<Drawn, String> {
        let made = self.registry.make_reference(table, &Ability::of(&self.robot.plan));
        made.map(|made| Drawn::of(&self.robot.plan, table, made)).map_err(|error| error.to_string())
    }
}
