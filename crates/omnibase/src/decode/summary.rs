//! What a whole capture shows: round trips, cycle, losses, working counters.

use super::records::{DirectionRule, FrameDirection, Record};
use omnibase_ethercat_wire::Command;
use omnibase_ethercat_wire::frame::Datagram;
use omnibase_measure::quantiles::{Distribution, Quantiles};
use serde::Serialize;
use std::collections::{BTreeMap, HashMap};

/// A request is lost where its answer didn't come within so many times the longest round trip, and this.
const ROUND_TRIPS: u64 = 4;
const LOST_NS: u64 = 1_000_000;
/// The most events that are kept; all are counted.
const EVENTS_KEPT: usize = 100;

/// What a capture shows as a whole.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// EtherCAT frames.
    pub frames: u64,
    /// Frames to the segment.
    pub requests: u64,
    /// Frames that came back.
    pub replies: u64,
    /// Datagrams in all frames.
    pub datagrams: u64,
    /// Time from the first to the last frame, ns.
    pub duration_ns: u64,
    /// Requests whose reply is in the capture.
    pub matched: u64,
    /// Requests without reply although later ones were answered, or for much longer than answers take.
    pub lost_frames: u64,
    /// Requests without reply just before the end of the capture: they may have been under way.
    pub open_at_end: u64,
    /// Replies whose request isn't in the capture, or was answered before (duplicates, late frames).
    pub replies_without_request: u64,
    /// Frames of other protocols.
    pub other_protocols: u64,
    /// EtherCAT frames that could not be read to their end.
    pub malformed: u64,
    /// From request to reply, ns.
    pub round_trip_ns: Option<Quantiles>,
    /// The process data that come most often, and their times.
    pub cycle: Option<Cycle>,
    /// Datagrams by command, requests only.
    pub commands: BTreeMap<&'static str, u64>,
    /// Working counters of cyclic datagrams (logical and clock), replies only.
    pub working_counters: Vec<WorkingCounters>,
    /// Replies in which nobody had answered a datagram (working counter 0), cyclic ones left out.
    pub unanswered_datagrams: u64,
    /// AL errors, SDO aborts, emergencies: the first ones.
    pub events: Vec<Event>,
    /// All of them.
    pub event_count: u64,
}

/// The cycle of the process data.
#[derive(Debug, Serialize)]
pub struct Cycle {
    /// Which they are, whatever else is in their frame.
    pub datagrams: String,
    /// How often it was sent.
    pub frames: u64,
    /// Time from one to the next, ns.
    pub period_ns: Quantiles,
    /// Deviation of the period from its median, ns, without sign.
    pub jitter_ns: Quantiles,
    /// Periods of more than one and a half times the median.
    pub gaps: u64,
}

/// The working counters with which one datagram came back.
#[derive(Debug, Serialize)]
pub struct WorkingCounters {
    /// Command.
    pub command: &'static str,
    /// Address as in the datagram.
    pub address: u32,
    /// The address in words.
    pub target: String,
    /// Bytes of data.
    pub length: usize,
    /// How often each working counter came.
    pub counters: BTreeMap<u16, u64>,
}

/// Something that a person looks for in a capture.
#[derive(Debug, Serialize)]
pub struct Event {
    /// Frame number.
    pub frame: u64,
    /// What it was.
    pub text: String,
}

/// Gathers the summary frame by frame, and tells the way of frames that don't tell it themselves.
pub struct Gatherer {
    summary: Summary,
    rule: DirectionRule,
    first_ns: Option<u64>,
    waiting: HashMap<Vec<u64>, SentFrame>,
    latest_answered: u64,
    round_trips: Distribution,
    cycles: HashMap<Vec<u64>, Vec<u64>>,
    counters: BTreeMap<(u8, u32, usize), BTreeMap<u16, u64>>,
}

struct SentFrame {
    number: u64,
    unix_ns: u64,
}

impl Gatherer {
    /// Nothing seen yet.
    pub fn new(rule: DirectionRule) -> Self {
        let summary = Summary {
            frames: 0,
            requests: 0,
            replies: 0,
            datagrams: 0,
            duration_ns: 0,
            matched: 0,
            lost_frames: 0,
            open_at_end: 0,
            replies_without_request: 0,
            other_protocols: 0,
            malformed: 0,
            round_trip_ns: None,
            cycle: None,
            commands: BTreeMap::new(),
            working_counters: Vec::new(),
            unanswered_datagrams: 0,
            events: Vec::new(),
            event_count: 0,
        };
        Gatherer {
            summary,
            rule,
            first_ns: None,
            waiting: HashMap::new(),
            latest_answered: 0,
            round_trips: Distribution::new(),
            cycles: HashMap::new(),
            counters: BTreeMap::new(),
        }
    }

    /// A frame of another protocol.
    pub fn other_protocol(&mut self) {
        self.summary.other_protocols += 1;
    }

    /// A frame that could not be read to its end.
    pub fn malformed(&mut self) {
        self.summary.malformed += 1;
    }

