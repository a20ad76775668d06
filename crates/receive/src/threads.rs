//! A thread for each receiver, beside the cycle.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use omnibase_robot::config::SourcePlan;
use omnibase_robot::signals::Heard;

use crate::clock::ClockMap;
use crate::receiver::{Receiver, Teller, open};

/// The same words are said again after so long.
const SAID_AGAIN: Duration = Duration::from_secs(30);
/// So many different words are remembered; whoever sends more sorts of nonsense than these is told of once in a while.
const REMEMBERED: usize = 32;
/// Before a socket that broke is opened anew.
const OPENED_AGAIN: Duration = Duration::from_secs(1);

/// A robot's clock stands for a cycle at most, ns: one that stands longer is late, and so is all that is measured by it.
const AHEAD_NS: u64 = 5_000_000;

/// Where what receivers hear goes: the robot's, as any program's.
pub trait Seat: Send + Sync {
    /// The robot's clock, ns; it may stand between two cycles.
    fn clock_ns(&self) -> u64;
    /// What a source said, by its place; it is judged there.
    fn hear(&self, source: usize, heard: &Heard);
    /// What a person should know of a source.
    fn say(&self, source: &str, words: &str);
}

/// The receivers of a robot; they end with it.
pub struct Receivers {
    ends: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Receivers {
    /// Starts those of the sources that `is_wanted` takes.
    ///
    /// # Errors
    /// A socket can't be had: the source, and why.
    pub fn start(
        sources: &[SourcePlan],
        is_wanted: impl Fn(usize) -> bool,
        seat: &Arc<dyn Seat>,
    ) -> Result<Self, (String, io::Error)> {
        let mut all = Receivers { ends: Arc::default(), threads: Vec::new() };
        for (place, source) in sources.iter().enumerate().filter(|(place, _)| is_wanted(*place)) {
            let named = |error| (source.name.clone(), error);
            let Some(receiver) = open(&source.receiver).map_err(named)? else { continue };
            let (plan, seat, ends) = (source.clone(), Arc::clone(seat), Arc::clone(&all.ends));
            let thread = std::thread::Builder::new().name(format!("source {}", source.name));
            let thread = thread.spawn(move || run(receiver, place, &plan, &*seat, &ends));
            all.threads.push(thread.map_err(named)?);
        }
        Ok(all)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.threads.is_empty()
    }
}

impl Drop for Receivers {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // A panic of one was reported by itself; its source is silent since.
            let _ = thread.join();
        }
    }
}

fn run(receiver: Box<dyn Receiver>, place: usize, plan: &SourcePlan, seat: &dyn Seat, ends: &AtomicBool) {
    let mut turn = Turn::new(place, &plan.name, seat);
    let mut receiver = Some(receiver);
    while !ends.load(Ordering::Relaxed) {
        turn.look_at_clock();
        let Some(own) = &mut receiver else {
            std::thread::sleep(OPENED_AGAIN);
            match open(&plan.receiver) {
                Ok(again) => receiver = again,
                Err(error) => turn.say(&format!("not opened anew: {error}")),
            }
            continue;
        };
        let Err(error) = own.turn(&mut turn) else { continue };
        turn.say(&format!("{error}: opened anew"));
        // Its address is free before it is taken again.
        receiver = None;
    }
}

/// A receiver's side of the robot.
struct Turn<'a> {
    place: usize,
    name: &'a str,
    seat: &'a dyn Seat,
    began: Instant,
    /// Ours is the robot's clock, which stands between two cycles: this machine's monotonic one goes on in between.
    clock: ClockMap,
    said: BTreeMap<String, Instant>,
}

impl<'a> Turn<'a> {
    fn new(place: usize, name: &'a str, seat: &'a dyn Seat) -> Self {
        Turn { place, name, seat, began: Instant::now(), clock: ClockMap::default(), said: BTreeMap::new() }
    }

    fn host_ns(&self) -> u64 {
        self.began.elapsed().as_nanos() as u64
    }

    /// The robot's clock shows what it showed at the last cycle, or later than that.
    fn look_at_clock(&mut self) {
        let robot_ns = self.seat.clock_ns();
        self.clock.after(self.host_ns(), robot_ns);
    }
}

impl Teller for Turn<'_> {
    fn now_ns(&self) -> u64 {
        let robot_ns = self.seat.clock_ns();
        let mapped = self.clock.map(self.host_ns());
        mapped.map_or(robot_ns, |mapped| mapped.ours_ns.clamp(robot_ns, robot_ns + AHEAD_NS))
    }

    fn hear(&mut self, heard: &Heard) {
        self.seat.hear(self.place, heard);
    }

    fn say(&mut self, words: &str) {
        let now = Instant::now();
        // Numbers differ from one to the next, and are the same to whoever reads.
        let key: String = words.chars().filter(|character| !character.is_ascii_digit()).collect();
        self.said.retain(|_, at| now.duration_since(*at) < SAID_AGAIN);
        if self.said.len() < REMEMBERED && !self.said.contains_key(&key) {
            self.said.insert(key, now);
            self.seat.say(self.name, words);
        }
    }
}
