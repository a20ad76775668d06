//! One page's connection: messages out, calls in.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use axum::extract::ws::{Message as Frame, WebSocket};
use omnibase_run::live::{Asker, Client, Stamp};
use serde::Serialize;
use tokio::sync::mpsc;

use crate::access::Right;
use crate::call::{Call, CallResult, Message};
use crate::call_handler::Reply;
use crate::connections::{READ_AT_ONCE, STUCK};
use crate::shared::{Shared, stamp_of};
use crate::status::Counters;
use crate::strangers::Allowance;
use crate::work::{For, Waiting};

/// Messages over that after which the connection ends.
const MOST_DROPPED: u32 = 5000;
/// Calls of one page that may wait for their answers.
const WAITING: usize = 32;
/// The longest message that asks for a stop or its release, bytes.
const LONGEST_AT_ONCE: usize = 128;

#[derive(Serialize)]
struct Answer {
    answer: u64,
    /// The robot's clock, ms: what was asked came to it before.
    stamp: u64,
    #[serde(flatten)]
    said: CallResult,
}

#[derive(Serialize)]
struct Welcome {
    /// The page's own name, as others see it; none where it has no session.
    you: Option<String>,
    /// The bit of its stick among the blocked ones.
    stick_bit: Option<u8>,
    /// What it may do.
    may: May,
    /// The robot's clock, ms: the first stamp that the page has.
    stamp: u64,
}

/// What a page may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum May {
    /// Look.
    Look,
    /// Look and stop the robot: it might command, but all sessions are taken.
    Stop,
    /// Everything.
    Command,
}

/// Ends a page's session however its connection ends.
struct Session {
    shared: Shared,
    client: Client,
}

impl Session {
    /// A session, where one is free.
    fn begin(shared: &Shared) -> Option<Session> {
        Some(Session { shared: shared.clone(), client: shared.live.begin_session()? })
    }
}

/// What a page is told of itself.
fn welcome(session: Option<&Session>, right: Right, stamp: u64) -> Welcome {
    let client = session.map(|session| session.client);
    let may = match (client, right) {
        (Some(_), _) => May::Command,
        (None, Right::Command) => May::Stop,
        (None, Right::Read) => May::Look,
    };
    let stick_bit = match client {
        Some(Client::Page(number)) => Some(1 + number),
        _ => None,
    };
    Welcome { you: client.map(|client| client.to_string()), stick_bit, may, stamp }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.shared.live.end_session(self.client);
    }
}

/// Talks with a page until it is gone.
pub(crate) async fn talk(mut socket: WebSocket, shared: Shared, right: Right) {
    let mut session = (right == Right::Command).then(|| Session::begin(&shared)).flatten();
    if right == Right::Command && session.is_none() {
        Counters::count(&shared.gate.counters.crowded);
    }
    if say(&mut socket, &welcome(session.as_ref(), right, shared.stamp())).await.is_none() {
        return;
    }
    let mut message = shared.subscribe();
    let (answers, mut answered) = mpsc::channel::<Answer>(WAITING);
    let (mut allowance, mut dropped) = (Allowance::new(shared.gate.elapsed()), 0);
    let lane = Lane::new(&shared, &answers);
    let mut delay_ms = None;
    loop {
        tokio::select! {
            changed = message.changed() => {
                if changed.is_err() {
                    return;
                }
                let text: Arc<str> = message.borrow_and_update().clone();
                let text = with_delay(&text, delay_ms);
                if send(&mut socket, Frame::text(text)).await.is_none() {
                    return;
                }
            }
            Some(answer) = answered.recv() => {
                if say(&mut socket, &answer).await.is_none() {
                    return;
                }
            }
            received = socket.recv() => {
                let text = match received {
                    Some(Ok(Frame::Text(text))) => text,
                    Some(Ok(Frame::Ping(_) | Frame::Pong(_))) => continue,
                    Some(Ok(Frame::Binary(_))) => {
                        Counters::count(&shared.gate.counters.malformed);
                        continue;
                    }
                    Some(Ok(Frame::Close(_))) | None => return,
                    Some(Err(error)) => {
                        // Too long a message ends the connection.
                        if error.to_string().contains("too long") {
                            Counters::count(&shared.gate.counters.oversized);
                        }
                        return;
                    }
                };
                // Whoever floods: everybody else has a turn after each message.
                tokio::task::yield_now().await;
                if !allowance.takes(shared.gate.elapsed()) {
                    Counters::count(&shared.gate.counters.flooding);
                    dropped += 1;
                    if dropped > MOST_DROPPED {
                        return;
                    }
                    // A page gone wild may still be stopped by the person before it.
                    if at_once(text.as_bytes()).is_none() {
                        continue;
                    }
                }
                if right == Right::Command && session.is_none() {
                    session = Session::begin(&shared);
                    if session.is_some() && say(&mut socket, &welcome(session.as_ref(), right, shared.stamp())).await.is_none() {
                        return;
                    }
                }
                let caller = match (&session, right) {
                    (Some(session), _) => Caller::Page(session.client),
                    (None, Right::Command) => Caller::Crowded,
                    (None, Right::Read) => Caller::Reader,
                };
                if let Some(stamp) = hear(&text, caller, &lane) {
                    delay_ms = shared.stamp().checked_sub(stamp);
                }
            }
        }
    }
}