    /// Something that a person looks for.
    pub fn event(&mut self, frame: u64, text: &str) {
        self.summary.event_count += 1;
        if self.summary.events.len() < EVENTS_KEPT {
            self.summary.events.push(Event { frame, text: text.to_owned() });
        }
    }

    /// Takes a frame in; gives the way that it went.
    pub fn frame(&mut self, record: &Record<'_>, datagrams: &[Datagram<'_>]) -> FrameDirection {
        let time = record.frame.unix_ns;
        let first = *self.first_ns.get_or_insert(time);
        self.summary.duration_ns = self.summary.duration_ns.max(time.saturating_sub(first));
        self.summary.frames += 1;
        self.summary.datagrams += datagrams.len() as u64;
        let key = Record::key(datagrams);
        let way = record.way(self.rule).unwrap_or_else(|| match self.waiting.contains_key(&key) {
            true => FrameDirection::Reply,
            false => FrameDirection::Request,
        });
        match way {
            FrameDirection::Request => self.request(record, datagrams, key),
            FrameDirection::Reply => self.reply(time, datagrams, &key),
        }
        way
    }

    fn request(&mut self, record: &Record<'_>, datagrams: &[Datagram<'_>], key: Vec<u64>) {
        self.summary.requests += 1;
        for datagram in datagrams {
            let name = Command::from_code(datagram.header.command).map_or("unknown", Command::name);
            *self.summary.commands.entry(name).or_default() += 1;
        }
        let words = key.iter().zip(datagrams);
        let logical = words.filter(|(_, datagram)| is_logical(datagram.header.command));
        // Without the index, which changes from cycle to cycle.
        let shape: Vec<u64> = logical.map(|(word, _)| word & !0xFF00).collect();
        if !shape.is_empty() {
            self.cycles.entry(shape).or_default().push(record.frame.unix_ns);
        }
        let request = SentFrame { number: record.frame.number, unix_ns: record.frame.unix_ns };
        if self.waiting.insert(key, request).is_some() {
            // The same frame again: the first one was given up.
            self.summary.lost_frames += 1;
        }
    }

    fn reply(&mut self, time: u64, datagrams: &[Datagram<'_>], key: &[u64]) {
        self.summary.replies += 1;
        match self.waiting.remove(key) {
            Some(request) => {
                self.summary.matched += 1;
                self.latest_answered = self.latest_answered.max(request.number);
                self.round_trips.record(time.saturating_sub(request.unix_ns));
            }
            None => self.summary.replies_without_request += 1,
        }
        for datagram in datagrams {
            let header = &datagram.header;
            let clock = [Command::Armw.code(), Command::Frmw.code()].contains(&header.command);
            if is_logical(header.command) || clock {
                // The position of an ARMW is counted up on the way and the same for every cycle.
                let place = (header.command, header.address, header.length);
                *self.counters.entry(place).or_default().entry(datagram.working_counter).or_default() += 1;
            } else if datagram.working_counter == 0 && header.command != Command::Nop.code() {
                self.summary.unanswered_datagrams += 1;
            }
        }
    }

    /// The summary of everything that was taken in.
    pub fn finish(mut self) -> Summary {
        let round_trip_ns = self.round_trips.quantiles();
        let longest_ns = ROUND_TRIPS * round_trip_ns.as_ref().map_or(0, |all| all.max);
        let end_ns = self.first_ns.unwrap_or(0) + self.summary.duration_ns;
        for request in self.waiting.values() {
            let waited_ns = end_ns.saturating_sub(request.unix_ns);
            if request.number < self.latest_answered || waited_ns > longest_ns.max(LOST_NS) {
                self.summary.lost_frames += 1;
            } else {
                self.summary.open_at_end += 1;
            }
        }
        self.summary.round_trip_ns = round_trip_ns;
        let most = self.cycles.into_iter().max_by(|a, b| (a.1.len(), &b.0).cmp(&(b.1.len(), &a.0)));
        self.summary.cycle = most.and_then(|(shape, times)| cycle(&shape, &times));
        self.summary.working_counters = self
            .counters
            .into_iter()
            .map(|((command, address, length), counters)| WorkingCounters {
                command: Command::from_code(command).map_or("unknown", Command::name),
                address,
                target: Command::from_code(command)
                    .map_or_else(String::new, |command| command.address(address).to_string()),
                length,
                counters,
            })
            .collect();
        self.summary
    }
}

fn is_logical(command: u8) -> bool {
    matches!(Command::from_code(command), Some(Command::Lrd | Command::Lwr | Command::Lrw))
}

