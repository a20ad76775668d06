//! What all requests share, and what each of them may do.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use omnibase_robot::signals::RequestAnswer;
use omnibase_run::live::{Answer, Asker, Live, Stamp};
use tokio::sync::watch;

use crate::access::Access;
use crate::call::{Call, CallResult};
use crate::call_handler::{CallHandler, Reply};
use crate::gate::Gate;
use crate::states::Followers;
use crate::status::{Counters, NS_OF_MS, SourceSeen, StatusMessage, unfit};
use crate::work::{For, Waiting, Work};

/// The longest wait for the robot's answer.
const ANSWER: Duration = Duration::from_secs(2);
/// How often an answer is looked for.
const LOOK: Duration = Duration::from_millis(5);

/// What all requests share. Each lock in it is held for a moment, and never while something is computed.
#[derive(Clone)]
pub(crate) struct Shared {
    pub(crate) gate: Gate,
    pub(crate) desk: Arc<CallHandler>,
    pub(crate) live: Live,
    pub(crate) work: Work,
    pub(crate) followers: Arc<Followers>,
    /// The latest message, to all pages.
    pub(crate) sender: watch::Sender<Arc<str>>,
    /// What `/api/now` said last.
    pub(crate) now: Arc<Mutex<Option<SaidNow>>>,
}

/// What `/api/now` said, and when.
pub(crate) struct SaidNow {
    pub(crate) at: Instant,
    pub(crate) text: Arc<str>,
}

impl Shared {
    pub(crate) fn new(access: Access, desk: CallHandler, counters: Arc<Counters>, work: Work) -> Self {
        let (sender, _) = watch::channel(Arc::from("{}"));
        Shared {
            gate: Gate::new(access, counters),
            live: desk.live.clone(),
            desk: Arc::new(desk),
            work,
            followers: Arc::default(),
            sender,
            now: Arc::default(),
        }
    }

    /// Carries a call out, elsewhere where that takes more than a moment.
    pub(crate) async fn take(&self, asker: Asker, call: Call) -> Reply {
        if !call.computes() {
            return self.desk.take(asker, call, &Waiting::here());
        }
        let desk = self.desk.clone();
        // Who no longer waits has this dropped.
        let waits = Arc::new(());
        let waiting = Waiting::of(&waits);
        let taken = self.work.run(For::Commander, move || desk.take(asker, call, &waiting)).await;
        drop(waits);
        taken.unwrap_or_else(|busy| Reply::CallResult(CallResult::refused(busy)))
    }

    /// The robot's clock as it was last seen, ms.
    pub(crate) fn stamp(&self) -> u64 {
        self.live.clock_ns() / NS_OF_MS
    }

    /// Puts into a message what is known outside the cycle.
    pub(crate) fn complete(&self, seen: &mut StatusMessage) {
        seen.sources = self.live.source_counts().into_iter().map(SourceSeen::from).collect();
        seen.teaching_since_s = self.desk.teaching_since_s();
        seen.taught_points = self.live.points().map(|points| points.len());
        seen.walls = self.desk.drive_to.walls_number();
        seen.drive_to = self.desk.drive_to.seen();
        seen.server = self.gate.counters.all();
    }

    /// The messages from now on.
    pub(crate) fn subscribe(&self) -> watch::Receiver<Arc<str>> {
        self.sender.subscribe()
    }

    /// What `/api/now` said a moment ago.
    pub(crate) fn said_now(&self, within: Duration) -> Option<Arc<str>> {
        let now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        let SaidNow { at, text } = now.as_ref()?;
        (at.elapsed() < within).then(|| text.clone())
    }

    /// What came of a call, once the robot answered.
    pub(crate) async fn finish(&self, reply: Reply) -> CallResult {
        match reply {
            Reply::Nothing => CallResult::done("done"),
            Reply::CallResult(said) => said,
            Reply::Ticket(ticket, text) => self.answer(ticket, text).await,
            Reply::Bus(call, plan) => {
                let line = self.live.acyclic().clone();
                // It sleeps more than it computes: not in the threads that compute for others.
                let answered = tokio::task::spawn_blocking(move || call.answer(&line, &plan)).await;
                answered.unwrap_or_else(CallResult::refused)
            }
        }
    }

    async fn answer(&self, ticket: u64, text: String) -> CallResult {
        let mut waited = Duration::ZERO;
        while waited < ANSWER {
            if let Some(answer) = self.live.answer(ticket) {
                return match answer {
                    _ if answer.is_done() => CallResult::done(text),
                    Answer::Robot(RequestAnswer::WrongPhase) => {
                        CallResult::not_done(unfit(self.live.snapshot().phase))
                    }
                    other => CallResult::not_done(other.text()),
                };
            }
            tokio::time::sleep(LOOK).await;
            waited += LOOK;
        }
        CallResult::refused("the robot's cycle doesn't answer")
    }
}

/// A stamp as messages have it.
pub(crate) fn stamp_of(stamp_ms: Option<u64>) -> Stamp {
    stamp_ms.map_or(Stamp::Missing, |ms| Stamp::Told(ms.saturating_mul(NS_OF_MS)))
}
