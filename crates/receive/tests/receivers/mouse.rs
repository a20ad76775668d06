//! A mouse by recorded events: counted, paused where something is missing, gone and back.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex};

use omnibase_joystick::event::{EV_SYN, REL_X, REL_Y, SYN_DROPPED};
use omnibase_joystick::{Description, Device, RawEvent, State};
use omnibase_receive::mouse::{Happened, Mouse, MouseFinder, PAUSE_NS, PERIOD_NS};

const MS: u64 = 1_000_000;

/// Events at their times; it is pulled at a time.
struct Played {
    description: Description,
    events: VecDeque<(u64, RawEvent)>,
    pulled_ns: u64,
}

impl Device for Played {
    fn description(&self) -> &Description {
        &self.description
    }

    fn state(&mut self) -> io::Result<State> {
        Ok(State::default())
    }

    fn events(&mut self, now_ns: u64, events: &mut Vec<RawEvent>) -> io::Result<()> {
        if now_ns >= self.pulled_ns {
            return Err(io::ErrorKind::NotConnected.into());
        }
        while self.events.front().is_some_and(|(at_ns, _)| *at_ns <= now_ns) {
            events.extend(self.events.pop_front().map(|(_, event)| event));
        }
        Ok(())
    }
}

/// Mice that are plugged in one after the other; how often it was looked for one.
#[derive(Default)]
struct Shelf {
    mice: VecDeque<Played>,
    looks: Arc<Mutex<u32>>,
}

impl MouseFinder for Shelf {
    fn find(&mut self) -> io::Result<Box<dyn Device>> {
        *self.looks.lock().unwrap() += 1;
        let mouse = self.mice.pop_front().ok_or(io::Error::from(io::ErrorKind::NotFound))?;
        Ok(Box::new(mouse))
    }
}

fn played(events: impl IntoIterator<Item = (u64, RawEvent)>, pulled_ns: u64) -> Played {
    let description = Description { name: "USB Optical Mouse".into(), ..Description::default() };
    Played { description, events: events.into_iter().collect(), pulled_ns }
}

/// Something, and when, ms.
type At<T> = (u64, T);

/// Readings with their instants, ms, and what happened meanwhile, over so many ms.
fn heard(shelf: Shelf, until_ms: u64) -> (Vec<At<[f64; 2]>>, Vec<At<String>>) {
    let (mut mouse, mut readings, mut happenings) = (Mouse::new(shelf), Vec::new(), Vec::new());
    for ms in 0..until_ms {
        let (reading, happened) = mouse.turn(ms * MS);
        readings.extend(reading.map(|heard| (heard.instant_ns / MS, [heard.values[0], heard.values[1]])));
        match happened {
            Happened::Nothing => {}
            Happened::Refused(error) => happenings.push((ms, error.to_string())),
            other => happenings.push((ms, format!("{other:?}"))),
        }
    }
    (readings, happenings)
}

#[test]
fn counts_are_added_up_and_told_125_times_a_second_at_rest_too() {
    // Two counts to the right and one forward a millisecond, from 200 to 300 ms.
    let moves = (200..300).flat_map(|ms| {
        let report = RawEvent { code: 0, ..RawEvent::report(0) };
        [RawEvent::moved(0, REL_X, 2), RawEvent::moved(0, REL_Y, -1), report].map(|event| (ms * MS, event))
    });
    let shelf = Shelf { mice: [played(moves, u64::MAX)].into(), ..Shelf::default() };
    let (readings, happenings) = heard(shelf, 500);
    assert_eq!(happenings, [(0, "Plugged(\"USB Optical Mouse\")".to_owned())]);
    let steps: Vec<u64> = readings.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    assert!(steps.iter().all(|step| *step == PERIOD_NS / MS), "{steps:?}");
    assert_eq!(readings.first().map(|(ms, _)| *ms), Some(PAUSE_NS / MS));
    assert_eq!(readings.last().map(|(_, counts)| *counts), Some([200.0, 100.0]));
    let (_, half) = readings.iter().find(|(ms, _)| *ms >= 249).unwrap();
    assert!((half[0] - 100.0).abs() <= 16.0 && half[0] == 2.0 * half[1], "{half:?}");
}

#[test]
fn nothing_is_said_across_events_that_were_lost() {
    let dropped = RawEvent { code: SYN_DROPPED, kind: EV_SYN, ..RawEvent::report(0) };
    let events = [(200 * MS, dropped), (200 * MS, RawEvent::moved(0, REL_X, 3))];
    let shelf = Shelf { mice: [played(events, u64::MAX)].into(), ..Shelf::default() };
    let (readings, _) = heard(shelf, 400);
    let gap = readings.windows(2).map(|pair| pair[1].0 - pair[0].0).max();
    assert!(gap.is_some_and(|ms| ms > 100), "{gap:?}: longer than a speed may be taken over");
}

#[test]
fn a_mouse_that_was_pulled_is_looked_for_once_a_second_and_counts_on() {
    let first = played([(150 * MS, RawEvent::moved(0, REL_X, 5))], 300 * MS);
    let second = played([(2500 * MS, RawEvent::moved(0, REL_X, 2))], u64::MAX);
    let shelf = Shelf { mice: [first, second].into(), ..Shelf::default() };
    let looks = shelf.looks.clone();
    let (readings, happenings) = heard(shelf, 3000);
    assert_eq!(happenings[1], (300, "Unplugged".to_owned()));
    assert_eq!(happenings[2], (1000, "Plugged(\"USB Optical Mouse\")".to_owned()));
    assert_eq!((*looks.lock().unwrap(), readings.last().unwrap().1), (2, [7.0, 0.0]));
    let silent = readings.iter().filter(|(ms, _)| (300..1000 + PAUSE_NS / MS).contains(ms)).count();
    assert_eq!(silent, 0);
    let (readings, happenings) = heard(Shelf::default(), 2500);
    assert!(readings.is_empty() && happenings.len() == 3, "{happenings:?}");
}
