//! A running robot for the Foxglove app: the channels of an export for viewers, live, by Foxglove's WebSocket protocol
//! (github.com/foxglove/ws-protocol, `docs/spec.md`).
//!
//! Whoever connects is told which channels there are, and gets the messages of those that it subscribes to. Nothing can be
//! asked of the robot here.

use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use axum::extract::State;
use axum::extract::ws::{Message as Frame, WebSocket, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use omnibase_measure::events::is_stop;
use omnibase_platform::Pose2;
use omnibase_record::run::{Due, Selection};
use omnibase_record::viewer::{Channels, LOG, log, messages};
use omnibase_run::codes::named;
use omnibase_run::view::{DRAWN_EVERY_NS, View};
use serde::Deserialize;
use serde_json::json;
use tokio::sync::broadcast::{Receiver, Sender, error::RecvError};
use tokio::sync::{Semaphore, broadcast};

use crate::connections::{Peer, STUCK};
use crate::shared::Shared;
use crate::streams::TICK;
use crate::work::For;

/// What the app calls the protocol: today, and before Foxglove had an SDK.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Viewers at the same time.
const MOST: usize = 8;
/// The longest message of a viewer, bytes: subscriptions to all channels.
const LONGEST: usize = 64 * 1024;
/// Most subscriptions of a viewer.
const SUBSCRIPTIONS: usize = 256;
/// Moments that are kept for a viewer that is slow: a second of them.
const KEPT: usize = 100;
/// A binary message of the server that carries data.
const MESSAGE_DATA: u8 = 1;

/// What is told at one moment.
struct Moment {
    unix_ns: u64,
    /// Each with its channel's place.
    messages: Vec<(usize, Vec<u8>)>,
}

/// What all viewers share.
#[derive(Clone)]
pub(crate) struct Viewers {
    /// What they are told first: the server, then its channels.
    begin: Arc<[String; 2]>,
    channels: usize,
    moments: Sender<Arc<Moment>>,
    places: Arc<Semaphore>,
}

/// Shows the robot to whoever looks, until the runtime ends; the routes by which they come.
pub(crate) fn show(shared: &Shared) -> Router {
    let about = &shared.desk.about;
    let rows = about.rows();
    let channels = Channels::new(rows.schema(), &named(&about.robot.plan));
    let server = json!({"op": "serverInfo", "name": about.robot.plan.name, "capabilities": []});
    let told = (1..).zip(channels.all()).map(|(id, channel): (u32, _)| {
        json!({
            "id": id,
            "topic": channel.topic,
            "encoding": "protobuf",
            "schemaName": channel.message,
            "schemaEncoding": "protobuf",
            "schema": BASE64_STANDARD.encode(&channel.explained),
        })
    });
    let advertised = json!({"op": "advertise", "channels": told.collect::<Vec<_>>()});
    let viewers = Viewers {
        begin: Arc::new([server.to_string(), advertised.to_string()]),
        channels: channels.all().len(),
        moments: broadcast::channel(KEPT).0,
        places: Arc::new(Semaphore::new(MOST)),
    };
    shared.work.spawn(tell(shared.clone(), channels, viewers.moments.clone()));
    Router::new().route("/", get(come)).with_state(viewers)
}

/// Draws the robot for all viewers; where there are none, nothing is made.
async fn tell(shared: Shared, channels: Channels, moments: Sender<Arc<Moment>>) {
    let plan = &shared.desk.about.robot.plan;
    let mut rows = shared.desk.about.rows();
    let mut view = View::new(plan, rows.schema());
    let mut due = Due::new(&Selection { signals: Vec::new(), every_ns: Some(DRAWN_EVERY_NS) });
    let mut interval = tokio::time::interval(TICK);
    interval.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let (mut last_event, mut sent_cycles, mut path, mut begun_unix_ns) = (0, 0, None, None);
    loop {
        interval.tick().await;
        let events = shared.live.events_after(last_event);
        last_event = events.last().map_or(last_event, |event| event.number);
        let snapshot = shared.live.snapshot();
        if moments.receiver_count() == 0 || snapshot.cycles == sent_cycles {
            continue;
        }
        sent_cycles = snapshot.cycles;
        let now_ns = snapshot.record.time.now_ns;
        // The wall clock once: from then on the robot's own.
        let begun_unix_ns = *begun_unix_ns.get_or_insert_with(|| unix_ns().saturating_sub(now_ns));
        let unix_ns = |time_ns: u64| begun_unix_ns.saturating_add(time_ns);
        let followed = snapshot.reference_start.map(|start| (snapshot.reference, start.odom_from_body));
        if path != followed {
            view.set_path(planned(&shared, followed).await.into_iter());
            path = followed;
        }
        let row = rows.of(&snapshot.record, &snapshot.extras);
        view.hear(now_ns, row);
        view.set_obstacles(now_ns, &snapshot.obstacles);
        let mut all: Vec<_> = channels.row(row).collect();
        if due.take(now_ns) {
            all.extend(messages(&view.draw(now_ns, row), unix_ns(now_ns)));
        }
        all.extend(events.iter().map(|event| {
            let time_ns = (event.time_s * 1e9) as u64;
            (LOG, log(&event.text, is_stop(&event.text), unix_ns(time_ns)))
        }));
        // Whoever looked may be gone.
        let _ = moments.send(Arc::new(Moment { unix_ns: unix_ns(now_ns), messages: all }));
    }
}

fn unix_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
    since.as_nanos().try_into().unwrap_or(u64::MAX)
}

/// The path of the reference that was begun, in odom, m; nothing where none was, or too much is being computed.
async fn planned(shared: &Shared, followed: Option<(u32, Pose2)>) -> Vec<[f64; 2]> {
    if followed.is_none() {
        return Vec::new();
    }
    let desk = shared.desk.clone();
    let planned = shared.work.run(For::Reader, move || desk.planned()).await;
    planned.ok().flatten().map_or(Vec::new(), |planned| planned.points_m().collect())
}

