//! A person at the terminal: questions line by line, the space bar held.

use super::heard::Heard;
use crate::terminal::shown;
use omnibase_setup::{Answer, Hand, Key, Question};
use ratatui::crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers, poll, read};
use ratatui::crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::io::Errno;
use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long the keyboard is waited for at a time.
const LOOK: Duration = Duration::from_millis(20);

/// A person at the terminal.
pub struct Person {
    listening: Option<Listening>,
    /// The bar of the motion before.
    heard: Arc<Heard>,
    /// What was typed, or piped in, and isn't read as a line yet.
    typed: Vec<u8>,
    /// What was asked last: who is asked that again may have said it already.
    asked: String,
    stop: &'static AtomicBool,
}

/// The keyboard's thread, and what it heard.
struct Listening {
    end: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Person {
    /// A person at the standard input; `stop` ends it as leaving does.
    pub fn new(stop: &'static AtomicBool) -> Self {
        Person { listening: None, heard: Arc::default(), typed: Vec::new(), asked: String::new(), stop }
    }

    /// What was typed before a question stood there is no answer to it; what is piped in is.
    fn forget_typed(&mut self) {
        let stdin = std::io::stdin();
        if !stdin.is_terminal() {
            return;
        }
        let lines = |bytes: &[u8]| bytes.iter().filter(|byte| matches!(byte, b'\n' | b'\r')).count();
        let (mut dropped, mut bytes) = (lines(&std::mem::take(&mut self.typed)), [0; 1024]);
        let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
        while rustix::event::poll(&mut [PollFd::new(&stdin, PollFlags::IN)], Some(&at_once))
            .is_ok_and(|ready| ready > 0)
            && let Ok(count @ 1..) = rustix::io::read(&stdin, &mut bytes)
        {
            dropped += lines(&bytes[..count]);
        }
        if dropped > 0 {
            println!("lines typed before this question are dropped: {dropped}");
        }
    }

    /// The next line; `None` where none will come, or the program is ended.
    fn line(&mut self) -> Option<String> {
        let stdin = std::io::stdin();
        let mut bytes = [0; 1024];
        loop {
            if let Some(end) = self.typed.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.typed.drain(..=end).collect();
                return Some(String::from_utf8_lossy(&line).into_owned());
            }
            if self.stop.load(Ordering::Relaxed) {
                return None;
            }
            let mut looked = [PollFd::new(&stdin, PollFlags::IN)];
            let ready = rustix::event::poll(&mut looked, Timespec::try_from(LOOK).ok().as_ref());
            match ready.and_then(|ready| {
                if ready > 0 { rustix::io::read(&stdin, &mut bytes) } else { Ok(usize::MAX) }
            }) {
                Ok(usize::MAX) | Err(Errno::INTR | Errno::AGAIN) => {}
                Ok(0) if !self.typed.is_empty() => self.typed.push(b'\n'),
                Ok(0) | Err(_) => return None,
                Ok(count) => self.typed.extend_from_slice(&bytes[..count]),
            }
        }
    }

    fn stop_listening(&mut self) {
        if let Some(Listening { end, thread, .. }) = self.listening.take() {
            end.store(true, Ordering::Relaxed);
            let _ = thread.join();
            let _ = disable_raw_mode();
        }
    }
}

impl Drop for Person {
    fn drop(&mut self) {
        self.stop_listening();
    }
}

/// Hears the keyboard until it shall end, or until the keyboard is gone.
fn listen(heard: &Heard, end: &AtomicBool) {
    while !end.load(Ordering::Relaxed) && !heard.is_gone() {
        hear(heard, LOOK);
    }
}

/// Waits so long for something at the terminal; whether that is gone. Whoever waits for its events then does so for ever.
fn has_hung_up(longest: Duration) -> bool {
    let stdin = std::io::stdin();
    let mut looked = [PollFd::new(&stdin, PollFlags::IN)];
    let gone = PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL;
    rustix::event::poll(&mut looked, Timespec::try_from(longest).ok().as_ref()).is_ok_and(|ready| ready > 0)
        && looked[0].revents().intersects(gone)
}

/// Waits so long for something at the keyboard; whether there was something.
fn hear(heard: &Heard, longest: Duration) -> bool {
    if has_hung_up(longest) {
        heard.gone();
        return false;
    }
    let event = match poll(Duration::ZERO) {
        Ok(false) => return false,
        Ok(true) => read(),
        Err(error) => Err(error),
    };
    match event {
        Ok(Event::Key(key)) => {
            let leaves = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
            match (key.code, key.kind) {
                _ if leaves => heard.gone(),
                (KeyCode::Char(' '), KeyEventKind::Press | KeyEventKind::Repeat) => heard.beat(),
                // Another key, or the bar let go where the terminal tells it.
                _ => heard.let_go(),
            }
        }
        Ok(_) => {}
        Err(_) => heard.gone(),
    }
    true
}

impl Hand for Person {
    fn ask(&mut self, question: &Question) -> Answer {
        self.stop_listening();
        if self.asked != question.id {
            self.forget_typed();
            self.asked.clone_from(&question.id);
        }
        let choices = if question.choices.is_empty() {
            String::new()
        } else {
            format!(" ({})", question.choices.join(", "))
        };
        let default = question.default.as_ref().map_or(String::new(), |default| format!(" [{default}]"));
        print!("{}{choices}{default}, `leave` to go on another day: ", shown(&question.text));
        let line = if std::io::stdout().flush().is_ok() { self.line() } else { None };
        line.filter(|line| line.trim() != "leave").map_or(Answer::Leave, Answer::Text)
    }

    fn tell(&mut self, text: &str) {
        self.stop_listening();
        println!("{}", shown(text));
    }

    /// The bar stays in the hand: the terminal takes lines as they are then.
    fn remark(&mut self, text: &str) {
        print!("\r\n{}\r\n", shown(text));
        // What can't be shown is no reason to stop.
        let _ = std::io::stdout().flush();
    }

    fn take_key(&mut self, what: &str) {
        self.stop_listening();
        println!("{} [space bar held, pressed anew; any other key ends it]", shown(what));
        let heard = Arc::new(self.heard.again());
        if enable_raw_mode().is_err() {
            heard.gone();
        }
        // Beats of a bar that was held before are none of this motion's; whoever wants to leave does.
        while !heard.is_gone() && hear(&heard, Duration::ZERO) {}
        heard.begin();
        let end = Arc::new(AtomicBool::new(false));
        let thread = {
            let (heard, end) = (Arc::clone(&heard), Arc::clone(&end));
            std::thread::spawn(move || listen(&heard, &end))
        };
        self.listening = Some(Listening { end, thread });
        self.heard = heard;
    }

    fn key(&mut self) -> Key {
        let is_ended = self.stop.load(Ordering::Relaxed);
        self.listening.as_ref().filter(|_| !is_ended).map_or(Key::Gone, |_| self.heard.key())
    }
}
