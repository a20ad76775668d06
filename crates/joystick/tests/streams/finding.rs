//! Folders of devices, as far as they can be looked at without one.

use std::path::Path;

use omnibase_joystick::find::list;
use omnibase_joystick::{Finder, Installed};
use omnibase_robot::config::JoystickTable;

#[test]
fn event_devices_are_listed_by_their_numbers_with_what_is_wrong() {
    let folder = std::env::temp_dir().join(format!("omnibase-input-{}", std::process::id()));
    std::fs::create_dir(&folder).expect("a folder");
    for name in ["event10", "event2", "mice", "eventx", "js0"] {
        std::fs::write(folder.join(name), []).expect("a file");
    }
    let listed = list(&folder).expect("readable");
    std::fs::remove_dir_all(&folder).expect("its own");
    let names: Vec<_> = listed.iter().filter_map(|listed| listed.path.file_name()).collect();
    assert_eq!(names, ["event2", "event10"]);
    // They are no devices.
    assert!(listed.iter().all(|listed| listed.description.is_err()));
}

#[test]
fn where_there_are_no_input_devices_the_list_is_empty() {
    assert!(list(Path::new("/nowhere/input")).expect("no error").is_empty());
}

#[test]
fn a_named_device_that_is_not_there_is_awaited_and_named_when_it_must_be_there() {
    let path = "/dev/input/event-of-nobody";
    let mut finder = Installed::new(JoystickTable { device: Some(path.into()), ..JoystickTable::default() });
    assert!(finder.find().is_none());
    let Err(error) = finder.open(Path::new(path)) else { panic!("there is one") };
    assert!(error.to_string().starts_with("/dev/input/event-of-nobody: No such file"), "{error}");
}
