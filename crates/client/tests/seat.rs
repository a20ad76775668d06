//! A seat at a robot that says what the test makes it say.

use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use omnibase_client::robots::{Endpoint, Found};
use omnibase_client::{Error, Frame, Heard, Seat};
use serde_json::{Value, json};
use tungstenite::Message;
use tungstenite::protocol::WebSocket;

struct Robot {
    socket: WebSocket<TcpStream>,
}

impl Robot {
    fn with_seat() -> (Robot, Seat) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let place = Endpoint::Address(listener.local_addr().unwrap());
        let robot = std::thread::spawn(move || {
            let socket = tungstenite::accept(listener.accept().unwrap().0).unwrap();
            let mut robot = Robot { socket };
            robot.say(json!({ "you": "page 1", "stick_bit": 1, "may": "command", "stamp": 0 }));
            robot
        });
        let found = Found { robot: String::new(), place, token: String::new() };
        let seat = Seat::take(&found).unwrap();
        (robot.join().unwrap(), seat)
    }

    fn say(&mut self, what: Value) {
        self.socket.send(Message::text(what.to_string())).unwrap();
    }

    /// The number of the next call, which is this.
    fn hears(&mut self, call: &str) -> u64 {
        let said: Value = serde_json::from_str(self.socket.read().unwrap().to_text().unwrap()).unwrap();
        assert_eq!(said["do"], call, "{said}");
        said["number"].as_u64().unwrap()
    }

    fn status(&mut self, seat: &mut Seat, stamp: u64, commander: &str) {
        let by_stick = commander != "nobody";
        self.say(
            json!({ "stamp": stamp, "commander": commander, "by_stick": by_stick, "blocked_sticks": 0 }),
        );
        assert!(matches!(seat.hear(Duration::from_secs(60)).unwrap(), Some(Heard::Status(_))));
    }

    fn answer(&mut self, seat: &mut Seat, number: u64, stamp: u64) {
        self.say(json!({ "answer": number, "done": true, "text": "done", "stamp": stamp }));
        assert!(matches!(seat.hear(Duration::from_secs(60)).unwrap(), Some(Heard::Answer(_))));
    }

    /// The robot follows the seat's stick, from this instant of its clock.
    fn follow(&mut self, seat: &mut Seat, stamp: u64) {
        let number = self.hears("release_stick");
        self.answer(seat, number, stamp - 1);
        self.drive(seat);
        self.status(seat, stamp, "page 1");
        assert!(seat.drives());
    }

    fn drive(&mut self, seat: &mut Seat) {
        seat.drive([0.1, 0.0, 0.0], Frame::Body, Instant::now()).unwrap();
        self.hears("drive");
    }
}

#[test]
fn what_was_said_before_a_let_go_is_no_stop_of_what_is_driven_after_it() {
    let (mut robot, mut seat) = Robot::with_seat();
    robot.follow(&mut seat, 10);
    seat.let_go().unwrap();
    let number = robot.hears("release_stick");
    robot.drive(&mut seat);
    // Said before the robot heard of it, and while it came to rest; the answer may overtake what is older.
    robot.status(&mut seat, 20, "page 1");
    assert!(!seat.drives());
    robot.status(&mut seat, 21, "nobody");
    robot.answer(&mut seat, number, 23);
    robot.status(&mut seat, 22, "page 1");
    robot.status(&mut seat, 23, "nobody");
    robot.drive(&mut seat);
    assert!(!seat.drives());
    robot.status(&mut seat, 24, "page 1");
    assert!(seat.drives());
}

#[test]
fn any_other_stop_ends_the_drive_until_the_stick_is_enabled() {
    let (mut robot, mut seat) = Robot::with_seat();
    robot.follow(&mut seat, 10);
    robot.status(&mut seat, 20, "nobody");
    let driven = seat.drive([0.1, 0.0, 0.0], Frame::Body, Instant::now());
    assert!(matches!(driven, Err(Error::Stopped(_))), "{driven:?}");
    seat.enable_stick().unwrap();
    robot.hears("enable_stick");
    robot.follow(&mut seat, 30);
}
