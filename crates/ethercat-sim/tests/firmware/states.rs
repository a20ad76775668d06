//! AL states: every check has its code.

use crate::rig::{FIRST, Rig, SERVO, SGDV, fmmu, sync_manager};
use omnibase_ethercat_sim::device::drive::DriveKind;

#[test]
fn a_servo_goes_up_and_down_and_exchanges_process_data() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.to_op(FIRST, SERVO);
    for _ in 0..20 {
        rig.outputs(FIRST, &[6, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xE8, 3, 8, 0]);
        rig.wait_us(1000);
    }
    let inputs = rig.inputs(FIRST, 16);
    assert_eq!(u16::from_le_bytes([inputs[0], inputs[1]]) & 0x6F, 0x21, "ready to switch on");
    assert_eq!(inputs[14], 8, "csp");
    assert_eq!(rig.request(FIRST, 4), (4, 0));
    assert_eq!(rig.request(FIRST, 2), (2, 0));
    assert_eq!(rig.request(FIRST, 1), (1, 0));
}

#[test]
fn an_sgdv_runs_with_sync0() {
    let mut rig = Rig::drive(DriveKind::Sgdv);
    rig.to_pre_op(FIRST);
    rig.process_data_on(FIRST, SGDV);
    rig.sync0_on(FIRST, 1_000_000, 20_000_000);
    assert_eq!(rig.request(FIRST, 4), (4, 0));
    rig.write(FIRST, 0x0120, &8u16.to_le_bytes());
    for _ in 0..60 {
        rig.outputs(FIRST, &[0; 20]);
        rig.wait_us(980);
    }
    assert_eq!(rig.state(FIRST), (8, 0));
    assert_eq!(rig.upload(FIRST, (0x1C32, 1)), Ok(2));
    let _ = (fmmu(0, 0, 0, 0), sync_manager(0, 0, 0));
}
