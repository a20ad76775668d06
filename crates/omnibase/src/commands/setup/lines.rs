//! A program that answers, line by line.
//!
//! Out: `{"tell": …}`, `{"question": {"id", "text", "choices", "default"}}`, `{"hold": …}`. In: `{"answer": …}`,
//! `{"key": true}` for a beat of the held key, `{"key": false}` where it is let go, `{"leave": true}`.

use super::heard::Heard;
use omnibase_setup::{Answer, Hand, Key, Question};
use serde_json::{Value, json};
use std::io::{BufRead, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// The longest line, bytes.
const LONGEST_LINE: u64 = 4096;
/// How often is looked whether somebody ends the program.
const LOOK: Duration = Duration::from_millis(50);
/// Lines beside those of the key that may wait to be read.
const WAITING: usize = 16;

/// A program at an input and an output.
pub struct Lines<W> {
    heard: Arc<Heard>,
    said: Receiver<Value>,
    output: W,
    stop: &'static AtomicBool,
}

impl<W: Write> Lines<W> {
    /// Who speaks at `input` and hears at `output`; `stop` ends it as leaving does.
    pub fn new(input: impl BufRead + Send + 'static, output: W, stop: &'static AtomicBool) -> Self {
        let heard = Arc::new(Heard::default());
        let (sender, said) = sync_channel(WAITING);
        let listening = Arc::clone(&heard);
        std::thread::spawn(move || {
            listen(input, &listening, &sender);
            listening.gone();
        });
        Lines { heard, said, output, stop }
    }

    fn say(&mut self, value: &Value) {
        if writeln!(self.output, "{value}").and_then(|()| self.output.flush()).is_err() {
            self.heard.gone();
        }
    }
}

/// Hears until the input ends, says that it leaves, or says more than can be kept: then nobody knows what it means. Beats of the
/// key never wait behind anything.
fn listen(mut input: impl BufRead, heard: &Heard, sender: &SyncSender<Value>) {
    let mut line = String::new();
    loop {
        line.clear();
        match input.by_ref().take(LONGEST_LINE).read_line(&mut line) {
            Ok(1..) if line.ends_with('\n') => {}
            _ => return,
        }
        let value: Value =
            serde_json::from_str(&line).unwrap_or_else(|_| json!({ "wrong": line.trim_end() }));
        match value["key"].as_bool() {
            Some(true) => heard.beat(),
            Some(false) => heard.let_go(),
            _ if value["leave"] == true => return,
            _ if sender.try_send(value).is_err() => return,
            _ => {}
        }
    }
}

impl<W: Write> Hand for Lines<W> {
    fn ask(&mut self, question: &Question) -> Answer {
        self.say(&json!({ "question": question }));
        loop {
            let value = match self.said.recv_timeout(LOOK) {
                _ if self.stop.load(Ordering::Relaxed) => return Answer::Leave,
                Ok(value) => value,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return Answer::Leave,
            };
            match (&value["answer"], &value["wrong"]) {
                (Value::String(text), _) => return Answer::Said(text.clone()),
                (Value::Number(number), _) => return Answer::Said(number.to_string()),
                (_, wrong) => {
                    let found = wrong.as_str().map_or_else(|| value.to_string(), str::to_owned);
                    let text =
                        format!("expected a JSON object such as {{\"answer\": \"left\"}}, found {found}");
                    self.say(&json!({ "tell": text }));
                }
            }
        }
    }

    fn tell(&mut self, text: &str) {
        self.say(&json!({ "tell": text }));
    }

    fn take_key(&mut self, what: &str) {
        // Answers to questions that nobody asked.
        while self.said.try_recv().is_ok() {}
        self.heard.begin();
        self.say(&json!({ "hold": what }));
    }

    fn key(&mut self) -> Key {
        if self.stop.load(Ordering::Relaxed) { Key::Gone } else { self.heard.key() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufReader, PipeWriter, pipe};
    use std::time::Instant;

    static NEVER: AtomicBool = AtomicBool::new(false);

    fn lines() -> (PipeWriter, Lines<Vec<u8>>) {
        let (reader, writer) = pipe().unwrap();
        (writer, Lines::new(BufReader::new(reader), Vec::new(), &NEVER))
    }

    /// The next thing that is heard of the key.
    fn key(lines: &mut Lines<Vec<u8>>) -> Key {
        let begun = Instant::now();
        loop {
            match lines.key() {
                Key::Quiet if begun.elapsed() < Duration::from_secs(10) => std::thread::yield_now(),
                key => return key,
            }
        }
    }

    #[test]
    fn beats_from_before_a_motion_are_none_of_its_own_and_leaving_is_never_lost() {
        let (mut program, mut lines) = lines();
        program.write_all(b"{\"key\": true}\n{\"key\": true}\n").unwrap();
        assert_eq!(key(&mut lines), Key::Beat);
        program.write_all(b"{\"key\": true}\n{\"answer\": \"a\"}\n").unwrap();
        assert_eq!(lines.said.recv().unwrap()["answer"], "a");
        lines.take_key("turns");
        assert_eq!(lines.key(), Key::Quiet);
        program.write_all(b"{\"key\": true}\n").unwrap();
        assert_eq!(key(&mut lines), Key::Beat);
        program.write_all(b"{\"key\": false}\n").unwrap();
        assert_eq!(key(&mut lines), Key::LetGo);

        program.write_all(b"{\"leave\": true}\n").unwrap();
        assert_eq!(key(&mut lines), Key::Gone);
        lines.take_key("turns again");
        assert_eq!(lines.key(), Key::Gone);
        let question = Question { id: "wheel 0".into(), text: String::new(), choices: vec![], default: None };
        assert_eq!(lines.ask(&question), Answer::Leave);
    }

    #[test]
    fn whoever_ends_the_program_leaves_a_question_and_a_motion() {
        let (_program, mut lines) = lines();
        lines.take_key("turns");
        assert_eq!(lines.key(), Key::Quiet);
        static STOP: AtomicBool = AtomicBool::new(true);
        lines.stop = &STOP;
        assert_eq!(lines.key(), Key::Gone);
        let question = Question { id: "wheel 0".into(), text: String::new(), choices: vec![], default: None };
        assert_eq!(lines.ask(&question), Answer::Leave);
    }

    #[test]
    fn whoever_says_more_than_can_be_kept_is_gone() {
        let (mut program, mut many) = lines();
        for _ in 0..=WAITING {
            program.write_all(b"{\"answer\": \"a\"}\n").unwrap();
        }
        assert_eq!(key(&mut many), Key::Gone);
        let (mut program, mut long) = lines();
        program.write_all(&[b' '; LONGEST_LINE as usize + 1]).unwrap();
        assert_eq!(key(&mut long), Key::Gone);
        let (program, mut ended) = lines();
        drop(program);
        assert_eq!(key(&mut ended), Key::Gone);
    }
}
