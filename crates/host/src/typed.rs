//! Lines of standard input that come while something else runs.

use std::io::{self, BufRead};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// A program in the background of a terminal asks so often whether it may read again.
const IN_BACKGROUND: Duration = Duration::from_millis(200);

/// Lines as they come, without their ends, what isn't UTF-8 replaced; empty ones are left out. No sender is left once the input has ended.
///
/// In the background of a terminal the program goes on and hears nothing, until it is in the foreground again.
pub fn typed_lines() -> Receiver<String> {
    // SAFETY: no handler of ours; reading a terminal from its background then fails with an error number.
    unsafe { libc::signal(libc::SIGTTIN, libc::SIG_IGN) };
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        read_lines(io::stdin().lock(), |line| sender.send(line).is_ok());
    });
    receiver
}

/// Hands each line on, as long as somebody takes it and the input lasts.
fn read_lines(mut input: impl BufRead, mut take: impl FnMut(String) -> bool) {
    let mut bytes = Vec::new();
    loop {
        match input.read_until(b'\n', &mut bytes) {
            Ok(0) => return,
            Ok(_) => {}
            Err(error) if error.raw_os_error() == Some(libc::EIO) => {
                std::thread::sleep(IN_BACKGROUND);
                continue;
            }
            Err(_) => return,
        }
        let line = String::from_utf8_lossy(&bytes).trim().to_owned();
        bytes.clear();
        if !line.is_empty() && !take(line) {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_handed_on_whatever_it_holds() {
        let mut lines = Vec::new();
        read_lines(&b"sto@0\r\n\n  \n\xff\xfe sto@1\npush@2"[..], |line| {
            lines.push(line);
            true
        });
        assert_eq!(lines, ["sto@0", "\u{fffd}\u{fffd} sto@1", "push@2"]);
        let mut count = 0;
        read_lines(&b"a\nb\nc\n"[..], |_| {
            count += 1;
            count < 2
        });
        assert_eq!(count, 2, "nobody takes more");
    }

    /// A terminal lets who is in its background read nothing, for as long as he is there.
    #[test]
    fn in_the_background_it_waits() {
        struct Terminal(u32);
        impl io::Read for Terminal {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                self.0 += 1;
                match self.0 {
                    1 => Err(io::Error::from_raw_os_error(libc::EIO)),
                    2 => (&b"sto@0\n"[..]).read(buffer),
                    _ => Ok(0),
                }
            }
        }
        let mut lines = Vec::new();
        read_lines(io::BufReader::new(Terminal(0)), |line| {
            lines.push(line);
            true
        });
        assert_eq!(lines, ["sto@0"]);
    }
}
