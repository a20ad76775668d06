//! What the dictionary shows of the loops.

use super::{Mode, Motion, nearest, whole};

/// Statusword bit 10: target reached.
pub(super) const TARGET_REACHED: u16 = 1 << 10;
/// Bit 11: internal limit active.
const LIMIT_ACTIVE: u16 = 1 << 11;
/// Bit 12: the drive follows (csp, csv, cst), the set point was acknowledged (pp), or homing was attained (hm).
pub(super) const FOLLOWS: u16 = 1 << 12;
/// Bit 13: following error; homing error (hm).
pub(super) const FOLLOWING_ERROR: u16 = 1 << 13;

/// Values for the dictionary.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Shown {
    pub status: u16,
    pub mode: i8,
    pub position: i32,
    pub position_demand: i32,
    pub following_error: i32,
    pub velocity: i32,
    pub velocity_demand: i32,
    pub torque: i16,
    pub torque_demand: i16,
    pub digital_inputs: u32,
}

impl Motion {
    pub fn shown(&self) -> Shown {
        let position = self.encoder(self.state) + self.offset;
        let demand = whole(self.position_demand);
        let mut status = 0;
        if self.limited && self.follows {
            status |= LIMIT_ACTIVE;
        }
        if self.follows {
            let cyclic =
                matches!(self.mode, Mode::CyclicPosition | Mode::CyclicVelocity | Mode::CyclicTorque);
            if self.mode == Mode::Homing {
                status |= self.homing.status();
            } else if cyclic || self.set_point_acknowledged {
                status |= FOLLOWS;
            }
            if !cyclic && !matches!(self.mode, Mode::None | Mode::Homing) && self.reached {
                status |= TARGET_REACHED;
            }
            if self.follows_badly {
                status |= FOLLOWING_ERROR;
            }
        }
        let per_mille = |torque: f64| {
            let nearest = nearest(torque / self.rated_torque_n_m * 1000.0);
            nearest.clamp(i16::MIN.into(), i16::MAX.into()) as i16
        };
        Shown {
            status,
            mode: self.mode as i8,
            position: position as i32,
            position_demand: demand as i32,
            following_error: (demand as f64 - position as f64) as i32,
            velocity: nearest(self.state.speed_rad_s * self.counts_per_rad),
            velocity_demand: nearest(self.speed_demand),
            torque: per_mille(self.state.torque_n_m),
            torque_demand: per_mille(self.torque_demand),
            digital_inputs: u32::from(self.state.switches.negative)
                | u32::from(self.state.switches.positive) << 1,
        }
    }
}
