//! The servo's object dictionary (CiA 402-2), and where the cycle finds what it needs in it.

use std::ops::RangeInclusive;

use super::ServoConfig;
use crate::device::parameters;
use crate::dictionary::standard::{self, Mapping, Nameplate, PdoMap};
use crate::dictionary::{Access, DataType, Dictionary, Entry, Field, Object, Scalar};
use crate::firmware::Synchronization;

/// Modes by their bit in 0x6502: pp, pv, tq, hm, csp, csv, cst.
pub(super) const SUPPORTED_MODES: u32 = 1 << 0 | 1 << 2 | 1 << 3 | 1 << 5 | 1 << 7 | 1 << 8 | 1 << 9;

const PARAMETER: Access = Access(Access::READ_WRITE.0 | Access::BACKUP.0 | Access::SETTING.0);
const COMMAND: Access = Access(Access::READ_WRITE.0 | Access::RX_PDO.0);
const ACTUAL: Access = Access(Access::READ.0 | Access::TX_PDO.0);

/// Every object of a servo with these PDOs.
pub(super) fn objects(config: &ServoConfig, nameplate: &Nameplate, pdos: &[PdoMap]) -> Vec<Object> {
    let mut objects = standard::nameplate_objects(nameplate);
    objects.push(standard::sync_manager_types(&[1, 2, 3, 4]));
    objects.push(standard::store_parameters());
    for map in pdos {
        objects.push(standard::mapping(map, Mapping::Configurable));
    }
    objects.push(standard::assignment(2, &[0x1600], Mapping::Configurable));
    objects.push(standard::assignment(3, &[0x1A00], Mapping::Configurable));
    let Synchronization { supported, shortest_cycle_ns, .. } = config.synchronization;
    let default = u16::from(supported & Synchronization::SYNC_MANAGER != 0);
    for index in [0x1C32, 0x1C33] {
        objects.push(standard::sync_parameter(index, default, supported, shortest_cycle_ns));
    }
    objects.extend(standard_objects(config));
    objects.extend(manufacturer_objects());
    parameters::add_objects(&mut objects, &config.parameters);
    objects
}

/// The objects of CiA 402 that a servo works on.
pub(in crate::device) fn standard_objects(config: &ServoConfig) -> Vec<Object> {
    let mut objects = state_objects();
    objects.extend(motion_objects(config));
    objects
}

fn option(index: u16, name: &'static str, default: i16, limits: RangeInclusive<i64>) -> Object {
    let entry =
        Entry::integer16(0, name, default).with_access(PARAMETER).with_limits(*limits.start(), *limits.end());
    Object::variable(index, entry)
}

fn state_objects() -> Vec<Object> {
    vec![
        option(0x6007, "Abort connection option code", 1, 0..=3),
        Object::variable(0x603F, Entry::unsigned16(0, "Error code", 0).with_access(ACTUAL)),
        Object::variable(0x6040, Entry::unsigned16(0, "Controlword", 0).with_access(COMMAND)),
        Object::variable(0x6041, Entry::unsigned16(0, "Statusword", 0).with_access(ACTUAL)),
        option(0x605A, "Quick stop option code", 2, 0..=7),
        option(0x605B, "Shutdown option code", 0, 0..=1),
        option(0x605C, "Disable operation option code", 1, 0..=1),
        option(0x605D, "Halt option code", 1, 1..=3),
        option(0x605E, "Fault reaction option code", 0, 0..=2),
        Object::variable(0x6060, Entry::integer8(0, "Modes of operation", 0).with_access(COMMAND)),
        Object::variable(0x6061, Entry::integer8(0, "Modes of operation display", 0).with_access(ACTUAL)),
        Object::variable(0x6502, Entry::unsigned32(0, "Supported drive modes", SUPPORTED_MODES)),
    ]
}

