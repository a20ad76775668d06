//! A person at the terminal: questions line by line, the space bar held.

use super::heard::Heard;
use crate::terminal::shown;
use omnibase_setup::{Answer, Hand, Key, Question};
use ratatui::crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers, poll, read};
use ratatui::crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use rustix::event::{PollFd, PollFlags, Timespec};
use std::io::{BufRead, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long the keyboard is waited for at a time.
const LOOK: Duration = Duration::from_millis(20);

/// A person at the terminal.
#[derive(Default)]
pub struct Person {
    listening: Option<Listening>,
}

/// The keyboard's thread, and what it heard.
struct Listening {
    heard: Arc<Heard>,
    end: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Person {
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
        Ok(Event::FocusLost) => heard.let_go(),
        Ok(_) => {}
        Err(_) => heard.gone(),
    }
    true
}

impl Hand for Person {
    fn ask(&mut self, question: &Question) -> Answer {
        self.stop_listening();
        let choices = if question.choices.is_empty() {
            String::new()
        } else {
            format!(" ({})", question.choices.join(", "))
        };
        let default = question.default.as_ref().map_or(String::new(), |default| format!(" [{default}]"));
        print!("{}{choices}{default}, `leave` to go on another day: ", shown(&question.text));
        let mut line = String::new();
        let heard = std::io::stdout().flush().and_then(|()| std::io::stdin().lock().read_line(&mut line));
        match heard {
            Ok(0) | Err(_) => Answer::Leave,
            Ok(_) if line.trim() == "leave" => Answer::Leave,
            Ok(_) => Answer::Said(line),
        }
    }

    fn tell(&mut self, text: &str) {
        self.stop_listening();
        println!("{}", shown(text));
    }

    fn take_key(&mut self, what: &str) {
        self.stop_listening();
        println!("{} [space bar held; any other key ends it]", shown(what));
        let heard = Arc::new(Heard::default());
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
        self.listening = Some(Listening { heard, end, thread });
    }

    fn key(&mut self) -> Key {
        self.listening.as_ref().map_or(Key::Gone, |listening| listening.heard.key())
    }
}
