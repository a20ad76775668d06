//! A type's definition, of the same lines as its fields: ROS 2 knows types by its hash.

use super::{Byte, Defined, Numbers};
use serde_json::{Value, json};

/// What a field is, for the definition, in words of `type_description_interfaces/msg/FieldType`.
pub trait Field {
    /// Its number and length, and the nested type's name.
    fn field() -> (u8, usize, &'static str);

    /// The types that it needs beside itself.
    fn needs(_: &mut Vec<Value>) {}

    /// A value like no other.
    fn sample(count: &mut u8) -> Self;
}

macro_rules! plain {
    ($($type:ty = $number:literal),*) => {
        $(impl Field for $type {
            fn field() -> (u8, usize, &'static str) {
                ($number, 0, "")
            }

                    fn sample(count: &mut u8) -> Self {
                *count = count.wrapping_add(1);
                (*count).into()
            }
        })*
    };
}
plain!(u8 = 3, u16 = 5, i32 = 6, u32 = 7, f32 = 10, f64 = 11);

impl Field for bool {
    fn field() -> (u8, usize, &'static str) {
        (15, 0, "")
    }

    fn sample(_: &mut u8) -> Self {
        true
    }
}

impl Field for String {
    fn field() -> (u8, usize, &'static str) {
        (17, 0, "")
    }

    fn sample(count: &mut u8) -> Self {
        *count = count.wrapping_add(1);
        // Of every length, so that what follows is aligned anew.
        "ü".repeat(usize::from(*count % 9))
    }
}

impl<const N: usize> Field for Numbers<N> {
    fn field() -> (u8, usize, &'static str) {
        (48 + 11, N, "")
    }

    fn sample(count: &mut u8) -> Self {
        Numbers([0.0; N].map(|_| f64::sample(count) / 7.0))
    }
}

impl<T: Field> Field for Vec<T> {
    fn field() -> (u8, usize, &'static str) {
        let (number, _, nested) = T::field();
        (144 + number, 0, nested)
    }

    fn needs(types: &mut Vec<Value>) {
        T::needs(types);
    }

    fn sample(count: &mut u8) -> Self {
        (0..3).map(|_| T::sample(count)).collect()
    }
}

/// A field's line in a definition.
pub(super) fn described<T: Field>(name: &str) -> Value {
    let (type_id, capacity, nested_type_name) = T::field();
    let kind = json!({
        "type_id": type_id, "capacity": capacity, "string_capacity": 0, "nested_type_name": nested_type_name,
    });
    json!({ "name": name, "type": kind })
}

impl Field for Byte {
    fn field() -> (u8, usize, &'static str) {
        (16, 0, "")
    }

    fn sample(count: &mut u8) -> Self {
        Byte(u8::sample(count))
    }
}

/// What a type's hash is made of, as in `type_description_interfaces/msg/TypeDescription`.
pub(super) fn definition<T: Field + Defined>() -> Value {
    let mut types = Vec::new();
    T::needs(&mut types);
    let is_own = |described: &Value| described["type_name"] == T::NAME;
    let (own, mut others): (Vec<_>, Vec<_>) = types.into_iter().partition(is_own);
    others.sort_by(|a, b| a["type_name"].as_str().cmp(&b["type_name"].as_str()));
    json!({ "type_description": own[0], "referenced_type_descriptions": others })
}
