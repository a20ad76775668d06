//! How values of sources come in: one kind each. What they hear is heard in `omnibase-receive`.

use std::fmt::Display;
use std::net::{Ipv4Addr, SocketAddr};
use std::str::FromStr;

use crate::config::{
    BodyChoice, DatagramPlan, NatNetPlan, Problem, ProblemKind, ReceiverPlan, SentPlan, SourceTable,
};
use crate::registry::{Kind, Made, Received, Registry, given, needed, optional};
use crate::signals::Carries;

/// Motive's ports unless something else is set there: commands, and data to a group.
const NATNET_PORTS: [u16; 2] = [1510, 1511];

/// What a mouse says: how far the floor passed below it along its own axes, in counts.
const MOUSE_VALUES: [&str; 2] = ["x", "y"];

/// Adds the built-in kinds.
pub(crate) fn register(registry: &mut Registry) {
    let mut add = |name, meaning, keys, make: fn(&SourceTable) -> Made<Received>| {
        registry.receivers.add(Kind { name, meaning, keys }, make);
    };
    let keys = ["carries", "input"].map(optional).into();
    add("program", "A program sends it by the robot's API, or by `omnibase send`", keys, |table| {
        let carries = table.carries.unwrap_or_default().into();
        Ok(Received { receiver: ReceiverPlan::Program, carries, input: Vec::new() })
    });
    let keys = vec![needed("address"), optional("peer")];
    add("datagram", "A pose in each UDP datagram of a plain form: motion capture", keys, datagram);
    let needs = ["server"].map(needed);
    let may =
        ["local_address", "multicast", "command_port", "data_port", "body", "body_id", "up_axis", "unit_m"];
    let keys = needs.into_iter().chain(may.map(optional)).collect();
    add("natnet", "A rigid body of OptiTrack's Motive, by its NatNet stream", keys, natnet);
    let keys = vec![needed("device")];
    add("mouse", "An optical mouse at the robot's computer, pressed to the floor", keys, |table| {
        let device = given(table.device.clone(), "device")?;
        let value = |name: &&str| SentPlan {
            name: (*name).to_owned(),
            unit: String::new(),
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
        };
        let input = MOUSE_VALUES.iter().map(value).collect();
        Ok(Received { receiver: ReceiverPlan::Mouse { device }, carries: Carries::Values, input })
    });
}

fn datagram(table: &SourceTable) -> Made<Received> {
    let address: SocketAddr = parsed(
        &given(table.address.clone(), "address")?,
        "address",
        "an address with a port, as 192.168.1.10:8500",
    )?;
    let peer = match &table.peer {
        Some(peer) => parsed(peer, "peer", "an address without a port")?,
        None if address.ip().is_loopback() => address.ip(),
        None => {
            let reason = "whoever reaches this address could say where the platform is: name who may";
            return Err(Problem::missing("peer", reason).into());
        }
    };
    let receiver = ReceiverPlan::Datagram(DatagramPlan { address, peer });
    Ok(Received { receiver, carries: Carries::Pose, input: Vec::new() })
}

fn natnet(table: &SourceTable) -> Made<Received> {
    let address = |value: &Option<String>, key| {
        value
            .as_deref()
            .map(|text| parsed::<Ipv4Addr>(text, key, "an IPv4 address without a port"))
            .transpose()
    };
    let server = given(address(&table.server, "server")?, "server")?;
    let multicast = address(&table.multicast, "multicast")?;
    if let Some(group) = multicast.filter(|group| !group.is_multicast()) {
        let problem = Problem::refused("multicast", "it is no group");
        let limit = Some("224.0.0.0 to 239.255.255.255".into());
        return Err(Problem { value: Some(format!("\"{group}\"")), limit, ..problem }.into());
    }
    let body = match (&table.body, table.body_id) {
        (Some(name), None) => BodyChoice::Name(name.clone()),
        (None, Some(id)) => BodyChoice::Id(id),
        (None, None) => {
            return Err(
                Problem::missing("body", "which rigid body the platform is: `body` or `body_id`").into()
            );
        }
        (Some(_), Some(_)) => {
            let reason = "give `body` or `body_id`, not both";
            return Err(Problem::new(ProblemKind::Contradiction, "body", reason).into());
        }
    };
    let [command_port, data_port] = NATNET_PORTS;
    let receiver = ReceiverPlan::NatNet(NatNetPlan {
        server,
        local: address(&table.local_address, "local_address")?.unwrap_or(Ipv4Addr::UNSPECIFIED),
        multicast,
        command_port: table.command_port.unwrap_or(command_port),
        data_port: table.data_port.unwrap_or(data_port),
        body,
        up_axis: table.up_axis.unwrap_or_default(),
        unit_m: table.unit_m.unwrap_or(1.0),
    });
    Ok(Received { receiver, carries: Carries::Pose, input: Vec::new() })
}

/// A text that must be an address.
fn parsed<T: FromStr<Err: Display>>(text: &str, key: &str, expected: &str) -> Made<T> {
    text.parse().map_err(|error: T::Err| {
        let problem = Problem::refused(key, error);
        Problem { value: Some(format!("\"{text}\"")), limit: Some(expected.into()), ..problem }.into()
    })
}
