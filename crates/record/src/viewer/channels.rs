//! The channels that viewers see, in a file or live: what is drawn, events, and signals whose codes have names.

use super::schemas;
use crate::run::protobuf::{Kind, descriptor_with, push_double, push_number};
use crate::run::{RunSchema, message_name};

/// The topics with Foxglove's messages, and which messages they carry.
pub const TOPICS: [(&str, &str); 5] = [
    ("/tf", "foxglove.FrameTransforms"),
    ("/pose", "foxglove.PoseInFrame"),
    ("/wished_pose", "foxglove.PoseInFrame"),
    ("/scene", "foxglove.SceneUpdate"),
    ("/log", "foxglove.Log"),
];
/// The place of `/log` among them.
pub const LOG: usize = 4;

/// A signal that is a code, and what its codes are called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Its topic.
    pub topic: String,
    /// Its name.
    pub signal: String,
    /// Codes with their names, in capitals, digits and underscores; the first one is 0.
    pub names: Vec<(i32, String)>,
}

/// A channel as viewers are told of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its topic.
    pub topic: String,
    /// The full name of its messages.
    pub message: String,
    /// What explains them to a reader: a `FileDescriptorSet`.
    pub explained: Vec<u8>,
}

/// All channels of a robot: those of [`TOPICS`] at their places, then one for each topic of signals.
#[derive(Clone, Debug)]
pub struct Channels {
    all: Vec<Channel>,
    signals: Vec<Signals>,
}

/// A topic of signals.
#[derive(Clone, Debug)]
struct Signals {
    /// Where they begin in a row.
    first: usize,
    /// Of each, whether it is a code.
    are_codes: Vec<bool>,
}

impl Channels {
    /// Those of a robot whose rows have this schema.
    pub fn new(schema: &RunSchema, named: &[Named]) -> Self {
        let explained = schemas::descriptors();
        let drawn = TOPICS.iter().map(|(topic, message)| Channel {
            topic: (*topic).to_owned(),
            message: (*message).to_owned(),
            explained: explained.clone(),
        });
        let (mut all, mut signals, mut first): (Vec<_>, Vec<_>, _) = (drawn.collect(), Vec::new(), 0);
        for topic in &schema.topics {
            let name = message_name(&topic.name);
            let (mut fields, mut enums, mut are_codes) = (Vec::new(), Vec::new(), Vec::new());
            for signal in &topic.signals {
                let code = named.iter().find(|code| code.topic == topic.name && code.signal == signal.name);
                let type_name = code.map(|_| message_name(&signal.name.replace('_', " ")));
                if let (Some(code), Some(type_name)) = (code, &type_name) {
                    enums.push(schemas::choices(type_name, &code.names));
                }
                are_codes.push(code.is_some());
                let full = type_name.map(|type_name| format!(".omnibase.{name}.{type_name}"));
                fields.push((signal.name.clone(), full.map_or(Kind::Double, Kind::Choice)));
            }
            all.push(Channel {
                topic: topic.name.clone(),
                message: format!("omnibase.{name}"),
                explained: descriptor_with(&name, &fields, &enums),
            });
            signals.push(Signals { first, are_codes });
            first += topic.signals.len();
        }
        Channels { all, signals }
    }

    /// All of them.
    pub fn all(&self) -> &[Channel] {
        &self.all
    }

    /// A row's messages, each with its channel's place.
    pub fn row<'a>(&'a self, row: &'a [f64]) -> impl Iterator<Item = (usize, Vec<u8>)> + 'a {
        (TOPICS.len()..).zip(&self.signals).map(|(channel, Signals { first, are_codes })| {
            let mut bytes = Vec::with_capacity(10 * are_codes.len());
            for (field, (is_code, value)) in (1..).zip(are_codes.iter().zip(row.iter().skip(*first))) {
                if *is_code {
                    // A code below 0 is one of 64 bits, as protobuf has it.
                    push_number(&mut bytes, field, *value as i64 as u64);
                } else {
                    push_double(&mut bytes, field, *value);
                }
            }
            (channel, bytes)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_numbers_of_their_enum_and_all_else_is_double() {
        let mut schema = RunSchema::default();
        schema.push("/cycle", ["index", "phase"]);
        schema.push("/wheel_1", ["mode"]);
        let named = |topic: &str, signal: &str| Named {
            topic: topic.to_owned(),
            signal: signal.to_owned(),
            names: vec![(0, "NONE".to_owned()), (9, "CSV".to_owned())],
        };
        let channels = Channels::new(&schema, &[named("/cycle", "phase"), named("/wheel_1", "mode")]);
        let topics: Vec<_> = channels.all().iter().map(|channel| channel.topic.as_str()).collect();
        assert_eq!(topics, ["/tf", "/pose", "/wished_pose", "/scene", "/log", "/cycle", "/wheel_1"]);
        assert_eq!(TOPICS[LOG].0, "/log");
        let messages: Vec<_> = channels.row(&[1.5, 9.0, -3.0]).collect();
        assert_eq!(messages[0].0, 5);
        let index = [&[0x09][..], &1.5_f64.to_le_bytes(), &[0x10, 9]].concat();
        assert_eq!(messages[0].1, index);
        // protobuf.dev, "Encoding": -3 takes ten bytes.
        assert_eq!(messages[1], (6, vec![0x08, 0xFD, 255, 255, 255, 255, 255, 255, 255, 255, 1]));
    }
}
