//! Logical addressing: bytes, bits, overlaps, working counters.

use crate::bench::{Bench, fmmu, idle, sync_manager};
use omnibase_ethercat_sim::EscConfig;
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Command};

const READ: u8 = 1;
const WRITE: u8 = 2;

fn logical(bench: &mut Bench, command: Command, address: u32, data: &[u8]) -> (Vec<u8>, u16) {
    let answer = bench.send(command, Address::Logical(address), data);
    (answer.data, answer.counter)
}

fn with(fmmus: &[[u8; 16]]) -> Bench {
    let mut bench = Bench::single(EscConfig::default(), idle());
    for (n, registers) in fmmus.iter().enumerate() {
        assert_eq!(bench.fpwr(0x1001, reg::FMMU + 16 * n as u16, registers), 1);
    }
    bench
}

#[test]
fn a_datagram_reaches_the_part_that_it_covers() {
    let mut bench = with(&[fmmu(0x1_0004, 4, [0, 7], 0x1000, 0, READ | WRITE)]);
    bench.fpwr(0x1001, 0x1000, &[1, 2, 3, 4]);
    assert_eq!(logical(&mut bench, Command::Lrd, 0x1_0000, &[9; 8]), (vec![9, 9, 9, 9, 1, 2, 3, 4], 1));
    assert_eq!(logical(&mut bench, Command::Lrd, 0x1_0006, &[9; 4]), (vec![3, 4, 9, 9], 1));
    assert_eq!(logical(&mut bench, Command::Lrd, 0x1_0008, &[9; 4]), (vec![9; 4], 0));
    assert_eq!(logical(&mut bench, Command::Lwr, 0x1_0006, &[7; 1]), (vec![7], 1));
    assert_eq!(bench.fprd(0x1001, 0x1000, 4), Some(vec![1, 2, 7, 4]));
}

#[test]
fn lrw_counts_one_for_a_read_and_two_for_a_write() {
    let mut bench = with(&[fmmu(0, 2, [0, 7], 0x1000, 0, WRITE), fmmu(2, 2, [0, 7], 0x1100, 0, READ)]);
    bench.fpwr(0x1001, 0x1100, &[5, 6]);
    assert_eq!(logical(&mut bench, Command::Lrw, 0, &[1, 2, 0, 0]), (vec![1, 2, 5, 6], 3));
    assert_eq!(logical(&mut bench, Command::Lrw, 0, &[3, 4]), (vec![3, 4], 2));
    assert_eq!(logical(&mut bench, Command::Lrw, 2, &[0, 0]), (vec![5, 6], 1));
    assert_eq!(bench.fprd(0x1001, 0x1000, 2), Some(vec![3, 4]));
}

#[test]
fn outputs_and_inputs_may_share_logical_addresses() {
    // Inputs first in number: outputs must still be what was sent.
    let mut bench = with(&[fmmu(0, 2, [0, 7], 0x1100, 0, READ), fmmu(0, 2, [0, 7], 0x1000, 0, WRITE)]);
    bench.fpwr(0x1001, 0x1100, &[5, 6]);
    assert_eq!(logical(&mut bench, Command::Lrw, 0, &[1, 2]), (vec![5, 6], 3));
    assert_eq!(bench.fprd(0x1001, 0x1000, 2), Some(vec![1, 2]));
}

#[test]
fn one_fmmu_in_both_directions_exchanges() {
    let mut bench = with(&[fmmu(0, 2, [0, 7], 0x1000, 0, READ | WRITE)]);
    bench.fpwr(0x1001, 0x1000, &[5, 6]);
    assert_eq!(logical(&mut bench, Command::Lrw, 0, &[1, 2]), (vec![5, 6], 3));
    assert_eq!(bench.fprd(0x1001, 0x1000, 2), Some(vec![1, 2]));
}

#[test]
fn bits_are_read_and_their_neighbours_left_alone() {
    // Physical bits 3..=12 to logical bits 6..=15 of two bytes.
    let mut bench = with(&[fmmu(0, 2, [6, 7], 0x1000, 3, READ)]);
    bench.fpwr(0x1001, 0x1000, &[0b1010_1000, 0b1111_0101]);
    // 10 bits from bit 3: 1 0 1 0 1 | 1 0 1 0 1, lowest first.
    assert_eq!(logical(&mut bench, Command::Lrd, 0, &[0, 0]), (vec![0b0100_0000, 0b1010_1101], 1));
    assert_eq!(logical(&mut bench, Command::Lrd, 0, &[0xFF, 0xFF]), (vec![0b0111_1111, 0b1010_1101], 1));
    assert_eq!(logical(&mut bench, Command::Lrd, 1, &[0]), (vec![0b1010_1101], 1));
}

