//! A running robot under the hands of people and programs: what they ask, who has the say, what they see.
//!
//! - [`command`]: what can be asked, by whom, and the answers.
//! - [`operator`]: emergency stop before stick before reference; one request a cycle comes out of it.
//! - [`acyclic`]: SDOs of SubDevices beside the cycle.
//! - [`carriers`]: a queue in, a queue and the latest snapshot out; nothing of it waits in the cycle.
//! - [`cycles`]: every cycle for those who follow.
//! - [`joystick`]: from the joystick at the robot's computer to what is asked.
//! - [`points`]: poses that a person remembers one by one.
//! - [`sdo`]: objects and states of the SubDevices, for those who may wait.
//! - [`snapshot`]: the latest of everything.
//! - [`sources`]: what other programs send.
//! - [`stamp`]: how old what is asked may be.

pub mod acyclic;
pub mod carriers;
pub mod command;
pub mod cycles;
pub mod joystick;
pub mod operator;
pub mod points;
pub mod sdo;
pub mod snapshot;
pub mod sources;
pub mod stamp;
mod trace;

pub use acyclic::{AcyclicLine, AcyclicRefusal, Permission, SubDeviceFacts, Told};
pub use carriers::{Asker, Live, LiveEnd, LiveEvent, live};
pub use command::{Answer, Ask, Client, Commander, JoystickState, Refusal, StickWish};
pub use cycles::{CycleSeen, Following};
pub use joystick::JoystickDriver;
pub use operator::{Ages, Operator};
pub use points::NotRemembered;
pub use sdo::{EntryType, ObjectType, SdoError, SdoPlace, SubDeviceSeen, entry_unit};
pub use snapshot::{FenceSeen, Snapshot};
pub use sources::{NotHeard, SourceCounts};
pub use stamp::Stamp;
pub use trace::{TRACE_KEPT_S, TraceGap, TracePoint};
