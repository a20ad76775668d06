//! What is said again and again, said aloud now and then.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// From one time that something is said to the next.
const QUIET: Duration = Duration::from_secs(5);

/// What was said when, and how often it was held back since.
#[derive(Default)]
pub struct Loud(BTreeMap<&'static str, (Instant, u64)>);

impl Loud {
    /// The words, where it is time for them.
    pub fn say(
        &mut self,
        kind: &'static str,
        words: impl FnOnce() -> String,
        now: Instant,
    ) -> Option<String> {
        match self.0.get_mut(kind) {
            Some((said, held_back)) if now.saturating_duration_since(*said) < QUIET => {
                *held_back += 1;
                None
            }
            known => {
                let held_back = known.map_or(0, |(_, count)| *count);
                self.0.insert(kind, (now, 0));
                let again =
                    if held_back == 0 { String::new() } else { format!(" ({held_back} times more since)") };
                Some(words() + &again)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_is_said_every_five_seconds_with_how_often_it_was() {
        let (mut loud, now) = (Loud::default(), Instant::now());
        let at = |ms: u64| now + Duration::from_millis(ms);
        assert_eq!(loud.say("a", || "old".into(), at(0)).as_deref(), Some("old"));
        assert_eq!(loud.say("b", || "new".into(), at(1)).as_deref(), Some("new"));
        assert_eq!(loud.say("a", || "old".into(), at(4000)), None);
        assert_eq!(loud.say("a", || "old".into(), at(4999)), None);
        assert_eq!(loud.say("a", || "old".into(), at(5001)).as_deref(), Some("old (2 times more since)"));
        assert_eq!(loud.say("a", || "old".into(), at(10_002)).as_deref(), Some("old"));
    }
}
