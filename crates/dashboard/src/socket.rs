//! One page's connection: messages out, calls in.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{Message, WebSocket};
use omnibase_run::live::Client;
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;

use crate::access::{Denied, Right};
use crate::call::{Call, Said};
use crate::seen::Counters;
use crate::server::Shared;

/// Messages a second that a page may send, and how many at once.
const RATE_1_S: f64 = 200.0;
const BURST: f64 = 400.0;
/// Messages over that after which the connection ends.
const MOST_DROPPED: u32 = 5000;
/// Calls of one page that may wait for their answers.
const WAITING: usize = 32;
/// The longest message that asks for a stop, bytes.
const LONGEST_STOP: usize = 128;
/// A page that takes nothing for so long is gone.
const STUCK: Duration = Duration::from_secs(3);

/// A call with the number by which the page knows its answer.
#[derive(Deserialize)]
struct Numbered {
    #[serde(default)]
    number: u64,
    #[serde(flatten)]
    call: serde_json::Value,
}

#[derive(Serialize)]
struct Answer {
    answer: u64,
    #[serde(flatten)]
    said: Said,
}

#[derive(Serialize)]
struct Welcome {
    /// The page's own name, as others see it; none where it has no session.
    you: Option<String>,
    /// The bit of its stick among the blocked ones.
    stick_bit: Option<u8>,
    /// What it may do.
    may: May,
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

/// How much a page may still send.
struct Allowance {
    left: f64,
    since: Instant,
    dropped: u32,
}

impl Allowance {
    fn new() -> Self {
        Allowance { left: BURST, since: Instant::now(), dropped: 0 }
    }

    fn takes(&mut self) -> bool {
        let now = Instant::now();
        self.left = (self.left + RATE_1_S * (now - self.since).as_secs_f64()).min(BURST);
        self.since = now;
        if self.left >= 1.0 {
            self.left -= 1.0;
            return true;
        }
        self.dropped += 1;
        false
    }
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
fn welcome(session: Option<&Session>, right: Right) -> Welcome {
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
    Welcome { you: client.map(|client| client.to_string()), stick_bit, may }
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
        Counters::count(&shared.counters.crowded);
    }
    if say(&mut socket, &welcome(session.as_ref(), right)).await.is_none() {
        return;
    }
    let mut message = shared.subscribe();
    let (answers, mut answered) = mpsc::channel::<Answer>(WAITING);
    let mut allowance = Allowance::new();
    loop {
        tokio::select! {
            changed = message.changed() => {
                if changed.is_err() {
                    return;
                }
                let text: Arc<str> = message.borrow_and_update().clone();
                if send(&mut socket, Message::text(&*text)).await.is_none() {
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
                    Some(Ok(Message::Text(text))) => text,
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                    Some(Ok(Message::Binary(_))) => {
                        Counters::count(&shared.counters.malformed);
                        continue;
                    }
                    Some(Ok(Message::Close(_))) | None => return,
                    Some(Err(error)) => {
                        // Too long a message ends the connection.
                        if error.to_string().contains("too long") {
                            Counters::count(&shared.counters.oversized);
                        }
                        return;
                    }
                };
                if !allowance.takes() {
                    Counters::count(&shared.counters.flooding);
                    if allowance.dropped > MOST_DROPPED {
                        return;
                    }
                    // A page gone wild may still be stopped by the person before it.
                    if !is_stop(&text) {
                        continue;
                    }
                }
                if right == Right::Command && session.is_none() {
                    session = Session::begin(&shared);
                    if session.is_some() && say(&mut socket, &welcome(session.as_ref(), right)).await.is_none() {
                        return;
                    }
                }
                let caller = match (&session, right) {
                    (Some(session), _) => Caller::Page(session.client),
                    (None, Right::Command) => Caller::Crowded,
                    (None, Right::Read) => Caller::Reader,
                };
                hear(&text, caller, &shared, &answers);
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
    /// A page without the right to command.
    Reader,
}

impl Caller {
    /// As whom it calls, or why it may not.
    fn client(self, call: &Call) -> Result<Client, &'static str> {
        match self {
            Caller::Page(client) => Ok(client),
            Caller::Crowded if call.stops() => Ok(Client::Command),
            Caller::Crowded => Err("refused: all sessions are taken; only stops are heard from here"),
            Caller::Reader => Err(Denied::Token.text()),
        }
    }
}

fn read(text: &str) -> serde_json::Result<(u64, Call)> {
    let Numbered { number, call } = serde_json::from_str(text)?;
    Ok((number, serde_json::from_value(call)?))
}

/// Whether a message asks for a stop. Longer ones aren't looked at: what comes too often costs as good as nothing.
fn is_stop(text: &str) -> bool {
    text.len() <= LONGEST_STOP && read(text).is_ok_and(|(_, call)| call.stops())
}

/// Takes one message in; its answer comes by the channel.
fn hear(text: &str, caller: Caller, shared: &Shared, answers: &mpsc::Sender<Answer>) {
    let (number, call) = match read(text) {
        Ok(read) => read,
        Err(error) => {
            Counters::count(&shared.counters.malformed);
            let _ = answers.try_send(Answer { answer: 0, said: Said::refused(error) });
            return;
        }
    };
    let client = match caller.client(&call) {
        Ok(client) => client,
        Err(why) => {
            if call != Call::Alive {
                Counters::count(&shared.counters.denied);
                let said = Said { done: false, text: why.to_owned() };
                let _ = answers.try_send(Answer { answer: number, said });
            }
            return;
        }
    };
    // Sticks and stops in the order in which they came; what waits for an answer waits beside.
    let shared = shared.clone();
    match shared.take(client, call) {
        crate::desk::Reply::Nothing => {}
        reply => {
            let answers = answers.clone();
            tokio::spawn(async move {
                let said = shared.finish(reply).await;
                let _ = answers.try_send(Answer { answer: number, said });
            });
        }
    }
}

async fn say(socket: &mut WebSocket, what: &impl Serialize) -> Option<()> {
    let text = serde_json::to_string(what).ok()?;
    send(socket, Message::text(text)).await
}

/// Sends; `None` where the page is gone or takes nothing any more.
async fn send(socket: &mut WebSocket, message: Message) -> Option<()> {
    tokio::time::timeout(STUCK, socket.send(message)).await.ok()?.ok()
}
