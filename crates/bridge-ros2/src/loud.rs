//! What is said again and again, said aloud now and then.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// From one time that something is said to the next.
const QUIET: Duration = Duration::from_secs(5);

/// What was said when.
#[derive(Default)]
pub struct Loud(BTreeMap<&'static str, Instant>);

impl Loud {
    /// The words, where it is time for them.
    pub fn say(
        &mut self,
        kind: &'static str,
        words: impl FnOnce() -> String,
        now: Instant,
    ) -> Option<String> {
        if self.0.get(kind).is_some_and(|said| now.saturating_duration_since(*said) < QUIET) {
            return None;
        }
        self.0.insert(kind, now);
        Some(words())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_is_said_every_five_seconds() {
        let (mut loud, now) = (Loud::default(), Instant::now());
        let at = |ms: u64| now + Duration::from_millis(ms);
        let mut said = |kind, ms| loud.say(kind, || format!("{kind} {ms}"), at(ms));
        assert_eq!(said("a", 0).as_deref(), Some("a 0"));
        assert_eq!(said("b", 1).as_deref(), Some("b 1"));
        assert_eq!((said("a", 4000), said("a", 4999)), (None, None));
        assert_eq!(said("a", 5001).as_deref(), Some("a 5001"));
    }
}
