//! ROS 2's messages, as far as the bridge speaks them: fields in their order are the CDR, and the definition by which ROS 2
//! knows a type (REP-2011, RIHS01) is made of the same lines.

mod actions;
#[cfg(test)]
mod definition;
mod standard;

pub use actions::*;
#[cfg(test)]
use definition::{Field, described};
pub use standard::*;

use serde::de::{Error as _, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
#[cfg(test)]
use serde_json::{Value, json};

/// As many numbers as a definition says, without their count before them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<const N: usize> Default for Numbers<N> {
    fn default() -> Self {
        Numbers([0.0; N])
    }
}

impl<const N: usize> Serialize for Numbers<N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(N)?;
        self.0.iter().try_for_each(|number| tuple.serialize_element(number))?;
        tuple.end()
    }
}

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct All<const N: usize>;
        impl<'de, const N: usize> Visitor<'de> for All<N> {
            type Value = Numbers<N>;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{N} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Numbers<N>, A::Error> {
                let mut numbers = [0.0; N];
                for number in &mut numbers {
                    *number = sequence.next_element()?.ok_or_else(|| A::Error::custom("too few numbers"))?;
                }
                Ok(Numbers(numbers))
            }
        }
        deserializer.deserialize_tuple(N, All)
    }
}

/// A type of ROS 2.
pub trait Defined {
    /// Its name, as `geometry_msgs/msg/Twist`.
    const NAME: &'static str;
}

/// A message: its name in ROS 2, and its fields.
macro_rules! message {
    ($(#[$doc:meta])* $ros:literal $name:ident { $($field:ident: $type:ty),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[allow(missing_docs, reason = "as ROS 2 says")]
        pub struct $name {
            $(pub $field: $type,)*
        }

        impl ros2_client::Message for $name {}

        #[cfg(test)]
        impl Field for $name {
            fn field() -> (u8, usize, &'static str) {
                (1, 0, <$name as Defined>::NAME)
            }

            fn needs(types: &mut Vec<Value>) {
                if types.iter().any(|known| known["type_name"] == <$name as Defined>::NAME) {
                    return;
                }
                let fields: Vec<Value> = vec![$(described::<$type>(stringify!($field)),)*];
                types.push(json!({ "type_name": <$name as Defined>::NAME, "fields": fields }));
                $(<$type as Field>::needs(types);)*
            }

            fn sample(count: &mut u8) -> Self {
                $name { $($field: <$type as Field>::sample(count),)* }
            }
        }

        impl Defined for $name {
            const NAME: &'static str = $ros;
        }
    };
}
use message;

#[cfg(test)]
mod tests;
