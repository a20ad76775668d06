//! SyncManagers in mailbox and three-buffer mode, from both sides.

use crate::bench::{Bench, idle, sync_manager};
use omnibase_ethercat_sim::EscConfig;
use omnibase_ethercat_wire::register::{self as reg, al_event};

const OUT: u16 = 0x1000;
const IN: u16 = 0x1080;

/// SM0 and SM1 as mailboxes of 16 bytes.
fn mailboxes() -> Bench {
    let mut bench = Bench::single(EscConfig::default(), idle());
    let both = [sync_manager(OUT, 16, 0x26), sync_manager(IN, 16, 0x22)].concat();
    assert_eq!(bench.fpwr(0x1001, reg::SM, &both), 1);
    bench
}

/// SM2 as outputs and SM3 as inputs of 4 bytes, three buffers each.
fn buffers() -> Bench {
    let mut bench = Bench::single(EscConfig::default(), idle());
    let both = [sync_manager(OUT, 4, 0x24), sync_manager(IN, 4, 0x20)].concat();
    assert_eq!(bench.fpwr(0x1001, reg::SM + 16, &both), 1);
    bench
}

#[test]
fn a_written_mailbox_is_full_until_the_firmware_read_its_last_byte() {
    let mut bench = mailboxes();
    let message: Vec<u8> = (1..=16).collect();
    assert_eq!(bench.number_at(0x1001, 0x0805, 1) & 0x08, 0);
    assert_eq!(bench.fpwr(0x1001, OUT, &message), 1);
    assert_eq!(bench.number_at(0x1001, 0x0805, 1), 0x39);
    assert_ne!(bench.al_event() & al_event::sync_manager(0), 0);
    // Full: a second message doesn't count and doesn't harm the first.
    assert_eq!(bench.fpwr(0x1001, OUT, &[0xFF; 16]), 0);
    assert_eq!(bench.pdi_read(OUT, 15), message[..15]);
    // The first byte acknowledges the event, the last one empties.
    assert_eq!(bench.al_event() & al_event::sync_manager(0), 0);
    assert_eq!(bench.fpwr(0x1001, OUT, &[0xFF; 16]), 0);
    assert_eq!(bench.pdi_read(OUT + 15, 1), [16]);
    assert_eq!(bench.number_at(0x1001, 0x0805, 1), 0x32);
    assert_eq!(bench.fpwr(0x1001, OUT, &[0xFF; 16]), 1);
}

#[test]
fn a_mailbox_is_written_from_its_first_byte_to_its_last() {
    let mut bench = mailboxes();
    assert_eq!(bench.fpwr(0x1001, OUT + 1, &[9; 15]), 0);
    assert_eq!(bench.fpwr(0x1001, OUT, &[1; 8]), 1);
    assert_eq!(bench.number_at(0x1001, 0x0805, 1) & 0x88, 0x80);
    assert_eq!(bench.al_event() & al_event::sync_manager(0), 0);
    assert_eq!(bench.fpwr(0x1001, OUT + 8, &[2; 8]), 1);
    assert_eq!(bench.number_at(0x1001, 0x0805, 1) & 0x88, 0x08);
    assert_eq!(bench.pdi_read(OUT, 16), [[1; 8], [2; 8]].concat());
}

#[test]
fn a_read_mailbox_is_empty_until_the_firmware_wrote_its_last_byte() {
    let mut bench = mailboxes();
    assert_eq!(bench.fprd(0x1001, IN, 16), None);
    bench.pdi_write(IN, &[7; 15]);
    assert_eq!(bench.fprd(0x1001, IN, 16), None);
    bench.pdi_write(IN + 15, &[8]);
    assert_eq!(bench.number_at(0x1001, 0x080D, 1) & 0x08, 0x08);
    assert_eq!(bench.fprd(0x1001, IN, 15), Some(vec![7; 15]));
    // What isn't read to its end stays; reading it whole empties it and tells the firmware.
    let whole = bench.fprd(0x1001, IN, 16).unwrap();
    assert_eq!((whole[0], whole[15]), (7, 8));
    assert_eq!(bench.number_at(0x1001, 0x080D, 1) & 0x08, 0);
    assert_ne!(bench.al_event() & al_event::sync_manager(1), 0);
    assert_eq!(bench.fprd(0x1001, IN, 16), None);
    bench.pdi_write(IN, &[9; 16]);
    assert_eq!(bench.al_event() & al_event::sync_manager(1), 0);
    assert_eq!(bench.fprd(0x1001, IN, 16), Some(vec![9; 16]));
}

#[test]
fn each_side_only_goes_its_own_direction() {
    let mut bench = mailboxes();
    assert_eq!(bench.fpwr(0x1001, IN, &[1; 16]), 0);
    bench.fpwr(0x1001, OUT, &[1; 16]);
    assert_eq!(bench.fprd(0x1001, OUT, 16), None);
    bench.pdi_write(OUT, &[5; 16]);
    assert_eq!(bench.pdi_read(OUT, 16), [1; 16]);
}

#[test]
fn repeat_requests_reach_the_firmware_and_its_answer_the_main_device() {
    let mut bench = mailboxes();
    bench.pdi_read(0x080E, 1);
    assert_eq!(bench.al_event() & al_event::SM_CHANGED, 0);
    assert_eq!(bench.fpwr(0x1001, 0x080E, &[0x03]), 1);
    assert_ne!(bench.al_event() & al_event::SM_CHANGED, 0);
    assert_eq!(bench.pdi_read(0x080E, 1), [0x03]);
    assert_eq!(bench.al_event() & al_event::SM_CHANGED, 0);
    bench.pdi_write(0x080F, &[0x02]);
    assert_eq!(bench.number_at(0x1001, 0x080F, 1), 0x02);
}

