//! A running robot under people's hands, in virtual time, frames and all.

mod axes;
mod comeback;
mod driving;
mod files;
mod hands;
mod in_map;
mod inputs;
mod joystick;
mod limits;
mod own_reference;
mod programs;
mod sources;
mod stamps;
mod teaching;
