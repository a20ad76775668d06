//! EtherCrab drives the simulated segment over a virtual cable: OP, process data, SDOs, dictionary, SYNC0.

use omnibase_host::Namespace;
use omnibase_peers::{behind_a_cable, drives, ethercrab, makers};
use std::time::Duration;

fn reaches_op_with(count: usize) {
    let Some(namespace) = Namespace::for_test("EtherCrab over a virtual cable") else { return };
    let report = behind_a_cable(&namespace, drives("servo", count), || {
        ethercrab::drive(Namespace::NEAR, Duration::from_millis(5), 200)
    })
    .unwrap();
    assert_eq!(report.names.len(), count);
    assert!(report.dictionary > 30, "{} objects", report.dictionary);
    assert!(report.clock_difference_ns < 1000);
    // LRW counts 3 for each servo: 1 for its inputs, 2 for its outputs.
    assert_eq!(usize::from(report.working_counter), 3 * count);
    assert!(report.cycles >= 200);
}

#[test]
fn one_servo() {
    reaches_op_with(1);
}

#[test]
fn three_servos() {
    reaches_op_with(3);
}

#[test]
fn twenty_servos() {
    reaches_op_with(20);
}

#[test]
fn all_devices_and_modules_of_real_makers_files() {
    let Some(namespace) = Namespace::for_test("EtherCrab over a virtual cable") else { return };
    let Some(segments) = makers::segments() else { return };
    for made in segments {
        let makers::MadeOfFiles { segment, count, modules, commands } = made;
        let short = commands.iter().filter(|command| command.data.len() <= 4).count();
        let reached =
            behind_a_cable(&namespace, segment, || ethercrab::bring_up_with(Namespace::NEAR, &commands));
        println!("EtherCrab: {count} SubDevices with {modules} modules: {reached:?}");
        assert_eq!(reached, Ok((count, short)));
    }
}
