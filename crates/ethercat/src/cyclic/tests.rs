//! The cycle against a small segment of its own making, frame by frame.

mod culprits;
mod frames;
mod segment;
mod states;
mod work;

use super::*;
use crate::config::{DcConfig, LrwPermission, Timeouts};
use crate::image::ClockUse;
use crate::subdevice::{DcWidth, Direction};
use crate::wire::bytes::u32_at;
use crate::wire::{AlStatusCode, DcTime};
use segment::{BYTES, Bench, members};
use std::collections::VecDeque;
