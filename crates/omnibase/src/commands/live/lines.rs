//! What a program says on standard input, and when.

use std::io::{self, BufRead};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

/// Lines that wait to be taken.
const WAITING: usize = 64;

/// Lines of standard input, with the instants at which they came.
pub(super) fn lines() -> Receiver<(Instant, io::Result<String>)> {
    let (sender, receiver) = sync_channel(WAITING);
    std::thread::spawn(move || {
        for line in io::stdin().lock().lines() {
            if sender.send((Instant::now(), line)).is_err() {
                return;
            }
        }
    });
    receiver
}
