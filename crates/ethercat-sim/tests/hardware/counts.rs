//! What a cycle of a segment costs in instructions. What it is in a release `cargo bench -p omnibase-ethercat-sim` prints.

#[path = "../../../trials/tests/callgrind.rs"]
mod callgrind;

use crate::cycle::Cycle;

const SUB_DEVICES: u16 = 20;
const MOST: u64 = 49_000;

#[test]
fn a_cycle_of_twenty_sub_devices_costs_no_more_instructions_than_it_may() {
    let test = "counts::a_cycle_of_twenty_sub_devices_costs_no_more_instructions_than_it_may";
    callgrind::a_cycle_costs_at_most(MOST, test, &[], [200, 400], |cycles| {
        let mut cycle = Cycle::new(SUB_DEVICES);
        (0..cycles).for_each(|_| cycle.run());
    });
}