#[test]
fn bits_are_written_and_their_neighbours_left_alone() {
    let mut bench = with(&[fmmu(0, 1, [1, 4], 0x1000, 6, WRITE)]);
    bench.fpwr(0x1001, 0x1000, &[0xFF, 0xFF, 0xFF]);
    assert_eq!(logical(&mut bench, Command::Lwr, 0, &[0b1110_1001]).1, 1);
    // Bits 1..=4 are 0, 0, 1, 0: they go to bits 6, 7 of the first and 0, 1 of the second byte.
    assert_eq!(bench.fprd(0x1001, 0x1000, 3), Some(vec![0b0011_1111, 0b1111_1101, 0xFF]));
}

#[test]
fn two_fmmus_write_bits_of_one_guarded_byte() {
    let mut bench = with(&[fmmu(0, 1, [0, 3], 0x1000, 0, WRITE), fmmu(1, 1, [0, 3], 0x1000, 4, WRITE)]);
    bench.fpwr(0x1001, reg::SM, &sync_manager(0x1000, 1, 0x24));
    for (byte, value) in [(0, 0x05), (1, 0x0A), (0, 0x03)] {
        assert_eq!(logical(&mut bench, Command::Lwr, byte, &[value]).1, 1);
    }
    assert_eq!(bench.pdi_read(0x1000, 1), [0xA3]);
}

#[test]
fn a_register_bit_can_be_mapped() {
    // The full flag of a mailbox: the usual use of bit-wise mapping.
    let mut bench = with(&[fmmu(0x20, 1, [5, 5], 0x080D, 3, READ)]);
    bench.fpwr(0x1001, reg::SM + 8, &sync_manager(0x1080, 8, 0x22));
    assert_eq!(logical(&mut bench, Command::Lrd, 0x20, &[0]), (vec![0], 1));
    bench.pdi_write(0x1080, &[1; 8]);
    assert_eq!(logical(&mut bench, Command::Lrd, 0x20, &[0]), (vec![0x20], 1));
}

#[test]
fn denied_memory_does_not_count() {
    let mut bench = with(&[fmmu(0, 8, [0, 7], 0x1000, 0, WRITE)]);
    bench.fpwr(0x1001, reg::SM, &sync_manager(0x1000, 8, 0x26));
    assert_eq!(logical(&mut bench, Command::Lwr, 0, &[1; 8]).1, 1);
    assert_eq!(logical(&mut bench, Command::Lwr, 0, &[2; 8]).1, 0, "the mailbox is full");
    assert_eq!(bench.pdi_read(0x1000, 8), [1; 8]);
}

#[test]
fn image_parts_in_separate_datagrams_make_one_buffer() {
    let mut bench = with(&[fmmu(0, 4, [0, 7], 0x1000, 0, WRITE)]);
    bench.fpwr(0x1001, reg::SM, &sync_manager(0x1000, 4, 0x24));
    assert_eq!(logical(&mut bench, Command::Lwr, 0, &[1, 2]).1, 1);
    assert_eq!(bench.pdi_read(0x1000, 4), [0; 4], "half a buffer is none");
    assert_eq!(logical(&mut bench, Command::Lwr, 2, &[3, 4]).1, 1);
    assert_eq!(bench.pdi_read(0x1000, 4), [1, 2, 3, 4]);
}

#[test]
fn fmmus_beyond_the_count_and_at_the_end_of_the_address_space() {
    let mut bench = Bench::single(EscConfig { fmmu_count: 1, ..EscConfig::default() }, idle());
    let last = fmmu(0xFFFF_FFFC, 8, [0, 7], 0xFFFE, 0, READ | WRITE);
    assert_eq!(bench.fpwr(0x1001, reg::FMMU, &last), 1);
    assert_eq!(bench.fpwr(0x1001, reg::FMMU + 16, &last), 0);
    assert_eq!(logical(&mut bench, Command::Lrw, 0xFFFF_FFFC, &[1; 16]), (vec![1; 16], 0));
    let bits = fmmu(0xFFFF_FFFF, 0xFFFF, [7, 6], 0xFFFF, 7, READ | WRITE);
    assert_eq!(bench.fpwr(0x1001, reg::FMMU, &bits), 1);
    assert_eq!(logical(&mut bench, Command::Lrw, 0xFFFF_FFFF, &[1; 1400]).1, 0);
}
