//! Any bytes as a recorded joystick: whatever it says, it drives only while its dead-man button is held, and within 1.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_joystick::{Device, Finder, Hold, Joystick, Map, Port, Recorded};
use omnibase_robot::config::JoystickTable;

const AGE_NS: u64 = 200_000_000;
const TURN_NS: u64 = 10_000_000;
const TURNS: u64 = 200;

struct Once(Option<(Box<dyn Device>, Map)>);

impl Finder for Once {
    fn find(&mut self) -> Option<(Box<dyn Device>, Map)> {
        self.0.take()
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Ok(recorded) = Recorded::from_bytes(bytes) else { return };
    let Ok(map) = Map::of(&JoystickTable::default(), recorded.description()) else { return };
    let dead_man = map.dead_man.expect("required by default");
    let mut port = Port::new(Once(Some((Box::new(recorded), map))), Joystick::new(AGE_NS));
    for turn in 0..TURNS {
        let (command, _) = port.turn(turn * TURN_NS);
        assert!(command.twist.iter().all(|part| part.abs() <= 1.0), "{command:?}");
        match command.hold {
            Hold::Held => {
                let state = port.joystick().state().expect("a joystick that is held is there");
                assert!(state.pressed.contains(&dead_man.0) && command.block.is_none(), "{command:?}");
            }
            Hold::Released => assert_eq!(command.twist, [0.0; 3]),
        }
    }
});
