//! Limits that a person sets lower while the robot drives.

use std::cell::Cell;
use std::rc::Rc;

use crate::hands::{Hands, played};
use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::signals::Frame;
use omnibase_run::live::{Ask, Client, Live, Snapshot, StickWish};

fn set_torque(live: &Live, limit_nm: f64) {
    let (index, _) = live.snapshot().setting("wheel_torque_nm").expect("it can be set");
    assert!(live.set(Client::Command, &[(index, limit_nm)]).is_some());
}

fn stick(vx_m_s: f64) -> StickWish {
    StickWish::Held { twist: Twist2::new(vx_m_s, 0.0, 0.0), frame: Frame::Body }
}

#[test]
fn a_lower_torque_limit_reaches_drives_that_drive() {
    let greatest = [(); 2].map(|()| Rc::new(Cell::new(0.0_f64)));
    let seen_by = greatest.clone();
    let run = played(4.0, move |hands: &mut Hands| {
        let [before, lowered] = seen_by;
        let look = |greatest: Rc<Cell<f64>>| {
            move |_: &Live, seen: &Snapshot| {
                let drives = seen.record.measurements.present().iter();
                let torque_nm = drives.map(|drive| drive.torque_nm.abs()).fold(0.0, f64::max);
                greatest.set(greatest.get().max(torque_nm));
            }
        };
        hands.send(0.5, Client::Joystick, Ask::Robot(RequestKind::Enable));
        // There and back: the wheels are accelerated hard before and after.
        hands.stick(1.0, 1.6, Client::Joystick, stick(0.5));
        hands.between(1.0, 1.6, look(before));
        hands.at(1.7, |live, _| set_torque(live, 1.5));
        hands.stick(1.75, 2.6, Client::Joystick, stick(-0.5));
        hands.between(1.75, 2.6, look(lowered));
    });
    let [before, lowered] = greatest.map(|greatest| greatest.get());
    assert!(before > 3.0, "{before} N·m");
    // 1.5 of 7 N·m rated is 214 of the drive's units: 1.498 N·m.
    assert!((lowered - 1.498).abs() < 1e-6, "{lowered} N·m");
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
}
