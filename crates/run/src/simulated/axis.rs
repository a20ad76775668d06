//! The axes of a simulated robot.

use std::f64::consts::TAU;

use omnibase_ethercat_sim::SubDevice;
use omnibase_ethercat_sim::device::axis::Load;
use omnibase_ethercat_sim::device::drive::Drive;
use omnibase_ethercat_sim::device::servo::Encoder;
use omnibase_robot::config::{AxisPlan, DevicePlan, EncoderName};
use omnibase_robot_sim::{SharedSlide, SlideParameters};

use super::beside::piece;
use super::kind;

/// How far behind the positions to which it moves an axis has its switches, and behind these its ends, as a share of its travel.
const OVERTRAVEL: f64 = 0.05;
/// Homing methods whose home is a limit switch: the negative one, the positive one.
const NEGATIVE_SWITCH: i8 = 17;
const POSITIVE_SWITCH: i8 = 18;

/// The drive of an axis, and the axis behind it.
pub(super) fn drive(device: &DevicePlan, axis: &AxisPlan, number: usize) -> (SubDevice, SharedSlide) {
    let (scale, limits) = (&axis.scale, &axis.limits);
    let rad_per_unit = scale.counts_per_unit / f64::from(scale.counts_per_revolution) * TAU;
    let rad = |position: f64| (position - scale.zero_position) * rad_per_unit;
    let ends = limits.position.map(rad);
    let over = OVERTRAVEL * (ends[1] - ends[0]).abs();
    let (least, greatest) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let method = axis.homing.map_or(0, |homing| homing.method);
    // A drive's home is where it counts 0.
    let switches_rad = [
        if method == NEGATIVE_SWITCH { 0.0 } else { least - over },
        if method == POSITIVE_SWITCH { 0.0 } else { greatest + over },
    ];
    let start_rad = rad(axis.simulated_position);
    let mut drive = Drive::new(kind(&device.identity));
    drive.servo.counts_per_revolution = scale.counts_per_revolution;
    drive.servo.rated_torque_n_m = scale.rated_torque_nm;
    drive.servo.peak_torque_n_m = limits.torque_nm.max(scale.rated_torque_nm);
    drive.servo.max_speed_rad_s = 2.0 * limits.speed * rad_per_unit.abs();
    drive.servo.encoder = match axis.encoder {
        EncoderName::Incremental => Encoder::Incremental,
        EncoderName::Absolute => Encoder::Absolute,
    };
    drive.servo.initial_position = match axis.encoder {
        // Wherever it was switched off last.
        EncoderName::Incremental => 123_456 + number as i32,
        EncoderName::Absolute => scale.counts(axis.simulated_position),
    };
    // A load with which the motor reaches the greatest acceleration by a third of its rated torque.
    let acceleration_rad_s2 = limits.stop_deceleration * rad_per_unit.abs();
    let load = Load {
        inertia_kg_m2: scale.rated_torque_nm / 3.0 / acceleration_rad_s2,
        viscous_n_m_s: 0.0,
        coulomb_n_m: 0.05 * scale.rated_torque_nm,
    };
    let slide = SharedSlide::new(SlideParameters { load, start_rad, switches_rad, overtravel_rad: over });
    (drive.build_on(&piece(device, number), Box::new(slide.clone())), slide)
}
