//! A person at the terminal: questions line by line, the space bar held.

use crate::terminal::shown;
use omnibase_setup::{Answer, Hand, Key, Question};
use ratatui::crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers, poll, read};
use ratatui::crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use std::io::{BufRead, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// How long the keyboard is waited for at a time.
const LOOK: Duration = Duration::from_millis(20);

/// What the keyboard's thread heard.
#[derive(Default)]
struct Heard {
    beats: AtomicU32,
    let_go: AtomicBool,
    gone: AtomicBool,
    end: AtomicBool,
}

/// A person at the terminal.
pub struct Person {
    listening: Option<(Arc<Heard>, JoinHandle<()>)>,
    beats: u32,
}

impl Person {
    pub fn new() -> Self {
        Person { listening: None, beats: 0 }
    }

    fn stop_listening(&mut self) {
        if let Some((heard, thread)) = self.listening.take() {
            heard.end.store(true, Ordering::Relaxed);
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
fn listen(heard: &Heard) {
    while !heard.end.load(Ordering::Relaxed) {
        let event = match poll(LOOK) {
            Ok(false) => continue,
            Ok(true) => read(),
            Err(error) => Err(error),
        };
        match event {
            Ok(Event::Key(key)) => {
                let leaves = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
                match (key.code, key.kind) {
                    _ if leaves => heard.gone.store(true, Ordering::Relaxed),
                    (KeyCode::Char(' '), KeyEventKind::Press | KeyEventKind::Repeat) => {
                        heard.beats.fetch_add(1, Ordering::Relaxed);
                    }
                    // Another key, or the bar let go where the terminal tells it.
                    _ => heard.let_go.store(true, Ordering::Relaxed),
                }
            }
            Ok(Event::FocusLost) => heard.let_go.store(true, Ordering::Relaxed),
            Ok(_) => {}
            Err(_) => {
                heard.gone.store(true, Ordering::Relaxed);
                return;
            }
        }
    }
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
            heard.gone.store(true, Ordering::Relaxed);
        }
        // Beats of a bar that was held before are none of this motion's.
        while poll(Duration::ZERO).unwrap_or(false) && read().is_ok() {}
        let thread = {
            let heard = Arc::clone(&heard);
            std::thread::spawn(move || listen(&heard))
        };
        (self.listening, self.beats) = (Some((heard, thread)), 0);
    }

    fn key(&mut self) -> Key {
        let Some((heard, _)) = &self.listening else { return Key::Gone };
        if heard.gone.load(Ordering::Relaxed) {
            return Key::Gone;
        }
        let beats = heard.beats.load(Ordering::Relaxed);
        if heard.let_go.swap(false, Ordering::Relaxed) {
            self.beats = beats;
            return Key::LetGo;
        }
        let key = if beats == self.beats { Key::Quiet } else { Key::Beat };
        self.beats = beats;
        key
    }
}