/// Who calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Caller {
    /// A page with a session.
    Page(Client),
    /// A page that might command, where all sessions are taken: its stops count.
    Crowded,
    /// A page without the right to command, on this computer: its stops count.
    Reader,
}

impl Caller {
    /// As whom it calls, or why it may not.
    fn client(self, call: &Call) -> Result<Client, &'static str> {
        match self {
            Caller::Page(client) => Ok(client),
            Caller::Crowded | Caller::Reader if call.stops() => Ok(Client::Command),
            Caller::Crowded => Err("refused: all sessions are taken; only stops are heard from here"),
            Caller::Reader => Err("refused: without the token one may look, and stop"),
        }
    }
}

/// A message that asks for a stop or its release. Longer ones aren't looked at: what comes too often costs as good as
/// nothing.
pub(crate) fn at_once(text: &[u8]) -> Option<Message> {
    let is_short = text.len() <= LONGEST_AT_ONCE;
    let message: Message = is_short.then(|| Message::read(text).ok()).flatten()?;
    (message.call.stops() || message.call == Call::Release).then_some(message)
}

/// Something that waits for what the same page asked before it.
struct Job {
    caller: Caller,
    asker: Asker,
    what: What,
}

/// What a page asks.
enum What {
    /// As it was sent: it is long, and reading it takes its time.
    Written(String),
    /// Read.
    Read(Message),
}

/// What one page asked that takes its time, in the order in which it came; stops and sticks don't wait in it.
struct Lane {
    shared: Shared,
    answers: mpsc::Sender<Answer>,
    jobs: mpsc::Sender<Job>,
    /// Jobs that aren't done.
    left: Arc<AtomicUsize>,
}

impl Lane {
    fn new(shared: &Shared, answers: &mpsc::Sender<Answer>) -> Self {
        let (jobs, mut next) = mpsc::channel::<Job>(WAITING);
        let left = Arc::new(AtomicUsize::new(0));
        let lane = Lane { shared: shared.clone(), answers: answers.clone(), jobs, left: left.clone() };
        let (shared, answers) = (shared.clone(), answers.clone());
        tokio::spawn(async move {
            while let Some(job) = next.recv().await {
                job.take(&shared, &answers).await;
                left.fetch_sub(1, Ordering::Relaxed);
            }
        });
        lane
    }

    fn is_free(&self) -> bool {
        self.left.load(Ordering::Relaxed) == 0
    }

    fn push(&self, job: Job) {
        let number = job.number();
        self.left.fetch_add(1, Ordering::Relaxed);
        if self.jobs.try_send(job).is_err() {
            self.left.fetch_sub(1, Ordering::Relaxed);
            self.say(number, CallResult::refused("too much was asked at once"));
        }
    }

    fn say(&self, number: u64, said: CallResult) {
        let _ = self.answers.try_send(Answer { answer: number, stamp: self.shared.stamp(), said });
    }
}

impl Job {
    fn number(&self) -> u64 {
        match &self.what {
            What::Written(_) => 0,
            What::Read(message) => message.number,
        }
    }

