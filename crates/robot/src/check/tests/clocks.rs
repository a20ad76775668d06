//! Events of distributed clocks and longest waits, as a maker's file gives them.

use std::time::Duration;

use omnibase_ethercat::config::{DcConfig, SyncMode, Timeouts};
use omnibase_ethercat::start_up::SdoAccess;

use super::*;

const IO: &str = include_str!("../../../../../robots/bmm_io.toml");

/// The file with keys of its first drive, and of its device `supply`.
fn with(drive: &str, supply: &str) -> String {
    let text = IO.replacen("name = \"wheel_1\"\n", &format!("name = \"wheel_1\"\n{drive}\n"), 1);
    text.replacen("name = \"supply\"", &format!("{supply}\nname = \"supply\""), 1)
}

#[test]
fn modes_of_a_makers_file_are_what_the_bus_is_asked() {
    let plan = check(&with(
        "dc = { assign_activate = \"0x0730\", sync0_per_cycle = 4, sync1_every = 4, sync1_shift_us = 20 }\n\
         timeouts = { pre_op_ms = 4000, safe_op_op_ms = 15_000, mailbox_ms = 250 }",
        "every = 10\ndc = { sync0_shift_us = 300 }\ntimeouts = { init_ms = 7000 }",
    ))
    .unwrap_or_else(|problems| panic!("{}", show(&problems)));
    let drive = plan.drives[0].subdevice_config(&plan.bus);
    let dc = DcConfig::Sync0And1 { cycle_ns: 250_000, shift_ns: 500_000, sync1_cycle_ns: 770_000 };
    assert_eq!((drive.dc, drive.assign_activate, drive.sync_mode), (dc, Some(0x0730), None));
    // SYNC1 comes 20 us behind the first SYNC0, half a cycle from the frames; the others read their encoders before it.
    let beats = |dc: &DcPlan| dc.last_beat_ns(1_000_000, 0);
    assert_eq!(plan.drives[0].dc.as_ref().map(beats), Some(480_000));
    assert_eq!(plan.input_age_ns(), 500_000);
    let four = DcPlan { sync0_per_cycle: 4, ..DcPlan::sync0(500_000) };
    assert_eq!(beats(&four), 250_000, "the one at the frames is too late for them");
    assert_eq!(beats(&DcPlan { sync0_per_cycle: 5, ..four }), 100_000);
    // A device's own SYNC0 at 300 us, and frames at 200.
    assert_eq!(DcPlan::sync0(300_000).last_beat_ns(10_000_000, 200_000), 9_900_000);
    let ms = |ms| Some(Duration::from_millis(ms));
    let waits = Timeouts { init: None, pre_op: ms(4000), safe_op_op: ms(15_000), mailbox: ms(250) };
    assert_eq!(drive.timeouts, waits);
    let other = plan.drives[1].subdevice_config(&plan.bus);
    assert_eq!(other.dc, DcConfig::Sync0 { cycle_ns: 1_000_000, shift_ns: 500_000 });
    assert_eq!((other.assign_activate(), other.sync_mode), (0x0300, Some(SyncMode::Sync0)));
    let supply = plan.devices.iter().find(|one| one.name == "supply").unwrap().subdevice_config(&plan.bus);
    assert_eq!(supply.dc, DcConfig::Sync0 { cycle_ns: 10_000_000, shift_ns: 300_000 });
    assert_eq!((supply.timeouts.init, supply.sync_mode), (ms(7000), None));
}

