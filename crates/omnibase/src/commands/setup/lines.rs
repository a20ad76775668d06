//! A program that answers, line by line.
//!
//! Out: `{"tell": …}`, `{"question": {"id", "text", "choices", "default"}}`, `{"hold": …}`. In: `{"answer": …}`,
//! `{"key": true}` for a beat of the held key, `{"key": false}` where it is let go, `{"leave": true}`.

use omnibase_setup::{Answer, Hand, Key, Question};
use serde_json::{Value, json};
use std::io::{BufRead, Write};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// A program at the standard input and output.
pub struct Lines {
    heard: Receiver<Value>,
    /// The input has ended.
    is_gone: bool,
}

impl Lines {
    pub fn new() -> Self {
        let (sender, heard) = channel();
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines() {
                let Ok(line) = line else { return };
                let value = serde_json::from_str(&line).unwrap_or_else(|_| json!({ "wrong": line }));
                if sender.send(value).is_err() {
                    return;
                }
            }
        });
        Lines { heard, is_gone: false }
    }

    fn say(&mut self, value: &Value) {
        let mut output = std::io::stdout().lock();
        let said = writeln!(output, "{value}").and_then(|()| output.flush());
        self.is_gone |= said.is_err();
    }
}

impl Hand for Lines {
    fn ask(&mut self, question: &Question) -> Answer {
        self.say(&json!({ "question": question }));
        loop {
            let Ok(value) = self.heard.recv() else { return Answer::Leave };
            match (&value["answer"], &value["leave"], &value["wrong"]) {
                (_, Value::Bool(true), _) => return Answer::Leave,
                (Value::String(text), ..) => return Answer::Said(text.clone()),
                (Value::Number(number), ..) => return Answer::Said(number.to_string()),
                (_, _, Value::String(line)) => {
                    let text =
                        format!("expected a JSON object such as {{\"answer\": \"left\"}}, found {line}");
                    self.say(&json!({ "tell": text }));
                }
                // Beats of a key that nobody waits for any more.
                _ => {}
            }
        }
    }

    fn tell(&mut self, text: &str) {
        self.say(&json!({ "tell": text }));
    }

    fn take_key(&mut self, what: &str) {
        while self.heard.try_recv().is_ok() {}
        self.say(&json!({ "hold": what }));
    }

    fn key(&mut self) -> Key {
        if self.is_gone {
            return Key::Gone;
        }
        let mut key = Key::Quiet;
        loop {
            match self.heard.try_recv() {
                Ok(value) => match value["key"] {
                    Value::Bool(true) => key = Key::Beat,
                    Value::Bool(false) => return Key::LetGo,
                    _ if value["leave"] == true => return Key::Gone,
                    _ => {}
                },
                Err(TryRecvError::Empty) => return key,
                Err(TryRecvError::Disconnected) => return Key::Gone,
            }
        }
    }
}
