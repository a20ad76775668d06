//! Recorded streams of known devices, made of bytes, through map and joystick; and streams of anything.

mod anything;
mod devices;
mod driving;
mod finding;
mod loss;
