//! The values of a running robot for other people's plots: PlotJuggler by UDP, Foxglove by its WebSocket.

use std::net::SocketAddr;
use std::time::Duration;

use omnibase_record::run::RunSchema;
use omnibase_run::channels::Rows;
use omnibase_run::live::Live;
use serde_json::{Map, Value};
use tokio::net::UdpSocket;

/// Between two messages.
const TICK: Duration = Duration::from_millis(10);

/// Where values go, a hundred times a second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Streams {
    /// PlotJuggler's UDP server: one JSON object a datagram.
    pub plotjuggler: Option<SocketAddr>,
    /// Where Foxglove finds its WebSocket server; loopback, for whoever connects may read.
    #[cfg(feature = "foxglove")]
    pub foxglove: Option<SocketAddr>,
}

/// Sends until the runtime ends. A receiver that isn't there costs nothing but the datagram.
pub(crate) async fn send(live: Live, mut rows: Rows, streams: Streams) {
    let socket = match streams.plotjuggler {
        Some(target) => connected(target).await,
        None => None,
    };
    #[cfg(feature = "foxglove")]
    let foxglove = match streams.foxglove {
        Some(address) => foxglove_server::Server::start(address, rows.schema()).await,
        None => None,
    };
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
        let topics = topics(&schema, rows.of(&snapshot.record, &snapshot.extras).0);
        #[cfg(feature = "foxglove")]
        if let Some(server) = &foxglove {
            server.log(snapshot.record.time.now_ns, &topics);
        }
        if let Some(socket) = &socket {
            let mut all: Map<String, Value> = Map::new();
            all.insert("timestamp".to_owned(), (snapshot.record.time.now_ns as f64 * 1e-9).into());
            all.extend(topics.into_iter().map(|(name, values)| (name, Value::Object(values))));
            let _ = socket.send(Value::Object(all).to_string().as_bytes()).await;
        }
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

#[cfg(feature = "foxglove")]
mod foxglove_server {
    use std::borrow::Cow;
    use std::net::SocketAddr;
    use std::sync::Arc;

    use foxglove::{
        ChannelBuilder, Context, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
    };
    use omnibase_record::run::RunSchema;
    use serde_json::{Map, Value, json};

    /// One channel for each topic.
    pub(super) struct Server {
        _handle: WebSocketServerHandle,
        /// Channels live as long as it does.
        _context: Arc<Context>,
        channels: Vec<Arc<RawChannel>>,
    }

    impl Server {
        pub(super) async fn start(address: SocketAddr, schema: &RunSchema) -> Option<Server> {
            let context = Context::new();
            let channel = |topic: &omnibase_record::run::Topic| {
                let properties: Map<String, Value> = topic
                    .signals
                    .iter()
                    .map(|signal| (signal.name.clone(), json!({"type": "number"})))
                    .collect();
                let text = json!({"type": "object", "properties": properties}).to_string();
                let schema = Schema {
                    name: format!("omnibase{}", topic.name.replace('/', ".")),
                    encoding: "jsonschema".to_owned(),
                    data: Cow::Owned(text.into_bytes()),
                };
                ChannelBuilder::new(&topic.name)
                    .message_encoding("json")
                    .schema(schema)
                    .context(&context)
                    .build_raw()
                    .ok()
            };
            let channels = schema.topics.iter().map(channel).collect::<Option<Vec<_>>>()?;
            let server = WebSocketServer::new().name("omnibase").context(&context);
            let handle = server.bind(address.ip().to_string(), address.port()).start().await.ok()?;
            Some(Server { _handle: handle, _context: context, channels })
        }

        pub(super) fn log(&self, time_ns: u64, topics: &[(String, Map<String, Value>)]) {
            for (channel, (_, values)) in self.channels.iter().zip(topics) {
                if channel.has_sinks() {
                    let text = Value::Object(values.clone()).to_string();
                    channel.log_with_meta(text.as_bytes(), PartialMetadata { log_time: Some(time_ns) });
                }
            }
        }
    }
}