fn motion_objects(config: &ServoConfig) -> Vec<Object> {
    let i32 = |index, name, access| Object::variable(index, Entry::integer32(0, name, 0).with_access(access));
    let i16 = |index, name, access| Object::variable(index, Entry::integer16(0, name, 0).with_access(access));
    let u32 = |index, name, default: u32, access| {
        Object::variable(index, Entry::unsigned32(0, name, default).with_access(access))
    };
    let max_speed = config.counts_per_s(config.max_speed_rad_s) as u32;
    let acceleration = max_speed.saturating_mul(4);
    let settable = Access(PARAMETER.0 | Access::RX_PDO.0);
    let max_torque = (1000.0 * config.peak_torque_n_m / config.rated_torque_n_m) as u16;
    vec![
        i32(0x6062, "Position demand value", ACTUAL),
        i32(0x6063, "Position actual internal value", ACTUAL),
        i32(0x6064, "Position actual value", ACTUAL),
        u32(0x6065, "Following error window", config.counts_per_revolution, settable),
        Object::variable(0x6066, Entry::unsigned16(0, "Following error time out", 10).with_access(PARAMETER)),
        u32(0x6067, "Position window", config.counts_per_revolution / 3600, PARAMETER),
        Object::variable(0x6068, Entry::unsigned16(0, "Position window time", 0).with_access(PARAMETER)),
        i32(0x606B, "Velocity demand value", ACTUAL),
        i32(0x606C, "Velocity actual value", ACTUAL),
        u32(0x606D, "Velocity window", max_speed / 100, PARAMETER),
        i16(0x6071, "Target torque", COMMAND),
        Object::variable(0x6072, Entry::unsigned16(0, "Max torque", max_torque).with_access(settable)),
        i16(0x6074, "Torque demand", ACTUAL),
        u32(0x6076, "Motor rated torque", (config.rated_torque_n_m * 1000.0) as u32, Access::READ),
        i16(0x6077, "Torque actual value", ACTUAL),
        i32(0x607A, "Target position", COMMAND),
        i32(0x607C, "Home offset", PARAMETER),
        u32(0x607F, "Max profile velocity", max_speed, settable),
        u32(0x6080, "Max motor speed", max_speed, settable),
        u32(0x6081, "Profile velocity", max_speed / 4, settable),
        u32(0x6083, "Profile acceleration", acceleration, settable),
        u32(0x6084, "Profile deceleration", acceleration, settable),
        u32(0x6085, "Quick stop deceleration", acceleration.saturating_mul(2), settable),
        u32(0x6087, "Torque slope", 10_000, settable),
        Object::variable(0x6098, Entry::integer8(0, "Homing method", 0).with_access(PARAMETER)),
        Object::array(
            0x6099,
            "Homing speeds",
            vec![
                Entry::unsigned32(1, "Speed during search for switch", max_speed / 100)
                    .with_access(PARAMETER),
                Entry::unsigned32(2, "Speed during search for zero", max_speed / 1000).with_access(PARAMETER),
            ],
        ),
        u32(0x609A, "Homing acceleration", acceleration, PARAMETER),
        i32(0x60B1, "Velocity offset", COMMAND),
        i16(0x60B2, "Torque offset", COMMAND),
        Object::variable(0x60B8, Entry::unsigned16(0, "Touch probe function", 0).with_access(COMMAND)),
        Object::variable(0x60B9, Entry::unsigned16(0, "Touch probe status", 0).with_access(ACTUAL)),
        i32(0x60BA, "Touch probe 1 positive edge", ACTUAL),
        Object::array(
            0x60C1,
            "Interpolation data record",
            vec![Entry::integer32(1, "Interpolation data 1", 0).with_access(COMMAND)],
        ),
        Object::record(
            0x60C2,
            "Interpolation time period",
            DataType::RECORD,
            vec![
                Entry::unsigned8(1, "Interpolation time period value", 1).with_access(PARAMETER),
                Entry::integer8(2, "Interpolation time index", -3).with_access(PARAMETER).with_limits(-9, 0),
            ],
        ),
        i32(0x60F4, "Following error actual value", ACTUAL),
        i32(0x60FC, "Position demand internal value", ACTUAL),
        u32(0x60FD, "Digital inputs", 0, ACTUAL),
        i32(0x60FF, "Target velocity", COMMAND),
    ]
}

/// Objects of every shape and length, for whoever tests a client.
fn manufacturer_objects() -> Vec<Object> {
    let pattern: Vec<u8> = (0..4096).map(|byte| (byte * 7 + byte / 256) as u8).collect();
    let words = (1..=16).map(|subindex| {
        Entry::unsigned16(subindex, format!("Word {subindex}"), u16::from(subindex)).with_access(PARAMETER)
    });
    vec![
        Object::variable(
            0x2F00,
            Entry::new(0, "Scratch memory", DataType::DOMAIN, pattern).with_access(Access::READ_WRITE),
        ),
        Object::variable(0x2F01, Entry::text(0, "Note", "").with_access(PARAMETER).with_capacity(64)),
        Object::variable(
            0x2F02,
            Entry::new(0, "Five bytes", DataType::OCTET_STRING, vec![1, 2, 3, 4, 5])
                .with_access(Access::READ_WRITE),
        ),
        Object::variable(0x2F03, Entry::unsigned64(0, "Long word", 0).with_access(Access::READ_WRITE)),
        Object::array(0x2F04, "Words", words.collect()),
        Object::variable(0x2F05, Entry::unsigned32(0, "Password", 0).with_access(Access::WRITE)),
    ]
}

