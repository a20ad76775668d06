//! A program's connection that sends inputs: what it knows in, the robot's clock and what became of it out.

use std::collections::BTreeMap;
use std::time::Duration;

use axum::extract::ws::{Message as Frame, WebSocket};
use omnibase_run::live::Stamp;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::connections::STUCK;
use crate::shared::Shared;
use crate::status::{Counters, NS_OF_MS};
use crate::strangers::Allowance;

/// Between two messages to the program.
const TICK: Duration = Duration::from_millis(20);

/// What a program outside knows, as a `[[source]]` of the robot's file: all its values at one instant.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SentInputs {
    /// The source's name.
    pub(crate) source: String,
    /// Its values by name, in their units; null, or left out, for what isn't known now.
    pub(crate) values: BTreeMap<String, Option<f64>>,
    /// When that was so, ms of the robot's clock: the last `clock_ms`, plus the time since then by the program's own
    /// clock. What is older than the source's `max_age_ms`, or than what was heard before, is refused.
    pub(crate) instant_ms: f64,
}

/// What a program is told fifty times a second.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub(crate) struct InputsNews {
    /// The robot's clock, ms.
    clock_ms: f64,
    /// Messages of this connection that were taken.
    heard: u64,
    /// Those that weren't.
    refused: u64,
    /// Why the last of those wasn't.
    #[serde(skip_serializing_if = "Option::is_none")]
    why: Option<String>,
}

/// Listens to a program until it is gone.
pub(crate) async fn listen(mut socket: WebSocket, shared: Shared) {
    let mut news = InputsNews::default();
    let mut allowance = Allowance::of_inputs(shared.gate.elapsed());
    let mut interval = tokio::time::interval(TICK);
    interval.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        tokio::select! {
            _ = interval.tick() => {
                news.clock_ms = shared.live.clock_ns() as f64 / NS_OF_MS as f64;
                let Ok(text) = serde_json::to_string(&news) else { return };
                let sent = tokio::time::timeout(STUCK, socket.send(Frame::text(text))).await;
                if !matches!(sent, Ok(Ok(()))) {
                    return;
                }
            }
            received = socket.recv() => {
                let text = match received {
                    Some(Ok(Frame::Text(text))) => text,
                    Some(Ok(Frame::Ping(_) | Frame::Pong(_))) => continue,
                    Some(Ok(Frame::Binary(_) | Frame::Close(_)) | Err(_)) | None => return,
                };
                // Whoever floods: everybody else has a turn after each message.
                tokio::task::yield_now().await;
                let taken = if allowance.takes(shared.gate.elapsed()) {
                    take(&shared, &text)
                } else {
                    Counters::count(&shared.gate.counters.flooding);
                    Err("too many messages: 5000 a second are taken".to_owned())
                };
                match taken {
                    Ok(()) => news.heard += 1,
                    Err(why) => {
                        news.refused += 1;
                        news.why = Some(why);
                    }
                }
            }
        }
    }
}

fn take(shared: &Shared, text: &str) -> Result<(), String> {
    let sent: SentInputs = serde_json::from_str(text).map_err(|error| {
        Counters::count(&shared.gate.counters.malformed);
        error.to_string()
    })?;
    shared.desk.send_inputs(Stamp::Missing, &sent.source, &sent.values, Some(sent.instant_ms))
}