#[test]
fn an_enabled_sync_manager_keeps_its_settings() {
    let mut bench = mailboxes();
    // Only the activation byte of this write counts: the rest is locked.
    assert_eq!(bench.fpwr(0x1001, reg::SM, &[0; 8]), 1);
    assert_eq!(bench.number_at(0x1001, reg::SM, 8) & 0x00FF_00FF_FFFF_FFFF, 0x0000_0026_0010_1000);
    // Now it is off, and everything can be written.
    assert_eq!(bench.fpwr(0x1001, reg::SM, &[0; 8]), 1);
    assert_eq!(bench.number_at(0x1001, reg::SM, 5), 0);
}

#[test]
fn the_firmware_can_switch_a_sync_manager_off() {
    let mut bench = mailboxes();
    bench.pdi_write(0x0807, &[1]);
    assert_eq!(bench.number_at(0x1001, 0x0807, 1), 1);
    // Nothing guards the memory any more.
    assert_eq!(bench.fpwr(0x1001, OUT + 3, &[1]), 1);
    assert_eq!(bench.fprd(0x1001, OUT + 3, 1), Some(vec![1]));
    bench.pdi_write(0x0807, &[0]);
    assert_eq!(bench.fpwr(0x1001, OUT + 3, &[1]), 0);
}

#[test]
fn three_buffers_always_give_the_newest_whole_data() {
    let mut bench = buffers();
    assert_eq!(bench.number_at(0x1001, 0x0815, 1), 0x30);
    assert_eq!(bench.fpwr(0x1001, OUT, &[1; 4]), 1);
    assert_eq!(bench.fpwr(0x1001, OUT, &[2; 4]), 1);
    // The firmware starts to read while newer data comes: it keeps what it began with.
    assert_eq!(bench.pdi_read(OUT, 2), [2, 2]);
    for value in 3..=5 {
        assert_eq!(bench.fpwr(0x1001, OUT, &[value; 4]), 1);
    }
    assert_eq!(bench.pdi_read(OUT + 2, 2), [2, 2]);
    assert_eq!(bench.pdi_read(OUT, 4), [5; 4]);
    // Read again: still the newest.
    assert_eq!(bench.pdi_read(OUT, 4), [5; 4]);
}

#[test]
fn a_half_written_buffer_is_never_seen() {
    let mut bench = buffers();
    assert_eq!(bench.fprd(0x1001, IN, 4), None, "nothing was written yet");
    bench.pdi_write(IN, &[1; 4]);
    bench.pdi_write(IN, &[2; 3]);
    assert_eq!(bench.fprd(0x1001, IN, 4), Some(vec![1; 4]));
    bench.pdi_write(IN + 3, &[2]);
    assert_eq!(bench.fprd(0x1001, IN, 4), Some(vec![2; 4]));
    // A read that doesn't begin at the first byte finds no open buffer.
    assert_eq!(bench.fprd(0x1001, IN + 1, 3), None);
}

#[test]
fn the_other_buffers_are_out_of_reach() {
    let mut bench = buffers();
    for address in [OUT + 4, OUT + 11, IN + 4, IN + 11] {
        assert_eq!(bench.fprd(0x1001, address, 1), None, "0x{address:04x}");
        assert_eq!(bench.fpwr(0x1001, address, &[1]), 0, "0x{address:04x}");
    }
    assert_eq!(bench.fpwr(0x1001, OUT + 12, &[1]), 1);
}

#[test]
fn a_sync_manager_past_the_end_of_memory_denies_everything() {
    let mut bench = Bench::single(EscConfig { ram_kib: 1, ..EscConfig::default() }, idle());
    bench.fpwr(0x1001, reg::SM, &sync_manager(0x13F0, 0x100, 0x26));
    assert_eq!(bench.fpwr(0x1001, 0x13F0, &[0; 0x10]), 0);
    bench.fpwr(0x1001, reg::SM + 8, &sync_manager(0xFFFF, 0xFFFF, 0x64));
    assert_eq!(bench.fpwr(0x1001, 0xFFFF, &[0; 2]), 0);
}

#[test]
fn digital_outputs_are_guarded_registers_of_one_byte_each() {
    // As an EL2889 is set up: two SyncManagers of one byte, side by side, with watchdog.
    let mut bench = Bench::single(EscConfig::default(), idle());
    let both = [sync_manager(0x0F00, 1, 0x44), sync_manager(0x0F01, 1, 0x44)].concat();
    assert_eq!(bench.fpwr(0x1001, reg::SM, &both), 1);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_STATUS, 1), 0);
    assert_eq!(bench.fpwr(0x1001, 0x0F00, &[0x12, 0x34]), 1);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_STATUS, 1), 1);
    assert_eq!(bench.pdi_read(0x0F00, 2), [0x12, 0x34]);
    // Without a SyncManager they are plain registers.
    assert_eq!(bench.fpwr(0x1001, 0x0F02, &[0x56]), 1);
    assert_eq!(bench.fprd(0x1001, 0x0F02, 1), Some(vec![0x56]));
}
