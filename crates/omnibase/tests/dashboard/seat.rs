//! A program at its seat: it sees every cycle, drives by twists, and whatever becomes of it stops what it drove.

use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use omnibase_client::robots::{Endpoint, Found};
use omnibase_client::{Error, Frame, Row, Seat, States, Wanted};
use serde_json::json;

use super::cycles_pass;
use super::robot::{Robot, TOKEN, is_too_old};

const LONGEST: Duration = Duration::from_secs(60);
/// A stick's age that a busy machine keeps.
const PATIENT: &str = "\n[safety]\ncommand_age_ms = 1000\n";

fn found(robot: &Robot) -> Found {
    let address = robot.at.trim_start_matches("http://").parse().unwrap();
    Found { robot: String::new(), place: Endpoint::Address(address), token: TOKEN.to_owned() }
}

/// The usual robot, more patient, that holds.
fn holding(folder: &std::path::Path) -> Robot {
    let file = folder.join("robot.toml");
    let usual = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
    std::fs::write(&file, std::fs::read_to_string(usual).unwrap() + PATIENT).unwrap();
    let robot = Robot::start_file(file.to_str().unwrap(), &[]);
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    robot
}

/// It stands, or swings to rest.
fn rests(robot: &Robot) -> bool {
    robot.speed_m_s() < 5e-3
}

/// So many rows of a robot.
fn rows(states: &mut States, count: usize) -> Vec<Row> {
    let (mut rows, begun) = (Vec::new(), Instant::now());
    while rows.len() < count {
        assert!(begun.elapsed() < LONGEST, "{} of {count} rows", rows.len());
        rows.extend(states.rows(LONGEST).unwrap());
    }
    rows
}

#[test]
fn every_cycle_is_followed_as_it_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (recorded, table) = (path("run.mcap"), path("run.csv"));
    let robot = Robot::start(&["--record", &recorded]);
    let wanted = Wanted { signals: vec!["state.*".into(), "wheel_*.torque*".into()], every_ms: None };
    let mut states = States::follow(&found(&robot), &wanted).unwrap();
    assert_eq!((states.robot(), states.cycle_ms()), ("bmm", 1.0));
    let names = states.names().to_vec();
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    let gone_to = json!({ "do": "go_to", "pose": [0.2, 0.1, 0.3] });
    assert_eq!(robot.call(&gone_to).1["done"], true);
    let followed = rows(&mut states, 1500);
    // Every cycle, or counted as missing; what the robot itself left out is no cycle.
    let left_out = robot.read("now")["counts"][2].as_u64().unwrap();
    let span_ms = (followed[followed.len() - 1].instant_ns - followed[0].instant_ns) / 1_000_000;
    let (seen, missing) = (followed.len() as u64 - 1, states.missing());
    println!(
        "{} cycles seen, {missing} missing, {left_out} left out by the robot, in {span_ms} ms",
        seen + 1
    );
    assert!(seen + missing <= span_ms && span_ms <= seen + missing + left_out, "{span_ms} ms");
    // Ten times as seldom: on multiples of 10 ms alone, where nothing is missing.
    let seldom = Wanted { signals: vec!["state.pose_x_m".into()], every_ms: Some(10.0) };
    let mut seldom = States::follow(&found(&robot), &seldom).unwrap();
    let tenth = rows(&mut seldom, 50);
    assert!(tenth.windows(2).all(|two| two[0].instant_ns / 10_000_000 < two[1].instant_ns / 10_000_000));
    assert_eq!(seldom.names(), ["state.pose_x_m"]);
    drop((states, seldom));
    robot.end();
    let exported = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["export", &recorded, "--signals", "state.*", "wheel_*.torque*", "--output", &table])
        .output()
        .unwrap();
    assert!(exported.status.success(), "{exported:?}");
    let text = std::fs::read_to_string(&table).unwrap();
    let mut lines = text.lines();
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(columns[columns.len() - names.len()..], names);
    let known: std::collections::BTreeMap<u64, Vec<u64>> = lines
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(|field| field.parse().unwrap_or(f64::NAN)).collect();
            let bits = |number: &f64| if number.is_nan() { 0 } else { number.to_bits() };
            let values = numbers[columns.len() - names.len()..].iter().map(bits).collect();
            ((numbers[0] * 1e9).round() as u64, values)
        })
        .collect();
    for row in &followed {
        let bits = |value: &f64| if value.is_nan() { 0 } else { value.to_bits() };
        let values: Vec<u64> = row.values.iter().map(bits).collect();
        assert_eq!(known.get(&row.instant_ns), Some(&values), "{} ns", row.instant_ns);
    }
}