/// The times of one kind of frame; `None` where it came less than three times.
fn cycle(shape: &[u64], times: &[u64]) -> Option<Cycle> {
    if times.len() < 3 {
        return None;
    }
    let periods = || times.windows(2).map(|pair| pair[1].saturating_sub(pair[0]));
    let mut period_ns = Distribution::new();
    periods().for_each(|period| period_ns.record(period));
    let period_ns = period_ns.quantiles()?;
    let mut jitter_ns = Distribution::new();
    periods().for_each(|period| jitter_ns.record(period.abs_diff(period_ns.p50)));
    let datagrams: Vec<String> = shape
        .iter()
        .map(|word| {
            let name = Command::from_code(*word as u8).map_or("unknown", Command::name);
            format!("{name} of {} bytes", word >> 16 & 0xFFFF)
        })
        .collect();
    Some(Cycle {
        datagrams: datagrams.join(" + "),
        frames: times.len() as u64,
        period_ns,
        jitter_ns: jitter_ns.quantiles()?,
        gaps: periods().filter(|period| *period > period_ns.p50 + period_ns.p50 / 2).count() as u64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_ethercat_wire::Address;
    use omnibase_ethercat_wire::frame::{FrameBuilder, PROCESSED_BIT};
    use omnibase_record::CapturedFrame;

    /// Frames with their times in us, from index 100 on with something beside their process data; `Some(working counter)` makes a reply.
    fn summary(frames: &[(u64, u8, Option<u16>)]) -> Summary {
        let mut gatherer = Gatherer::new(DirectionRule::ProcessedBit);
        for (number, (time_us, index, reply)) in frames.iter().enumerate() {
            let mut frame = FrameBuilder::new();
            if *index >= 100 {
                frame.push_zeros(Command::Brd, *index, Address::broadcast(0x0130), 2).unwrap();
            }
            frame.push_zeros(Command::Lrw, *index, Address::Logical(0x1000), 8).unwrap();
            let mut bytes = frame.bytes().to_vec();
            if let Some(counter) = reply {
                bytes[6] |= PROCESSED_BIT;
                let end = bytes.len();
                bytes[end - 2..].copy_from_slice(&counter.to_le_bytes());
            }
            let captured = CapturedFrame {
                number: number as u64 + 1,
                unix_ns: time_us * 1000,
                direction: None,
                data: &bytes,
                original_length: bytes.len(),
            };
            let record = Record::new(captured).unwrap();
            gatherer.frame(&record, &record.datagrams().0);
        }
        gatherer.finish()
    }

    #[test]
    fn replies_are_matched_and_losses_and_duplicates_counted() {
        let found = summary(&[
            (0, 1, None),
            (100, 1, Some(3)),
            (1000, 2, None), // lost: later ones are answered
            (2000, 3, None),
            (2300, 3, Some(2)),
            (2310, 3, Some(2)), // twice
            (3000, 4, None),    // under way
        ]);
        assert_eq!((found.requests, found.replies, found.matched), (4, 3, 2));
        assert_eq!((found.lost_frames, found.open_at_end, found.replies_without_request), (1, 1, 1));
        let round_trip = found.round_trip_ns.unwrap();
        // Distributions keep three digits.
        assert!(
            round_trip.min.abs_diff(100_000) <= 100 && round_trip.max.abs_diff(300_000) <= 300,
            "{round_trip:?}"
        );
        let counters = &found.working_counters[0];
        assert_eq!((counters.command, counters.address, counters.length), ("LRW", 0x1000, 8));
        assert_eq!(counters.counters, BTreeMap::from([(2, 2), (3, 1)]));
    }

    /// Who answered dies: only the last requests may be under way.
    #[test]
    fn what_nobody_answers_any_more_is_lost() {
        let after = (1..=10).map(|cycle| (1000 * cycle, cycle as u8, None));
        let found = summary(&[vec![(0, 0, None), (100, 0, Some(3))], after.collect()].concat());
        assert_eq!((found.lost_frames, found.open_at_end), (8, 2));
    }

    #[test]
    fn the_same_frame_again_gives_the_first_one_up() {
        let found = summary(&[(0, 1, None), (500, 1, None), (600, 1, Some(1))]);
        assert_eq!((found.lost_frames, found.matched), (1, 1));
        assert!(found.round_trip_ns.unwrap().max < 101_000);
    }

    #[test]
    fn period_and_jitter_are_those_of_the_requests() {
        let found =
            summary(&[(0, 1, None), (1000, 2, None), (2010, 3, None), (3000, 4, None), (5000, 5, None)]);
        let cycle = found.cycle.unwrap();
        assert_eq!((cycle.frames, cycle.gaps), (5, 1));
        assert_eq!(cycle.datagrams, "LRW of 8 bytes");
        // Three digits: 1000 us within 0.1 %.
        assert!(cycle.period_ns.p50.abs_diff(1_000_000) <= 1000, "{cycle:?}");
        assert!(cycle.jitter_ns.max.abs_diff(1_000_000) <= 2000, "{cycle:?}");
        assert!(summary(&[(0, 1, None), (1, 2, None)]).cycle.is_none());
        // Whatever else a frame carries, its process data make the cycle.
        let mixed = [(0, 1, None), (1000, 100, None), (2000, 2, None), (3000, 101, None), (4000, 3, None)];
        let cycle = summary(&mixed).cycle.unwrap();
        assert_eq!((cycle.frames, cycle.gaps, cycle.datagrams.as_str()), (5, 0, "LRW of 8 bytes"));
    }
}
