//! Other programs that send inputs, and devices beside the bus that do: as written, and resolved.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::signals::{Carries, Frame, SignalLayout, SignalName, SourceName};

/// Who sends inputs while the robot runs: a program over the robot's API or by `omnibase send`, or what a receiver hears.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SourceTable {
    /// Its name: small letters, digits and underscores, at most 24; its values are called `name.value`.
    pub name: Option<String>,
    /// How what it sends comes in; it says which of the keys below are read.
    pub receiver: Option<String>,
    /// What it sends; default: `values`.
    pub carries: Option<CarriesName>,
    /// Its values, where it sends `values`.
    pub input: Vec<SentTable>,
    /// What it sent longer ago isn't believed, ms; default: 100.
    #[schemars(range(min = 1, max = 60_000))]
    pub max_age_ms: Option<u32>,
    /// Where datagrams are awaited, this machine's address and a port, as `"192.168.1.10:8500"`.
    pub address: Option<String>,
    /// The only machine whose datagrams are taken, an address without a port; on loopback it may be left out.
    pub peer: Option<String>,
    /// The machine on which Motive runs, an IPv4 address; nobody else's frames are taken.
    pub server: Option<String>,
    /// This machine's IPv4 address on the cable to the server; default: any.
    pub local_address: Option<String>,
    /// The group to which the server sends, as `"239.255.42.99"`; default: it sends to this machine alone (unicast).
    pub multicast: Option<String>,
    /// The server's port for commands; default: 1510.
    #[schemars(range(min = 1, max = 65_535))]
    pub command_port: Option<u16>,
    /// The port to which the server sends to a group; default: 1511.
    #[schemars(range(min = 1, max = 65_535))]
    pub data_port: Option<u16>,
    /// The rigid body by its name; this or `body_id`.
    pub body: Option<String>,
    /// The rigid body by its streaming id; this or `body`.
    pub body_id: Option<u32>,
    /// Which axis of the server points up; default: `y`, as Motive has it. Then x stays, and y of the map is −z of the server.
    pub up_axis: Option<UpAxis>,
    /// The server's unit of length, m; default: 1.
    #[schemars(range(min = 1e-6, max = 1e3))]
    pub unit_m: Option<f64>,
    /// The mouse, by a name that stays, as `"/dev/input/by-id/usb-Maker_Mouse-event-mouse"`; nothing else on this machine is
    /// moved by it meanwhile.
    pub device: Option<String>,
}

/// Which axis points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// y, as in Motive.
    #[default]
    Y,
    /// z.
    Z,
}

/// A value that a program sends.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SentTable {
    /// Its name: small letters, digits and underscores, at most 24.
    pub name: Option<String>,
    /// Its unit; default: none.
    pub unit: Option<String>,
    /// Below this it isn't believed; default: no bound.
    pub least: Option<f64>,
    /// Above this it isn't believed; default: no bound.
    pub greatest: Option<f64>,
}

/// What a program sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CarriesName {
    /// Values by name.
    #[default]
    Values,
    /// A pose in odom with its covariance: `x`, `y`, `heading`, `covariance_xx`, `_xy`, `_xh`, `_yy`, `_yh`, `_hh`, in m
    /// and rad.
    Pose,
    /// A velocity in base_link: `x`, `y` in m/s, `heading` in rad/s.
    VelocityInBody,
    /// A velocity in odom, with the same values.
    VelocityInOdom,
}

impl From<CarriesName> for Carries {
    fn from(name: CarriesName) -> Self {
        match name {
            CarriesName::Values => Carries::Values,
            CarriesName::Pose => Carries::Pose,
            CarriesName::VelocityInBody => Carries::Velocity(Frame::Body),
            CarriesName::VelocityInOdom => Carries::Velocity(Frame::Odom),
        }
    }
}

/// One program that sends inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct SourcePlan {
    /// Its name.
    pub name: String,
    /// What it sends.
    pub carries: Carries,
    /// Its values, in the order in which they stand in a cycle's record.
    pub input: Vec<SentPlan>,
    /// What it sent longer ago isn't believed, ns.
    pub max_age_ns: u64,
    /// It tells poses to a sensor: what was measured earlier than what was heard counts all the same.
    pub any_order: bool,
    /// How it comes in.
    pub receiver: ReceiverPlan,
}

/// How what a source sends comes in.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ReceiverPlan {
    /// A program sends it by the robot's API.
    #[default]
    Program,
    /// Plain datagrams with a pose.
    Datagram(DatagramPlan),
    /// Frames of OptiTrack's Motive.
    NatNet(NatNetPlan),
    /// An optical mouse.
    Mouse {
        /// Its path.
        device: String,
    },
}

/// Who may send datagrams, and where they are awaited.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DatagramPlan {
    /// This machine's address.
    pub address: SocketAddr,
    /// The only machine that is heard.
    pub peer: IpAddr,
}

/// Motive, and the rigid body that the platform is.
#[derive(Clone, Debug, PartialEq)]
pub struct NatNetPlan {
    /// Where it runs.
    pub server: Ipv4Addr,
    /// This machine's address on the cable to it.
    pub local: Ipv4Addr,
    /// The group to which it sends; `None`: to this machine alone.
    pub multicast: Option<Ipv4Addr>,
    /// Its port for commands.
    pub command_port: u16,
    /// The port to which it sends to a group.
    pub data_port: u16,
    /// Which rigid body.
    pub body: BodyChoice,
    /// Which of its axes points up.
    pub up_axis: UpAxis,
    /// Its unit of length, m.
    pub unit_m: f64,
}

/// A rigid body of Motive's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BodyChoice {
    /// By its streaming id.
    Id(u32),
    /// By its name.
    Name(String),
}

/// A value that a program sends.
#[derive(Clone, Debug, PartialEq)]
pub struct SentPlan {
    /// Its name, without the program's.
    pub name: String,
    /// Its unit; empty where it has none.
    pub unit: String,
    /// Least and greatest value that are believed.
    pub bounds: [f64; 2],
}

impl SourcePlan {
    /// Adds the names of its values behind those that are there.
    pub(crate) fn add_to(&self, layout: &mut SignalLayout) {
        layout.sources.push(SourceName { name: self.name.clone(), carries: self.carries });
        layout.inputs.extend(self.input.iter().map(|sent| SignalName {
            name: format!("{}.{}", self.name, sent.name),
            unit: sent.unit.clone(),
        }));
    }
}