#[test]
fn what_cannot_be_followed_is_refused_in_words() {
    let robot = Robot::start(&[]);
    let refused = |signals: &[&str], every_ms| {
        let wanted = Wanted { signals: signals.iter().map(|&name| name.to_owned()).collect(), every_ms };
        match States::follow(&found(&robot), &wanted) {
            Err(Error::Refused(why)) => why,
            other => panic!("{:?}", other.map(|states| states.names().to_vec())),
        }
    };
    let why = refused(&["state.pose_z_m"], None);
    assert!(why.starts_with("signals: `state.pose_z_m`: no signal has this name; of this topic"), "{why}");
    for every_ms in [1.5, 0.0, -1.0, f64::NAN, 1e300] {
        let why = refused(&[], Some(every_ms));
        assert!(why.starts_with("every_ms: expected a whole multiple of the cycle of 1 ms"), "{why}");
    }
    // Eight programs may follow, and the next one when one of them is gone.
    let follow = || States::follow(&found(&robot), &Wanted::default());
    let mut all: Vec<States> = (0..8).map(|_| follow().unwrap()).collect();
    assert!(matches!(follow(), Err(Error::Refused(why)) if why == "too many programs follow"));
    all.pop();
    robot.wait("the place is free", |_| follow().is_ok());
    // Without the token nobody takes a seat, and with a wrong one nobody looks either.
    let stranger = Found { token: String::new(), ..found(&robot) };
    assert!(matches!(Seat::take(&stranger), Err(Error::Refused(why)) if why.contains("token")));
    let wrong = Found { token: "a-token-of-nobody".to_owned(), ..found(&robot) };
    assert!(matches!(Seat::take(&wrong), Err(Error::Refused(_))));
}

/// Holds a twist until the robot follows it. Who gets no time for longer than a stick may be silent loses it, as they shall: it is
/// enabled, and held again.
fn drive(seat: &mut Seat, robot: &Robot) {
    let begun = Instant::now();
    while !(seat.drives() && robot.speed_m_s() > 0.2) {
        assert!(begun.elapsed() < LONGEST, "never: {}", robot.read("now"));
        push(seat, Instant::now());
        while seat.hear(Duration::from_millis(5)).unwrap().is_some() {}
    }
}

/// Once, as meant at an instant.
fn push(seat: &mut Seat, meant: Instant) {
    let driven = seat.drive([0.3, 0.0, 0.0], Frame::Body, meant);
    if seat.is_blocked() || matches!(driven, Err(Error::Stopped(_))) {
        enable_stick(seat);
    } else {
        driven.unwrap();
    }
}

/// Enables the stick, again where a busy machine made that old on its way.
fn enable_stick(seat: &mut Seat) {
    let begun = Instant::now();
    loop {
        let number = seat.enable_stick().unwrap();
        let answer = seat.answer(number, LONGEST).unwrap();
        if answer.done {
            return;
        }
        assert!(is_too_old(&answer.text) && begun.elapsed() < LONGEST, "{answer:?}");
    }
}

/// Hears the robot until something is true of the seat.
fn hear_until(seat: &mut Seat, is: impl Fn(&Seat) -> bool) {
    let begun = Instant::now();
    while !is(seat) {
        assert!(begun.elapsed() < LONGEST, "never heard");
        seat.hear(Duration::from_millis(50)).unwrap();
        seat.live().unwrap();
    }
}

#[test]
fn a_program_drives_lets_go_and_drives_again_but_not_after_any_other_stop() {
    let folder = tempfile::tempdir().unwrap();
    let robot = holding(folder.path());
    let mut seat = Seat::take(&found(&robot)).unwrap();
    for _ in 0..2 {
        drive(&mut seat, &robot);
        seat.let_go().unwrap();
        hear_until(&mut seat, |_| rests(&robot));
    }
    // What was meant long ago moves nothing, nor what is no twist.
    let long_ago = Instant::now() - Duration::from_millis(1500);
    for _ in 0..20 {
        push(&mut seat, long_ago);
        seat.hear(Duration::from_millis(5)).unwrap();
    }
    for twist in [json!([1e30, 0.0, 0.0]), json!([0.1, 0.0]), json!([null, 0.0, 0.0]), json!("fast")] {
        let asked = seat.ask(json!({ "do": "drive", "twist": twist }), Instant::now()).unwrap();
        // What can't be read has no number.
        let begun = Instant::now();
        let refused = loop {
            assert!(begun.elapsed() < LONGEST);
            match seat.hear(LONGEST).unwrap() {
                Some(omnibase_client::Heard::Answer(answer)) => break answer,
                _ => seat.live().unwrap(),
            }
        };
        assert!(!refused.done && [0, asked].contains(&refused.number), "{refused:?}");
    }
    cycles_pass(&robot, 50, |_| ());
    assert!(rests(&robot), "{} m/s", robot.speed_m_s());
    // Somebody else stops it: the program drives no more, whatever it says, once the robot is enabled again.
    drive(&mut seat, &robot);
    assert_eq!(robot.call(&json!({ "do": "stop", "category": "category_1" })).1["done"], true);
    hear_until(&mut seat, |seat| !seat.drives());
    assert!(matches!(seat.drive([0.3, 0.0, 0.0], Frame::Body, Instant::now()), Err(Error::Stopped(_))));
    robot.wait("it rests", |robot| rests(robot) && robot.read("now")["phase"] == "disabled");
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    assert!(matches!(seat.drive([0.3, 0.0, 0.0], Frame::Body, Instant::now()), Err(Error::Stopped(_))));
    enable_stick(&mut seat);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    drive(&mut seat, &robot);
    // It hangs: lost, and the stick is blocked.
    robot.wait("it rests", rests);
    hear_until(&mut seat, Seat::is_blocked);
    assert!(robot.read("events").to_string().contains("the stick fell silent"), "{}", robot.read("events"));
}

