//! The values of a running robot for other people's plots: PlotJuggler by UDP.

use std::net::SocketAddr;
use std::time::Duration;

use omnibase_record::run::RunSchema;
use omnibase_run::channels::Rows;
use omnibase_run::live::Live;
use serde_json::{Map, Value};
use tokio::net::UdpSocket;

/// Between two messages.
pub(crate) const TICK: Duration = Duration::from_millis(10);

/// Where a robot is shown beside its page, a hundred times a second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Streams {
    /// PlotJuggler's UDP server: one JSON object a datagram.
    pub plotjuggler: Option<SocketAddr>,
    /// Where the Foxglove app finds its server; loopback, for whoever connects may read.
    pub foxglove: Option<SocketAddr>,
}

/// Sends to PlotJuggler until the runtime ends. A receiver that isn't there costs nothing but the datagram.
pub(crate) async fn plot(live: Live, mut rows: Rows, target: SocketAddr) {
    let Some(socket) = connected(target).await else { return };
    let schema = rows.schema().clone();
    let mut interval = tokio::time::interval(TICK);
    interval.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut sent_cycles = 0;
    loop {
        interval.tick().await;
        let snapshot = live.snapshot();
        if snapshot.cycles == sent_cycles {
            continue;
        }
        sent_cycles = snapshot.cycles;
        let topics = topics(&schema, rows.of(&snapshot.record, &snapshot.extras));
        let mut all: Map<String, Value> = Map::new();
        all.insert("timestamp".to_owned(), (snapshot.record.time.now_ns as f64 * 1e-9).into());
        all.extend(topics.into_iter().map(|(name, values)| (name, Value::Object(values))));
        let _ = socket.send(Value::Object(all).to_string().as_bytes()).await;
    }
}

async fn connected(target: SocketAddr) -> Option<UdpSocket> {
    let any: SocketAddr = if target.is_ipv4() { ([0, 0, 0, 0], 0).into() } else { ([0; 16], 0).into() };
    let socket = UdpSocket::bind(any).await.ok()?;
    socket.connect(target).await.ok()?;
    Some(socket)
}

/// The values of each topic, by name.
fn topics(schema: &RunSchema, row: &[f64]) -> Vec<(String, Map<String, Value>)> {
    let mut values = row.iter();
    let named = schema.topics.iter().map(|topic| {
        let signals = topic.signals.iter().zip(values.by_ref());
        let signals = signals.map(|(signal, value)| (signal.name.clone(), Value::from(*value)));
        (topic.name.trim_start_matches('/').to_owned(), signals.collect())
    });
    named.collect()
}
