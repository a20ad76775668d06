//! The segment, in a process of its own.

use crate::Course;
use omnibase_ethercat_sim::until_set;
use omnibase_host::{MonotonicClock, Namespace, PacketRing, Waiting, stop_on_signals};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

/// What the segment's process does: answers until it is ended.
pub fn serve(kind: &str, drives: usize) {
    let stop = stop_on_signals().expect("signals can be caught");
    let mut segment = omnibase_peers::drives(kind, drives);
    // A segment of hardware doesn't sleep before it answers.
    let mut link = PacketRing::open(Namespace::FAR, Waiting::BusyPoll).expect("the far end can be opened");
    println!("ready");
    omnibase_ethercat_sim::serve(&mut segment, &mut link, &MonotonicClock, &mut until_set(stop))
        .expect("the cable is in");
}

/// The segment's process; it ends with the value.
pub struct FarEnd(Child);

impl FarEnd {
    /// Starts it; every contestant finds a segment that has just been switched on.
    pub fn start(kind: &str, course: Course) -> Self {
        let program = std::env::current_exe().expect("this program");
        let mut child = Command::new(program)
            .args(["--segment", kind, &course.drives.to_string()])
            .stdout(Stdio::piped())
            .spawn()
            .expect("this program can be started");
        let mut line = String::new();
        let output = child.stdout.take().expect("a pipe");
        BufReader::new(output).read_line(&mut line).expect("a word from the segment");
        assert_eq!(line, "ready\n", "the segment did not start");
        FarEnd(child)
    }
}

impl Drop for FarEnd {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