    async fn take(self, shared: &Shared, answers: &mpsc::Sender<Answer>) {
        let Job { caller, asker, what } = self;
        let read = match what {
            What::Read(message) => Ok(message),
            What::Written(text) => {
                let read = shared.work.run(For::Commander, move || Message::read(text.as_bytes())).await;
                read.map_err(|busy| busy.to_string()).flatten()
            }
        };
        let (number, reply) = match read {
            Ok(Message { number, stamp_ms, call }) => match caller.client(&call) {
                Ok(_) => (number, shared.take(asker.stamped(stamp_of(stamp_ms)), call).await),
                Err(why) => (number, Reply::CallResult(CallResult::not_done(why))),
            },
            Err(why) => {
                Counters::count(&shared.gate.counters.malformed);
                (0, Reply::CallResult(CallResult::refused(why)))
            }
        };
        tell(number, reply, shared, answers);
    }
}

/// Tells a page what came of a call, once that is known.
fn tell(number: u64, reply: Reply, shared: &Shared, answers: &mpsc::Sender<Answer>) {
    if matches!(reply, Reply::Nothing) {
        return;
    }
    let (shared, answers) = (shared.clone(), answers.clone());
    tokio::spawn(async move {
        let said = shared.finish(reply).await;
        let _ = answers.try_send(Answer { answer: number, stamp: shared.stamp(), said });
    });
}

/// The message to all pages, with how long this page's own messages take: from the stamp that it had to being heard.
fn with_delay(text: &str, delay_ms: Option<u64>) -> String {
    let open = text.strip_suffix('}').unwrap_or(text);
    let comma = if open.ends_with('{') { "" } else { "," };
    let delay_ms = delay_ms.map_or("null".to_owned(), |delay_ms| delay_ms.to_string());
    format!("{open}{comma}\"delay_ms\":{delay_ms}}}")
}

/// Takes one message in; its answer comes by the channel. The stamp that it has, where that is known at once.
fn hear(text: &str, caller: Caller, lane: &Lane) -> Option<u64> {
    let shared = &lane.shared;
    // As whom it calls where it may; what it may is looked at once it is read.
    let client = if let Caller::Page(client) = caller { client } else { Client::Command };
    let asker = shared.live.asker(client, Stamp::Missing);
    if text.len() > READ_AT_ONCE {
        if caller == Caller::Reader {
            Counters::count(&shared.gate.counters.denied);
        } else {
            lane.push(Job { caller, asker, what: What::Written(text.to_owned()) });
        }
        return None;
    }
    let message = match Message::read(text.as_bytes()) {
        Ok(message) => message,
        Err(error) => {
            Counters::count(&shared.gate.counters.malformed);
            lane.say(0, CallResult::refused(error));
            return None;
        }
    };
    let Message { number, stamp_ms, .. } = message;
    if let Err(why) = caller.client(&message.call) {
        if message.call != Call::Alive {
            Counters::count(&shared.gate.counters.denied);
            lane.say(number, CallResult::not_done(why));
        }
        return stamp_ms;
    }
    let is_next = lane.is_free() && !message.call.computes();
    if is_next || message.call.goes_first() {
        let reply = shared.desk.take(asker.stamped(stamp_of(stamp_ms)), message.call, &Waiting::here());
        tell(number, reply, shared, &lane.answers);
    } else {
        lane.push(Job { caller, asker, what: What::Read(message) });
    }
    stamp_ms
}

async fn say(socket: &mut WebSocket, what: &impl Serialize) -> Option<()> {
    let text = serde_json::to_string(what).ok()?;
    send(socket, Frame::text(text)).await
}

/// Sends; `None` where the page is gone or takes nothing any more.
async fn send(socket: &mut WebSocket, message: Frame) -> Option<()> {
    tokio::time::timeout(STUCK, socket.send(message)).await.ok()?.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_has_the_delay_of_the_page_that_gets_it() {
        assert_eq!(with_delay("{}", None), r#"{"delay_ms":null}"#);
        assert_eq!(with_delay(r#"{"stamp":12}"#, Some(7)), r#"{"stamp":12,"delay_ms":7}"#);
    }
}
