//! A running robot whose bus suffers: devices lose power, cables are pulled, frames are damaged; in virtual time.

mod axes;
mod bench;
mod beside;
mod clocks;
mod disturbances;
mod firmware;
mod lost;
mod matrix;
mod modes;
mod pose;
mod rates;
mod recovery;
mod resume;
mod sensors;
mod storm;
mod terminals;
mod topology;