/// Somebody comes to look.
async fn come(
    State(viewers): State<Viewers>,
    Extension(peer): Extension<Peer>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let upgrade = upgrade.protocols(PROTOCOLS).max_message_size(LONGEST).max_frame_size(LONGEST);
    if upgrade.selected_protocol().is_none() {
        let why = format!("expected one of the protocols {}", PROTOCOLS.join(", "));
        return (StatusCode::BAD_REQUEST, why).into_response();
    }
    let place = peer.seat.look().then(|| viewers.places.clone().try_acquire_owned().ok()).flatten();
    let Some(place) = place else {
        return (StatusCode::SERVICE_UNAVAILABLE, "all places of viewers are taken").into_response();
    };
    upgrade.on_upgrade(async move |socket| {
        look(socket, &viewers).await;
        drop(place);
    })
}

/// What a viewer asks that is heard here.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Asked {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
}

/// What a viewer calls its subscription to a channel.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: u32,
}

/// A viewer's subscriptions.
struct Subscribed {
    channels: usize,
    all: Vec<Subscription>,
}

impl Subscribed {
    /// Takes in what a viewer asks; else what is wrong with it, which ends nothing.
    fn hear(&mut self, text: &str) -> Result<(), String> {
        match serde_json::from_str(text).map_err(|error| format!("not understood: {error}"))? {
            Asked::Subscribe { subscriptions } => subscriptions.into_iter().try_for_each(|one| self.add(one)),
            Asked::Unsubscribe { subscription_ids } => {
                self.all.retain(|one| !subscription_ids.contains(&one.id));
                Ok(())
            }
        }
    }

    fn add(&mut self, one: Subscription) -> Result<(), String> {
        let Subscription { id, channel_id } = one;
        if self.all.iter().any(|other| other.id == id) {
            return Err(format!("there is a subscription {id} already"));
        }
        if !(1..=self.channels).contains(&(channel_id as usize)) {
            return Err(format!("there is no channel {channel_id}"));
        }
        if self.all.len() == SUBSCRIPTIONS {
            return Err(format!("more than {SUBSCRIPTIONS} subscriptions"));
        }
        self.all.push(one);
        Ok(())
    }

    /// A moment's messages for it, as they are sent: the subscription and the log time before each.
    fn frames(&self, moment: &Moment) -> Vec<Vec<u8>> {
        let mut frames = Vec::new();
        for (channel, message) in &moment.messages {
            for one in self.all.iter().filter(|one| one.channel_id as usize == channel + 1) {
                let (id, time) = (one.id.to_le_bytes(), moment.unix_ns.to_le_bytes());
                frames.push([&[MESSAGE_DATA][..], &id, &time, message].concat());
            }
        }
        frames
    }
}

/// Tells a viewer what it subscribes to, until it is gone.
async fn look(mut socket: WebSocket, viewers: &Viewers) {
    let mut moments: Receiver<Arc<Moment>> = viewers.moments.subscribe();
    for text in viewers.begin.iter() {
        if !sent(&mut socket, Frame::text(text.clone())).await {
            return;
        }
    }
    let mut subscribed = Subscribed { channels: viewers.channels, all: Vec::new() };
    loop {
        tokio::select! {
            moment = moments.recv() => match moment {
                Ok(moment) => {
                    for frame in subscribed.frames(&moment) {
                        if !sent(&mut socket, Frame::binary(frame)).await {
                            return;
                        }
                    }
                }
                // What it is too slow for is left out.
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            },
            received = socket.recv() => {
                let refused = match received {
                    Some(Ok(Frame::Ping(_) | Frame::Pong(_))) => continue,
                    Some(Ok(Frame::Text(text))) => subscribed.hear(&text).err(),
                    Some(Ok(Frame::Binary(_))) => Some("nothing can be published here".to_owned()),
                    Some(Ok(Frame::Close(_)) | Err(_)) | None => return,
                };
                if let Some(why) = refused {
                    // Level 1 is a warning.
                    let status = json!({"op": "status", "level": 1, "message": why}).to_string();
                    if !sent(&mut socket, Frame::text(status)).await {
                        return;
                    }
                }
            }
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
    fn a_viewer_gets_what_it_subscribes_to_under_its_own_numbers() {
        let mut subscribed = Subscribed { channels: 3, all: Vec::new() };
        let moment = Moment { unix_ns: 0x0102, messages: vec![(0, vec![7]), (2, vec![8, 9])] };
        assert_eq!(subscribed.frames(&moment), Vec::<Vec<u8>>::new());
        let asked = r#"{"op":"subscribe","subscriptions":[{"id":30,"channelId":3},{"id":5,"channelId":2}]}"#;
        subscribed.hear(asked).unwrap();
        assert_eq!(subscribed.frames(&moment), [[1, 30, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 8, 9]]);
        for (asked, why) in [
            (asked, "there is a subscription 30 already"),
            (r#"{"op":"subscribe","subscriptions":[{"id":31,"channelId":4}]}"#, "there is no channel 4"),
            (r#"{"op":"subscribe","subscriptions":[{"id":31,"channelId":0}]}"#, "there is no channel 0"),
            (r#"{"op":"publish"}"#, "not understood"),
            ("{", "not understood"),
        ] {
            assert!(subscribed.hear(asked).unwrap_err().starts_with(why), "{asked}");
        }
        subscribed.hear(r#"{"op":"unsubscribe","subscriptionIds":[30,77]}"#).unwrap();
        assert_eq!(subscribed.all, [Subscription { id: 5, channel_id: 2 }]);
    }
}
