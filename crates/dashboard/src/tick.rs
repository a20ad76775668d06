//! The message that goes to all pages thirty times a second.

use std::sync::Arc;
use std::time::Duration;

use crate::shared::Shared;
use crate::status::{EventSeen, StatusMessage};

/// Between two messages to the pages.
const TICK: Duration = Duration::from_nanos(33_333_333);

/// Makes the message for all pages, once for all of them.
pub(crate) async fn tick(shared: Shared) {
    let mut rows = shared.desk.about.rows();
    let mut interval = tokio::time::interval(TICK);
    interval.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut last_event = 0;
    loop {
        interval.tick().await;
        let events = shared.live.events_after(last_event);
        last_event = events.last().map_or(last_event, |event| event.number);
        // Events are remembered, messages are not: without a page nothing is made.
        if shared.sender.receiver_count() == 0 {
            continue;
        }
        let mut seen = StatusMessage::new(&shared.live.snapshot(), &mut rows);
        seen.events = events.into_iter().map(EventSeen::from).collect();
        shared.complete(&mut seen);
        if let Ok(text) = serde_json::to_string(&seen) {
            shared.sender.send_replace(Arc::from(text));
        }
    }
}
