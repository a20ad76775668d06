//! What a drive holds that lost its supply while the set-up goes on.

use omnibase_ethercat_sim::Fault;

use super::*;

/// Holds the key; takes the supply of one drive while it is enabled, or where it is asked for.
struct Switches<'a> {
    injector: &'a Injector,
    cycles: u32,
    is_dark: bool,
    /// What it stored by itself is written into it when it is on again.
    stores: Option<&'a dyn Fn()>,
}

impl Hand for Switches<'_> {
    fn ask(&mut self, question: &Question) -> Answer {
        let said = match question.id.split(' ').next().unwrap() {
            "name" => "alias",
            "alias" => "",
            // Said too early first: it is asked again.
            "power" | "release" => {
                let fault_is_on = std::mem::replace(&mut self.is_dark, true);
                let fault = if fault_is_on { Fault::PowerOn } else { Fault::PowerOff };
                self.injector.inject(0, fault);
                if fault_is_on {
                    self.stores.iter().for_each(|store| store());
                }
                "done"
            }
            "stopped" => "yes",
            // The third drive kept its supply.
            "dark" => "go on",
            other => panic!("{other}"),
        };
        Answer::Text(said.to_owned())
    }

    fn tell(&mut self, _: &str) {}

    fn take_key(&mut self, _: &str) {}

    fn key(&mut self) -> crate::Key {
        self.cycles += 1;
        if self.cycles == 600 {
            self.injector.inject(0, Fault::PowerOff);
        }
        crate::Key::Beat
    }
}

/// Switched off and on for its alias, or by the emergency stop, a drive holds what is stored in it: that stays, not what it held before.
/// But one that stores by itself holds the jog's limit: that isn't its own.
#[test]
fn a_drive_that_lost_its_supply_keeps_what_is_stored_in_it() {
    for (is_stop, is_jogs) in [(false, false), (true, false), (false, true)] {
        let tables = "[[subdevice]]\nkind = \"servo\"\n[[subdevice]]\nkind = \"servo\"\nalias = 9\ncount = 1\n\
                      [[subdevice]]\nkind = \"servo\"\n";
        let (link, clock, injector) = faulty_segment_of(tables);
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        let stored = max_torques(&link, &clock)[0];
        let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
        for position in 0..3 {
            by_tool(&link, &clock).sdo_write(position, torque, &1100_u16.to_le_bytes()).unwrap();
        }
        let store = || by_tool(&link, &clock).sdo_write(0, torque, &100_u16.to_le_bytes()).unwrap();
        let stores = is_jogs.then_some(&store as &dyn Fn());
        let mut hand = Switches { injector: &injector, cycles: 0, is_dark: false, stores };
        with_found(BASE, &mut open, &mut hand, |guide| {
            let wheels = if is_stop { &["wheel_1"][..] } else { &["wheel_1", "wheel_2", "wheel_3"] };
            for (drive, wheel) in guide.record.drives.iter_mut().zip(wheels) {
                drive.wheel = Some((*wheel).to_owned());
            }
            guide.operational().unwrap();
            assert_eq!(guide.who_lost_supply().unwrap(), (3, Vec::new()));
            assert!(if is_stop { guide.stop_all() } else { guide.name_all() }.unwrap());
            assert_eq!(guide.record.drives[0].is_stopped, is_stop.then_some(true));
            guide.leave_as_found();
            assert_eq!(guide.record.jogged, []);
        });
        assert_ne!(stored, 1100);
        let first = if is_jogs { 1100 } else { stored };
        assert_eq!(max_torques(&link, &clock), [first, 1100, 1100], "{is_stop} {is_jogs}");
    }
}

/// Who didn't get back what he held is told in one line where one thing keeps all from it.
#[test]
fn drives_that_wait_for_one_reason_are_told_together() {
    let (link, clock, injector) = faulty_segment_of("[[subdevice]]\nkind = \"servo\"\ncount = 3\n");
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut hand = Notes::new(|_| None);
    with_found(BASE, &mut open, &mut hand, |guide| {
        guide.operational().unwrap();
        injector.inject(0, Fault::PowerOff);
        guide.after_motion(false);
    });
    let begins = "what was held before the motion isn't put back yet into SubDevice 0, 1, 2: ";
    let told: Vec<&String> = hand.told.iter().filter(|text| text.contains("before the motion")).collect();
    assert!(told.len() == 1 && told[0].starts_with(begins), "{told:?}");
}