#[test]
fn modes_that_cant_be_are_refused_with_what_was_expected() {
    let bits = "bits 8 and 9 (SYNC0), bit 10 with SYNC1, bit 0 clear, such as \"0x0300\" or \"0x0700\"";
    for (drive, supply, setting, value, expected) in [
        ("dc = { assign_activate = \"0x0100\" }", "", "drive[0].dc.assign_activate", "\"0x0100\"", bits),
        ("dc = { assign_activate = \"0x0701\" }", "", "drive[0].dc.assign_activate", "\"0x0701\"", bits),
        ("dc = { assign_activate = \"0x10300\" }", "", "drive[0].dc.assign_activate", "\"0x10300\"", bits),
        ("dc = { sync1_shift_us = 5 }", "", "drive[0].dc.assign_activate", "\"0x0300\"", bits),
        ("dc = { sync0_shift_us = 5 }", "", "drive[0].dc.sync0_shift_us", "5", "500, or no such key"),
        (
            "dc = { sync0_per_cycle = 3 }",
            "",
            "drive[0].dc.sync0_per_cycle",
            "3",
            "a divisor of its cycle of 1000000 ns",
        ),
        (
            "dc = { assign_activate = \"0x0700\", sync0_per_cycle = 4, sync1_every = 3 }",
            "",
            "drive[0].dc.sync1_every",
            "3",
            "a multiple or a divisor of sync0_per_cycle = 4",
        ),
        (
            "dc = { assign_activate = \"0x0700\", sync0_per_cycle = 4, sync1_shift_us = 250 }",
            "",
            "drive[0].dc.sync1_shift_us",
            "250",
            "below 250, from one SYNC0 to the next",
        ),
        (
            "",
            "every = 300\ndc = { assign_activate = \"0x0700\", sync1_every = 100 }",
            "device[3].dc.sync1_every",
            "100",
            "at most 15",
        ),
        (
            "",
            "dc = { sync0_shift_us = 1000 }",
            "device[3].dc.sync0_shift_us",
            "1000",
            "below cycle_us = 1000",
        ),
    ] {
        let problems = problems(&with(drive, supply));
        let (problem, ..) = found(&problems, setting);
        let told = (problem.value.as_deref(), problem.limit.as_deref());
        assert_eq!(told, (Some(value), Some(expected)), "{drive} {supply}: {}", problem.reason);
    }
    let text = with("dc = { assign_activate = \"0x0300\" }", "");
    let by_frames = text.replace("synchronisation = \"sync0\"", "synchronisation = \"sync_manager_event\"");
    let problems = problems(&by_frames);
    let (problem, ..) = found(&problems, "drive[0].dc");
    assert!(problem.reason.contains("synchronisation = \"sync0\""), "{}", problem.reason);
}

#[test]
fn a_whole_object_is_written_at_once_where_it_is_asked() {
    let keys = "parameters = [{ object = \"0xF030.0\", bytes = \"0200 01000000 02000000\", complete_access = true }]";
    let plan = check(&with("", keys)).unwrap_or_else(|problems| panic!("{}", show(&problems)));
    let supply = plan.devices.iter().find(|one| one.name == "supply").unwrap().subdevice_config(&plan.bus);
    let sdo = supply.sdos.iter().find(|sdo| sdo.object.index == 0xF030).unwrap();
    assert_eq!((sdo.access, sdo.data.len()), (SdoAccess::Complete, 10));
    for keys in [
        "parameters = [{ object = \"0xF030.0\", type = \"u8\", value = 2, complete_access = true }]",
        "parameters = [{ object = \"0xF030.2\", bytes = \"01\", complete_access = true }]",
    ] {
        let problems = problems(&with("", keys));
        let (problem, ..) = found(&problems, "device[3].parameters[0].complete_access");
        assert!(problem.reason.contains("as `bytes`, from its subindex 0 or 1 on"), "{}", problem.reason);
    }
}

#[test]
fn keys_that_moved_into_the_table_dc_are_told_with_it() {
    let told = show(&check(&with("", "sync0 = true\nsync0_shift_us = 300")).expect_err("they have moved"));
    for words in [
        ".sync0: its clock's events stand in its table `dc` now: write `dc = { assign_activate = \"0x0300\" }`",
        ".sync0_shift_us: it stands in the table `dc` now: write `dc = { sync0_shift_us = … }`",
    ] {
        assert!(told.contains(words), "{told}");
    }
}
