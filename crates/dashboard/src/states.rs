//! Every cycle, or every so many, for programs that follow the robot: chosen signals with their instants.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::extract::ws::{Message as Frame, WebSocket};
use omnibase_record::run::{Due, Selection};
use omnibase_run::channels::{self, Rows};
use omnibase_run::live::Following;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tokio::sync::broadcast::{self, Receiver, Sender, error::RecvError};

use crate::access::Right;
use crate::connections::STUCK;
use crate::robot_info::API_VERSION;
use crate::shared::Shared;
use crate::status::{Counters, NS_OF_MS};

/// Between two looks at what the cycle said.
const TICK: Duration = Duration::from_millis(2);
/// Cycles that are kept for a program that is slow.
const KEPT: usize = 1024;
/// Programs that follow at the same time; of these places some are kept for those that may command.
const MOST: usize = 8;
const MOST_READERS: usize = 4;

/// What a program wants to follow.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wanted {
    /// Names as `state.pose_x_m`, with commas between them, where `*` stands for any characters; default: all.
    signals: Option<String>,
    /// Time from row to row, ms: a whole multiple of the cycle; default: every cycle.
    every_ms: Option<f64>,
}

/// What a program is told before the first row.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub(crate) struct StatesBegin {
    /// The API's version.
    version: &'static str,
    /// The robot's name.
    robot: String,
    /// The robot's clock, ms.
    clock_ms: f64,
    /// The cycle, ms.
    cycle_ms: f64,
    /// Time from row to row, ms.
    every_ms: f64,
    /// Names of a row's values, in their order; their units end them.
    signals: Vec<String>,
}

/// Which values of which cycles.
pub(crate) struct Chosen {
    columns: Vec<usize>,
    selection: Selection,
    begin: StatesBegin,
}

impl Chosen {
    /// What of a robot is wanted, or why that can't be had.
    pub(crate) fn new(wanted: &Wanted, shared: &Shared) -> Result<Chosen, String> {
        let about = &shared.desk.about;
        let plan = &about.robot.plan;
        let patterns = wanted.signals.as_deref().unwrap_or_default().split(',').map(str::trim);
        let signals: Vec<String> = patterns.filter(|name| !name.is_empty()).map(str::to_owned).collect();
        for pattern in &signals {
            channels::known(pattern, plan).map_err(|why| format!("signals: `{pattern}`: {why}"))?;
        }
        let cycle_ns = plan.bus.cycle_ns;
        let cycle_ms = cycle_ns as f64 / NS_OF_MS as f64;
        let every_ns = match wanted.every_ms {
            None => cycle_ns,
            Some(ms) => {
                let ns = (ms * NS_OF_MS as f64).round();
                let is_multiple = ns >= cycle_ns as f64 && ns <= 1e12 && (ns as u64).is_multiple_of(cycle_ns);
                if !is_multiple {
                    return Err(format!(
                        "every_ms: expected a whole multiple of the cycle of {cycle_ms} ms, found {ms}"
                    ));
                }
                ns as u64
            }
        };
        let selection = Selection { signals, every_ns: Some(every_ns).filter(|ns| *ns != cycle_ns) };
        let rows = about.rows();
        let columns = selection.columns(rows.schema());
        if columns.is_empty() {
            return Err("signals: none of them is known of this robot".to_owned());
        }
        let begin = StatesBegin {
            version: API_VERSION,
            robot: plan.name.clone(),
            clock_ms: shared.live.clock_ns() as f64 / NS_OF_MS as f64,
            cycle_ms,
            every_ms: every_ns as f64 / NS_OF_MS as f64,
            signals: rows.schema().only(&columns).names().collect(),
        };
        Ok(Chosen { columns, selection, begin })
    }
}

/// A cycle's values.
pub(crate) struct Row {
    number: u64,
    instant_ns: u64,
    values: Box<[f64]>,
}

/// Those who follow: cycles are read once for all of them.
#[derive(Default)]
pub(crate) struct Followers(Mutex<Option<Sender<Arc<Row>>>>);

impl Followers {
    /// The rows from now on; nothing where all places are taken.
    pub(crate) fn join(self: &Arc<Self>, shared: &Shared, right: Right) -> Option<Receiver<Arc<Row>>> {
        let mut rows = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(rows) = rows.as_ref() {
            let most = if right == Right::Command { MOST } else { MOST_READERS };
            return (rows.receiver_count() < most).then(|| rows.subscribe());
        }
        let following = shared.live.follow()?;
        let (sender, receiver) = broadcast::channel(KEPT);
        *rows = Some(sender);
        shared.work.spawn(read(self.clone(), following, shared.desk.about.rows()));
        Some(receiver)
    }

