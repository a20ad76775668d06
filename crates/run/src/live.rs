//! A running robot under the hands of people and programs: what they ask, who has the say, what they see.
//!
//! - [`command`]: what can be asked, by whom, and the answers.
//! - [`operator`]: emergency stop before stick before reference; one request a cycle comes out of it.
//! - [`carriers`]: a queue in, a queue and the latest snapshot out; nothing of it waits in the cycle.
//! - [`joystick`]: from the stick at the robot's computer to what is asked.
//! - [`snapshot`]: the latest of everything.

pub mod carriers;
pub mod command;
pub mod joystick;
pub mod operator;
pub mod snapshot;

pub use carriers::{Live, LiveEnd, LiveEvent, TRACE_KEPT_S, TraceGap, TracePoint, live};
pub use command::{Answer, Ask, Client, Commander, Pad, Refusal, StickState};
pub use joystick::JoystickDriver;
pub use operator::{Ages, Operator};
pub use snapshot::Snapshot;