/// The objects that a cycle reads or writes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields {
    pub error_register: Field<u8>,
    pub error_code: Field<u16>,
    pub control: Field<u16>,
    pub status: Field<u16>,
    pub abort_option: Field<i16>,
    pub quick_stop_option: Field<i16>,
    pub shutdown_option: Field<i16>,
    pub disable_option: Field<i16>,
    pub halt_option: Field<i16>,
    pub fault_option: Field<i16>,
    pub mode: Field<i8>,
    pub mode_display: Field<i8>,
    pub position_demand: Field<i32>,
    pub position_internal: Field<i32>,
    pub position: Field<i32>,
    pub following_window: Field<u32>,
    pub following_timeout_ms: Field<u16>,
    pub position_window: Field<u32>,
    pub velocity_demand: Field<i32>,
    pub velocity: Field<i32>,
    pub velocity_window: Field<u32>,
    pub target_torque: Field<i16>,
    pub max_torque: Field<u16>,
    pub torque_demand: Field<i16>,
    pub torque: Field<i16>,
    pub target_position: Field<i32>,
    pub max_profile_velocity: Field<u32>,
    pub max_motor_speed: Field<u32>,
    pub profile_velocity: Field<u32>,
    pub profile_acceleration: Field<u32>,
    pub profile_deceleration: Field<u32>,
    pub quick_stop_deceleration: Field<u32>,
    pub torque_slope: Field<u32>,
    pub velocity_offset: Field<i32>,
    pub torque_offset: Field<i16>,
    pub interpolation_value: Field<u8>,
    pub interpolation_index: Field<i8>,
    pub following_error: Field<i32>,
    pub position_demand_internal: Field<i32>,
    pub target_velocity: Field<i32>,
    pub home_offset: Field<i32>,
    pub homing_method: Field<i8>,
    pub homing_speeds: [Field<u32>; 2],
    pub homing_acceleration: Field<u32>,
    pub digital_inputs: Field<u32>,
}

impl Fields {
    /// The fields of a dictionary; names the first object that isn't there or has another type.
    pub fn find(dictionary: &Dictionary) -> Result<Self, u16> {
        fn at<T: Scalar>(dictionary: &Dictionary, index: u16) -> Result<Field<T>, u16> {
            dictionary.field(index, 0).ok_or(index)
        }
        let d = dictionary;
        Ok(Fields {
            error_register: at(d, 0x1001)?,
            error_code: at(d, 0x603F)?,
            control: at(d, 0x6040)?,
            status: at(d, 0x6041)?,
            abort_option: at(d, 0x6007)?,
            quick_stop_option: at(d, 0x605A)?,
            shutdown_option: at(d, 0x605B)?,
            disable_option: at(d, 0x605C)?,
            halt_option: at(d, 0x605D)?,
            fault_option: at(d, 0x605E)?,
            mode: at(d, 0x6060)?,
            mode_display: at(d, 0x6061)?,
            position_demand: at(d, 0x6062)?,
            position_internal: at(d, 0x6063)?,
            position: at(d, 0x6064)?,
            following_window: at(d, 0x6065)?,
            following_timeout_ms: at(d, 0x6066)?,
            position_window: at(d, 0x6067)?,
            velocity_demand: at(d, 0x606B)?,
            velocity: at(d, 0x606C)?,
            velocity_window: at(d, 0x606D)?,
            target_torque: at(d, 0x6071)?,
            max_torque: at(d, 0x6072)?,
            torque_demand: at(d, 0x6074)?,
            torque: at(d, 0x6077)?,
            target_position: at(d, 0x607A)?,
            max_profile_velocity: at(d, 0x607F)?,
            max_motor_speed: at(d, 0x6080)?,
            profile_velocity: at(d, 0x6081)?,
            profile_acceleration: at(d, 0x6083)?,
            profile_deceleration: at(d, 0x6084)?,
            quick_stop_deceleration: at(d, 0x6085)?,
            torque_slope: at(d, 0x6087)?,
            velocity_offset: at(d, 0x60B1)?,
            torque_offset: at(d, 0x60B2)?,
            interpolation_value: d.field(0x60C2, 1).ok_or(0x60C2_u16)?,
            interpolation_index: d.field(0x60C2, 2).ok_or(0x60C2_u16)?,
            following_error: at(d, 0x60F4)?,
            position_demand_internal: at(d, 0x60FC)?,
            target_velocity: at(d, 0x60FF)?,
            home_offset: at(d, 0x607C)?,
            homing_method: at(d, 0x6098)?,
            homing_speeds: [d.field(0x6099, 1).ok_or(0x6099_u16)?, d.field(0x6099, 2).ok_or(0x6099_u16)?],
            homing_acceleration: at(d, 0x609A)?,
            digital_inputs: at(d, 0x60FD)?,
        })
    }
}
