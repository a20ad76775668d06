//! A program that answers, line by line.
//!
//! Out: `{"tell": …}`, `{"question": {"id", "text", "choices", "default"}}`, `{"hold": …}`. In: `{"answer": …}`,
//! `{"key": true}` for a beat of the held key, `{"key": false}` where it is let go, `{"leave": true}`. The last line out is
//! `{"over": {"is_whole", "findings", "text"}}`.

use super::heard::Heard;
use omnibase_setup::{Answer, Hand, Key, Question};
use serde::Serialize;
use serde_json::{Value, json};
use std::io::{BufRead, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// The longest line, bytes.
const LONGEST_LINE: u64 = 4096;
/// How often is looked whether somebody ends the program.
const LOOK: Duration = Duration::from_millis(50);
/// Lines beside those of the key that may wait to be read.
const WAITING: usize = 16;

/// How a set-up ended.
#[derive(Debug, Serialize)]
pub struct Over {
    /// The robot's file is written as a whole.
    pub is_whole: bool,
    /// What somebody has to look at.
    pub findings: usize,
    /// In words.
    pub text: String,
}

/// A program at an input and an output.
pub struct Lines<W> {
    heard: Arc<Heard>,
    said: Receiver<Value>,
    broken_off: Arc<Mutex<Option<String>>>,
    output: W,
    stop: &'static AtomicBool,
}

impl<W: Write> Lines<W> {
    /// Who speaks at `input` and hears at `output`; `stop` ends it as leaving does.
    pub fn new(input: impl BufRead + Send + 'static, output: W, stop: &'static AtomicBool) -> Self {
        let heard = Arc::new(Heard::default());
        let (sender, said) = sync_channel(WAITING);
        let broken_off = Arc::new(Mutex::new(None));
        let (listening, reason) = (Arc::clone(&heard), Arc::clone(&broken_off));
        std::thread::spawn(move || {
            let ended = listen(input, &listening, &sender);
            *reason.lock().unwrap_or_else(PoisonError::into_inner) = ended.err();
            listening.gone();
        });
        Lines { heard, said, broken_off, output, stop }
    }

    fn say(&mut self, value: &Value) {
        if writeln!(self.output, "{value}").and_then(|()| self.output.flush()).is_err() {
            self.heard.gone();
        }
    }

    /// Says why nobody listens any more, where the program didn't mean it to be so, and how it ended.
    pub fn end(mut self, over: &Over) {
        let why = self.broken_off.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(why) = why {
            self.say(&json!({ "tell": why }));
        }
        self.say(&json!({ "over": over }));
    }
}

/// Hears until the input ends or says that it leaves; an error where it says more than can be kept: then nobody knows what it
/// means. Beats of the key never wait behind anything.
fn listen(mut input: impl BufRead, heard: &Heard, sender: &SyncSender<Value>) -> Result<(), String> {
    let mut line = Vec::new();
    loop {
        line.clear();
        match input.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line) {
            Ok(1..) if line.ends_with(b"\n") => {}
            Ok(0) => return Ok(()),
            Ok(read) if read as u64 == LONGEST_LINE => {
                return Err(format!(
                    "left: expected a line of at most {LONGEST_LINE} bytes, found a longer one"
                ));
            }
            Ok(_) => {
                return Err("left: expected a line that ends, found the end of the input in it".to_owned());
            }
            Err(error) => return Err(format!("left: reading the input: {error}")),
        }
        let value: Value = serde_json::from_slice(&line)
            .unwrap_or_else(|_| json!({ "wrong": String::from_utf8_lossy(&line).trim_end() }));
        match value["key"].as_bool() {
            Some(true) => heard.beat(),
            Some(false) => heard.let_go(),
            _ if value["leave"] == true => return Ok(()),
            _ if sender.try_send(value).is_err() => {
                return Err(format!(
                    "left: expected at most {WAITING} lines that wait to be read, found more"
                ));
            }
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
                (Value::String(text), _) => return Answer::Text(text.clone()),
                (Value::Number(number), _) => return Answer::Text(number.to_string()),
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
        let dropped = self.said.try_iter().count();
        if dropped > 0 {
            let lines = if dropped == 1 { "line was" } else { "lines were" };
            let text =
                format!("{dropped} {lines} said before anything was asked, and dropped: a key is held now");
            self.say(&json!({ "tell": text }));
        }
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
        assert_eq!(lines.output, b"{\"hold\":\"turns\"}\n", "nothing was dropped");
        // A key that stayed down is let go, and pressed anew.
        program.write_all(b"{\"key\": false}\n").unwrap();
        assert_eq!(key(&mut lines), Key::LetGo);
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
    fn answers_that_nobody_asked_for_are_dropped_and_counted() {
        for (said, expected) in [(1, "1 line was said"), (3, "3 lines were said")] {
            let (mut program, mut lines) = lines();
            program.write_all("{\"answer\": \"a\"}\n".repeat(said).as_bytes()).unwrap();
            program.write_all(b"{\"key\": true}\n").unwrap();
            // Behind it all lines are there.
            assert_eq!(key(&mut lines), Key::Beat);
            lines.take_key("turns");
            let told = String::from_utf8(lines.output.clone()).unwrap();
            let expected = format!("{{\"tell\":\"{expected} before anything was asked, and dropped");
            assert!(told.starts_with(&expected) && told.ends_with("{\"hold\":\"turns\"}\n"), "{told}");
        }
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
    fn whoever_says_more_than_can_be_kept_is_gone_and_told_why() {
        let ended = |said: &[u8]| {
            let (mut program, mut lines) = lines();
            program.write_all(said).unwrap();
            drop(program);
            assert_eq!(key(&mut lines), Key::Gone);
            let told = lines.broken_off.lock().unwrap().clone();
            told.unwrap_or_default()
        };
        let many = b"{\"answer\": \"a\"}\n".repeat(WAITING + 1);
        assert_eq!(ended(&many), "left: expected at most 16 lines that wait to be read, found more");
        let long = [b' '; LONGEST_LINE as usize + 1];
        assert_eq!(ended(&long), "left: expected a line of at most 4096 bytes, found a longer one");
        assert_eq!(ended(b"{"), "left: expected a line that ends, found the end of the input in it");
        assert_eq!((ended(b""), ended(b"{\"leave\": true}\n")), (String::new(), String::new()));
        // Bytes that are no text are a wrong answer, as other words are.
        assert_eq!(ended(b"\xff\xfe\n"), "");
    }
}