    /// Where rows go; at the end of the last who follows reading ends too, before another one may begin.
    fn sender(&self, following: &mut Option<Following>) -> Option<Sender<Arc<Row>>> {
        let mut rows = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if rows.as_ref().is_none_or(|rows| rows.receiver_count() == 0) {
            *rows = None;
            *following = None;
        }
        rows.clone()
    }
}

async fn read(followers: Arc<Followers>, following: Following, mut rows: Rows) {
    let mut following = Some(following);
    let mut interval = tokio::time::interval(TICK);
    interval.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    loop {
        interval.tick().await;
        let Some(sender) = followers.sender(&mut following) else { return };
        while let Some(cycle) = following.as_mut().and_then(Following::next_cycle) {
            let values = rows.of(&cycle.record, &cycle.extras).into();
            let row = Row { number: cycle.number, instant_ns: cycle.record.time.now_ns, values };
            // Whoever followed may be gone.
            let _ = sender.send(Arc::new(row));
        }
    }
}

/// Rows as they are sent: the cycles that are missing so far, then for each row its instant on the robot's clock, ns, and its
/// values; u64 and f64, little-endian.
struct Written {
    columns: Vec<usize>,
    due: Due,
    missing: u64,
    last: Option<u64>,
    bytes: Vec<u8>,
}

impl Written {
    fn take(&mut self, row: &Row) {
        let before = self.last.replace(row.number);
        self.missing += before.map_or(0, |before| row.number.saturating_sub(before + 1));
        if !self.due.take(row.instant_ns) {
            return;
        }
        if self.bytes.is_empty() {
            self.bytes.extend([0; 8]);
        }
        self.bytes.extend(row.instant_ns.to_le_bytes());
        self.bytes.extend(self.columns.iter().flat_map(|&column| row.values[column].to_le_bytes()));
    }

    /// What is to be sent, if anything is.
    fn message(&mut self) -> Option<Frame> {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.get_mut(..8)?.copy_from_slice(&self.missing.to_le_bytes());
        Some(Frame::binary(bytes))
    }
}

/// Tells a program what it wants to follow, until it is gone.
pub(crate) async fn stream(
    mut socket: WebSocket,
    mut rows: Receiver<Arc<Row>>,
    chosen: Chosen,
    shared: Shared,
) {
    let Chosen { columns, selection, begin } = chosen;
    let due = Due::new(&selection);
    let mut written = Written { columns, due, missing: 0, last: None, bytes: Vec::new() };
    let Ok(begin) = serde_json::to_string(&begin) else { return };
    if !sent(&mut socket, Frame::text(begin)).await {
        return;
    }
    loop {
        tokio::select! {
            row = rows.recv() => {
                match row {
                    Ok(row) => written.take(&row),
                    // Found by their numbers.
                    Err(RecvError::Lagged(_)) => continue,
                    Err(RecvError::Closed) => return,
                }
                while let Ok(row) = rows.try_recv() {
                    written.take(&row);
                }
                if let Some(message) = written.message()
                    && !sent(&mut socket, message).await
                {
                    return;
                }
            }
            received = socket.recv() => match received {
                Some(Ok(Frame::Ping(_) | Frame::Pong(_))) => {}
                // Here nothing is asked.
                Some(Ok(Frame::Text(_) | Frame::Binary(_))) => Counters::count(&shared.gate.counters.malformed),
                Some(Ok(Frame::Close(_)) | Err(_)) | None => return,
            },
        }
    }
}

async fn sent(socket: &mut WebSocket, message: Frame) -> bool {
    matches!(tokio::time::timeout(STUCK, socket.send(message)).await, Ok(Ok(())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_chosen_and_what_is_missing_is_counted() {
        let selection = Selection { signals: Vec::new(), every_ns: Some(2_000_000) };
        let mut written = Written {
            columns: vec![2, 0],
            due: Due::new(&selection),
            missing: 0,
            last: None,
            bytes: Vec::new(),
        };
        let words = |message: Option<Frame>| -> Vec<u64> {
            let Some(Frame::Binary(bytes)) = message else { return Vec::new() };
            bytes.chunks(8).map(|word| u64::from_le_bytes(word.try_into().unwrap())).collect()
        };
        assert_eq!(words(written.message()), Vec::<u64>::new());
        for number in [5, 6, 9, 10] {
            let value = number as f64;
            let values = [value, 0.0, -value].into();
            written.take(&Row { number, instant_ns: number * 1_000_000, values });
        }
        // Every second ms, and cycles 7 and 8 are missing.
        let row = |number: u64| {
            let value = number as f64;
            [number * 1_000_000, (-value).to_bits(), value.to_bits()]
        };
        let expected: Vec<u64> = std::iter::once(2).chain([5, 6, 9, 10].into_iter().flat_map(row)).collect();
        assert_eq!(words(written.message()), expected);
        assert_eq!(words(written.message()), Vec::<u64>::new());
    }
}
