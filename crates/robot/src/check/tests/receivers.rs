//! How values of sources come in: what each kind reads, needs and refuses.

use std::net::Ipv4Addr;

use super::*;
use crate::config::{BodyChoice, ReceiverPlan, UpAxis};
use crate::signals::Carries;

/// The shipped robot with a source more.
fn with(source: &str) -> String {
    format!("{MECANUM}\n[[source]]\nname = \"heard\"\n{source}\n")
}

fn received(source: &str) -> SourcePlan {
    let plan = check(&with(source)).unwrap_or_else(|problems| panic!("{}", show(&problems)));
    plan.sources[0].clone()
}

#[test]
fn each_kind_brings_its_own_values() {
    let program = received("input = [{ name = \"open\" }]");
    assert_eq!((program.receiver, program.input.len()), (ReceiverPlan::Program, 1));
    let datagram = received("receiver = \"datagram\"\naddress = \"127.0.0.1:8500\"");
    assert_eq!((datagram.carries, datagram.input.len()), (Carries::Pose, 9));
    let ReceiverPlan::Datagram(plan) = datagram.receiver else { panic!() };
    assert_eq!(plan.peer, plan.address.ip(), "on loopback whoever is on this machine");
    let mouse = received("receiver = \"mouse\"\ndevice = \"/dev/input/by-id/usb-Maker_Mouse-event-mouse\"");
    assert_eq!(mouse.input.iter().map(|sent| sent.name.as_str()).collect::<Vec<_>>(), ["x", "y"]);
    let natnet = received(
        "receiver = \"natnet\"\nserver = \"192.168.1.20\"\nbody = \"robot\"\nup_axis = \"z\"\nmulticast = \"239.255.42.99\"",
    );
    let ReceiverPlan::NatNet(plan) = natnet.receiver else { panic!() };
    assert_eq!((plan.server, plan.command_port), (Ipv4Addr::new(192, 168, 1, 20), 1510));
    assert_eq!((plan.data_port, plan.up_axis, plan.unit_m), (1511, UpAxis::Z, 1.0));
    assert_eq!(
        (plan.body, plan.multicast),
        (BodyChoice::Name("robot".into()), Some(Ipv4Addr::new(239, 255, 42, 99)))
    );
}

#[test]
fn what_is_wrong_is_told_with_what_was_expected() {
    let natnet = "receiver = \"natnet\"\nserver = \"192.168.1.20\"\n";
    for (source, setting, words) in [
        ("receiver = \"natnett\"", "receiver", "did you mean `natnet`?"),
        ("receiver = \"datagram\"", "address", "`datagram` needs it"),
        ("receiver = \"datagram\"\naddress = \"0.0.0.0:8500\"", "peer", "name who may"),
        ("receiver = \"datagram\"\naddress = \"here\"\npeer = \"::1\"", "address", "an address with a port"),
        (
            "receiver = \"datagram\"\naddress = \"127.0.0.1:8500\"\ncarries = \"pose\"",
            "carries",
            "`datagram` doesn't read it",
        ),
        ("receiver = \"mouse\"\ndevice = \"m\"\nbody_id = 1", "body_id", "`mouse` doesn't read it"),
        (natnet, "body", "`body` or `body_id`"),
        (&format!("{natnet}body = \"a\"\nbody_id = 1"), "body", "not both"),
        (
            &format!("{natnet}body_id = 1\nmulticast = \"192.168.1.1\""),
            "multicast",
            "224.0.0.0 to 239.255.255.255",
        ),
        (&format!("{natnet}body_id = 1\nlocal_address = \"eth0\""), "local_address", "an IPv4 address"),
        ("input = [{ name = \"open\" }]\npeer = \"::1\"", "peer", "`program` doesn't read it"),
    ] {
        let problems = problems(&with(source));
        let setting = format!("source[0].{setting}");
        let told = problems.iter().find(|problem| problem.setting == setting);
        let told = told.unwrap_or_else(|| panic!("{setting}: {}", show(&problems))).to_string();
        assert!(told.contains(words), "{setting}: {told}");
    }
}