/// `omnibase drive` with lines of a thread.
struct Driver {
    process: Child,
    says: Receiver<String>,
}

impl Driver {
    fn start(robot: &Robot, twist: &'static str) -> Driver {
        let mut process = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(["drive", "--hold", "500ms"])
            .env("XDG_RUNTIME_DIR", robot.folder.path())
            .env_remove("OMNIBASE_TOKEN")
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = process.stdin.take().unwrap();
        std::thread::spawn(move || {
            while writeln!(lines, "{twist}").is_ok() {
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        let errors = process.stderr.take().unwrap();
        let (heard, says) = channel();
        std::thread::spawn(move || {
            let lines = std::io::BufRead::lines(std::io::BufReader::new(errors));
            lines.map_while(Result::ok).for_each(|line| drop(heard.send(line)));
        });
        Driver { process, says }
    }

    /// Starts it anew until the robot follows it: who gets no time for longer than a stick may be silent ends, as it shall.
    fn driving(robot: &Robot, twist: &'static str) -> Driver {
        for _ in 0..20 {
            let mut driver = Driver::start(robot, twist);
            let mut drives = false;
            robot.wait("it drives, or the program ends", |robot| {
                drives = robot.speed_m_s() > 0.2;
                drives || driver.process.try_wait().unwrap().is_some()
            });
            if drives {
                return driver;
            }
        }
        panic!("it never drives: {}", robot.read("now"));
    }

    fn signal(&self, name: &str) {
        let pid = self.process.id().to_string();
        assert!(Command::new("kill").args([name, &pid]).status().unwrap().success());
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn a_program_that_is_suspended_or_killed_while_it_drives_stops_the_robot() {
    let folder = tempfile::tempdir().unwrap();
    let robot = holding(folder.path());
    let mut driver = Driver::driving(&robot, "0.3 0 0");
    driver.signal("-STOP");
    robot.wait("it rests", rests);
    // Back, with all that waited in its pipe: it moves nothing, and ends.
    driver.signal("-CONT");
    robot.wait("the program ends", |robot| {
        assert!(rests(robot), "{} m/s", robot.speed_m_s());
        driver.says.try_iter().any(|line| line.starts_with("error: "))
    });
    assert_eq!(driver.process.wait().unwrap().code(), Some(1));
    cycles_pass(&robot, 200, |robot| assert!(rests(robot), "{}", robot.read("now")));
    // Another one drives, and is killed.
    let driver = Driver::driving(&robot, "0 0.3 0");
    drop(driver);
    robot.wait("it rests", |robot| rests(robot) && robot.read("now")["commander"] == "nobody");
    let said = robot.read("events").to_string();
    assert!(said.contains("the page that drove is gone"), "{said}");
}

#[test]
fn a_terminal_watches_as_many_rows_as_it_asks_for() {
    let robot = Robot::start(&[]);
    let (code, text, said) =
        robot.command(&["watch", "state.pose_x_m", "--every", "5cycles", "--rows", "20"]);
    assert_eq!(code, Some(0), "{said}");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines.len(), lines[0]), (21, "instant_s,state.pose_x_m"));
    let instant = |line: &str| line.split(',').next().unwrap().parse::<f64>().unwrap();
    assert!(lines[1..].windows(2).all(|two| instant(two[1]) > instant(two[0])), "{text}");
    let (code, _, said) = robot.command(&["watch", "stat.*"]);
    assert!(code == Some(1) && said.contains("`stat.*`: no signal has this name"), "{said}");
}
