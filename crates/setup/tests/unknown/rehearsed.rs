//! What the guide rehearses with: `segments/three-servos.toml` and `robots/bmm.toml`.

use std::path::Path;

use omnibase_ethercat::wire::Link;
use omnibase_ethercat_sim::{SegmentFile, SimLink, VirtualClock, in_process};
use omnibase_setup::{Answer, Guide, Hand, Key, Outside, Question, Record, Wished};
use std::cell::RefCell;
use std::rc::Rc;

use super::unknown::SharedLink;

/// Counts of a wheel's turn.
const TURN: f64 = 1_048_576.0;

/// Holds the key until a wheel has turned once, or the robot has come to its end.
#[derive(Default)]
struct Rehearsing {
    is_on_floor: bool,
    travel: f64,
    told: Vec<String>,
}

impl Hand for Rehearsing {
    fn ask(&mut self, question: &Question) -> Answer {
        let (word, of) = question.id.split_once(' ').unwrap_or((&question.id, ""));
        self.is_on_floor |= word == "floor";
        let said = match word {
            "wheel" => format!("wheel_{}", of.parse::<u32>().unwrap() + 1),
            "way" => "forward".to_owned(),
            "turns" => format!("{:.2}", self.travel.abs() / TURN),
            "stop" | "braked" | "calibrate" => "go on".to_owned(),
            "brake" => "no".to_owned(),
            "name" => "position".to_owned(),
            "parameters" => "write".to_owned(),
            "floor" => "drive".to_owned(),
            "went" => "ahead".to_owned(),
            "tape" if of.starts_with('x') => "1.0".to_owned(),
            "tape" => "0".to_owned(),
            _ => question.choices.first().cloned().unwrap_or_default(),
        };
        // What isn't driven to its end is told, not tried for ever.
        if word == "drive" { Answer::Leave } else { Answer::Text(said) }
    }

    fn tell(&mut self, text: &str) {
        self.told.push(text.to_owned());
    }

    fn take_key(&mut self, _: &str) {
        self.travel = 0.0;
    }

    fn key(&mut self) -> Key {
        if !self.is_on_floor && self.travel.abs() >= TURN { Key::LetGo } else { Key::Beat }
    }

    fn moves(&mut self, _: bool, travel: f64) {
        self.travel = travel;
    }
}

#[test]
fn the_guides_rehearsal_ends_with_the_first_metre_driven() {
    let segment = SegmentFile::parse(include_str!("../../../../segments/three-servos.toml")).unwrap();
    let (link, clock) = in_process(segment.build(Path::new("../../segments")).unwrap());
    let link = Rc::new(RefCell::new(link));
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        Ok((Box::new(SharedLink(Rc::<RefCell<SimLink>>::clone(&link))), clock.clone()))
    };
    let mut hand = Rehearsing::default();
    let (mut keep, mut back_up) = (|_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
    let wished = Wished {
        wheel_speed_rad_s: 3.0,
        ..Wished::new(include_str!("../../../../robots/bmm.toml").to_owned())
    };
    let outside =
        Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
    let mut guide = Guide::new(wished, Record::default(), &mut open, outside).unwrap();
    let ended = guide.run();
    let record = guide.record.clone();
    drop(guide);
    let driven = record.log.iter().find(|line| line.starts_with("ahead: driven, by its wheels 1.0"));
    assert!(driven.is_some(), "{ended:?}\n{:#?}\n{:#?}", record.log, hand.told);
}
