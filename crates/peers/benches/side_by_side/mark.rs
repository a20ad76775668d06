//! The cycles of a contestant: marked, so that counters of others count them alone, and measured.

use crate::Course;
use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_host::MonotonicClock;
use rustix::time::{ClockId, clock_gettime};
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::time::Duration;

/// Cycles before those that are measured.
const WARM_UP: u64 = 200;
/// What perf answers.
const ACKNOWLEDGED: &[u8] = b"ack\n\0";

/// Says where the measured cycles begin and end, as `perf stat --control` wants it: `enable` and `disable` written
/// into one FIFO, `ack` awaited from another. In a run that isn't counted they go into a file that nobody reads.
pub struct Mark {
    control: File,
    answer: Option<File>,
    round_trips_ns: Vec<u64>,
    wrong: u64,
    period: Duration,
    due: HostTime,
}

impl Mark {
    /// Marks into the file or FIFO `control`; answers come from the FIFO of that name with `.ack`, if there is one.
    pub fn new(control: &str) -> Self {
        Mark {
            control: OpenOptions::new().write(true).open(control).expect("the control file"),
            answer: File::open(format!("{control}.ack")).ok(),
            round_trips_ns: Vec::new(),
            wrong: 0,
            period: Duration::ZERO,
            due: HostTime(0),
        }
    }

    fn set(&mut self, word: &str) {
        self.control.write_all(word.as_bytes()).expect("the control file takes it");
        if let Some(answer) = &mut self.answer {
            answer.read_exact(&mut [0; ACKNOWLEDGED.len()]).expect("an answer from perf");
        }
    }

    /// Begins the half whose CPU time, instructions and system calls are counted; gives the CPU time so far, ns.
    pub fn begin(&mut self) -> u64 {
        self.set("enable\n");
        cpu_ns()
    }

    /// Ends that half, and prints what was measured.
    pub fn end(mut self, begin_cpu_ns: u64, cycles: u64) {
        let cpu_ns = cpu_ns() - begin_cpu_ns;
        self.set("disable\n");
        println!("{} {}", cpu_ns / cycles, self.wrong);
        let round_trips: Vec<String> = self.round_trips_ns.iter().map(u64::to_string).collect();
        println!("{}", round_trips.join(" "));
    }

    /// Notes a round trip.
    pub fn round_trip(&mut self, ns: u64) {
        self.round_trips_ns.push(ns);
    }

    /// Notes whether a cycle was right.
    pub fn judge(&mut self, right: bool) {
        self.wrong += u64::from(!right);
    }

    /// The cycles begin: how many of which half, warm-up, timed and counted.
    pub fn halves(&mut self, course: Course) -> [u64; 3] {
        (self.period, self.due) = (course.period, MonotonicClock.now());
        [WARM_UP, course.cycles, course.cycles]
    }

    /// Sleeps until the next cycle is due (`clock_nanosleep` to an instant); back to back it is at once.
    pub fn pace(&mut self) {
        if !self.period.is_zero() {
            self.due = (self.due + self.period).max(MonotonicClock.now());
            MonotonicClock.sleep_until(self.due);
        }
    }

    /// Runs the cycles: `cycle` tells whether it was right.
    pub fn measure(mut self, course: Course, mut cycle: impl FnMut() -> bool) {
        let [warm_up, timed, counted] = self.halves(course);
        for _ in 0..warm_up {
            self.pace();
            cycle();
        }
        for _ in 0..timed {
            self.pace();
            let start = MonotonicClock.now();
            let right = cycle();
            self.round_trip((MonotonicClock.now() - start).as_nanos() as u64);
            self.judge(right);
        }
        let cpu = self.begin();
        for _ in 0..counted {
            self.pace();
            let right = cycle();
            self.judge(right);
        }
        self.end(cpu, counted);
    }
}

/// CPU time of all threads of this process, ns: in the program and in the kernel.
fn cpu_ns() -> u64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}
