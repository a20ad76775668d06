//! What is wrong with a call, in words: what it may be stands in its own schema.

use std::sync::LazyLock;

use omnibase_robot::config::nearest;
use serde::Deserialize;
use serde_json::Value;

use super::Call;

/// As many names as anybody reads.
const MOST_NAMES: usize = 12;

static SCHEMA: LazyLock<Value> = LazyLock::new(|| schemars::schema_for!(Call).to_value());

/// A name that nobody has, and which was probably meant: `what` is its kind.
pub(crate) fn unknown<'n>(what: &str, name: &str, known: impl Iterator<Item = &'n str>) -> String {
    let known: Vec<&str> = known.collect();
    let no = format!("no {what} is called `{name}`");
    match (nearest(name, known.iter().copied()), known.as_slice()) {
        (Some(near), _) => format!("{no}; did you mean `{near}`?"),
        (None, []) => format!("{no}: there is none"),
        (None, [only]) => format!("{no}: there is only `{only}`"),
        (None, few) if few.len() <= MOST_NAMES => format!("{no}: there are {}", few.join(", ")),
        (None, many) => {
            let (told, left) = many.split_at(MOST_NAMES);
            format!("{no}: there are {} and {} more", told.join(", "), left.len())
        }
    }
}

/// A call as it was written; what is wrong with it.
pub(crate) fn read(written: &Value) -> Result<Call, String> {
    let Value::Object(arguments) = written else {
        return Err(format!("expected an object, as {{\"do\": \"enable\"}}, found {}", brief(written)));
    };
    let Some(name) = arguments.get("do").and_then(Value::as_str) else {
        return Err("expected `do`, the name of what is asked, as \"enable\"".to_owned());
    };
    let calls = || SCHEMA["oneOf"].as_array().into_iter().flatten();
    let name_of = |call: &'static Value| call["properties"]["do"]["const"].as_str();
    let Some(call) = calls().find(|call| name_of(call) == Some(name)) else {
        return Err(unknown("call", name, calls().filter_map(name_of)));
    };
    let known = &call["properties"];
    if let Some(key) = arguments.keys().find(|key| known.get(key).is_none()) {
        let keys = known.as_object().into_iter().flatten().map(|(key, _)| key.as_str());
        return Err(format!("{name}: {}", unknown("argument", key, keys.filter(|key| *key != "do"))));
    }
    Call::deserialize(written).map_err(|error| {
        let mut required = call["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
        if let Some(key) = required.find(|key| !arguments.contains_key(*key)) {
            return format!("{name}: expected `{key}`: {}", expected(&known[key]));
        }
        match arguments.iter().find(|(key, value)| !fits(&known[*key], value)) {
            Some((key, value)) => {
                format!("{name}: {key}: expected {}, found {}", expected(&known[key]), brief(value))
            }
            None => error.to_string(),
        }
    })
}

fn resolved(schema: &'static Value) -> &'static Value {
    let name = schema["$ref"].as_str().and_then(|path| path.strip_prefix("#/$defs/"));
    name.map_or(schema, |name| &SCHEMA["$defs"][name])
}

/// The ways in which it may be written; `null` isn't told.
fn ways(schema: &'static Value) -> Vec<&'static Value> {
    let schema = resolved(schema);
    let listed = schema["anyOf"].as_array().or(schema["oneOf"].as_array());
    listed.map_or(vec![schema], |ways| ways.iter().flat_map(ways_of).collect())
}

fn ways_of(schema: &'static Value) -> Vec<&'static Value> {
    if schema["type"] == "null" { Vec::new() } else { ways(schema) }
}

fn types(schema: &Value) -> Vec<&str> {
    match &schema["type"] {
        Value::String(one) => vec![one],
        Value::Array(all) => all.iter().filter_map(Value::as_str).filter(|one| *one != "null").collect(),
        _ => Vec::new(),
    }
}

fn fits(schema: &'static Value, value: &Value) -> bool {
    let fits_one = |schema: &'static Value| {
        if let Some(only) = schema.get("const") {
            return only == value;
        }
        if let Some(only) = schema["enum"].as_array() {
            return only.contains(value);
        }
        let kinds = types(schema);
        kinds.is_empty()
            || kinds.iter().any(|kind| match *kind {
                "number" => value.is_number(),
                "integer" => value.is_i64() || value.is_u64(),
                "string" => value.is_string(),
                "object" => value.is_object(),
                "array" => value.as_array().is_some_and(|items| {
                    schema["minItems"].as_u64().is_none_or(|count| items.len() as u64 == count)
                        && items.iter().all(|item| fits(&schema["items"], item))
                }),
                _ => true,
            })
    };
    value.is_null() || ways(schema).into_iter().any(fits_one)
}

fn expected(schema: &'static Value) -> String {
    let one = |schema: &'static Value| -> Vec<String> {
        if let Some(only) = schema["const"].as_str() {
            return vec![only.to_owned()];
        }
        if let Some(only) = schema["enum"].as_array() {
            return only.iter().filter_map(Value::as_str).map(str::to_owned).collect();
        }
        let kind = |kind: &str| match kind {
            "number" => "a number".to_owned(),
            "integer" => "a whole number".to_owned(),
            "string" => "a text".to_owned(),
            "array" => match schema["minItems"].as_u64() {
                Some(count) => format!("{count} numbers"),
                None => "a list".to_owned(),
            },
            "object" => match schema["properties"].as_object().and_then(|keys| keys.keys().next()) {
                Some(key) => format!("{{\"{key}\": …}}"),
                None => "values by name, as {\"name\": 1}".to_owned(),
            },
            other => other.to_owned(),
        };
        types(schema).into_iter().map(kind).collect()
    };
    let all: Vec<String> = ways(schema).into_iter().flat_map(one).collect();
    all.join(" or ")
}

/// As much of a value as is read at a glance.
fn brief(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("`{}…`", &text[..end]),
        None => format!("`{text}`"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_with_a_call_stands_in_words() {
        for (wrong, words) in [
            (r#"{"do":"enabel"}"#, "no call is called `enabel`; did you mean `enable`?"),
            (r#"{"pose":[1,2,3]}"#, "expected `do`, the name of what is asked, as \"enable\""),
            ("[1]", r#"expected an object, as {"do": "enable"}, found `[1]`"#),
            (r#"{"do":"stop"}"#, "stop: expected `category`: category_0 or category_1 or category_2"),
            (
                r#"{"do":"stop","category":"category_3"}"#,
                r#"stop: category: expected category_0 or category_1 or category_2, found `"category_3"`"#,
            ),
            (
                r#"{"do":"stop","categry":"category_1"}"#,
                "stop: no argument is called `categry`; did you mean `category`?",
            ),
            (r#"{"do":"enable","now":1}"#, "enable: no argument is called `now`: there is none"),
            (r#"{"do":"go_to","pose":1}"#, "go_to: pose: expected 3 numbers, found `1`"),
            (r#"{"do":"go_to","pose":[1,2]}"#, "go_to: pose: expected 3 numbers, found `[1,2]`"),
            (r#"{"do":"go_to","pose":[1,2,"x"]}"#, r#"go_to: pose: expected 3 numbers, found `[1,2,"x"]`"#),
            (
                r#"{"do":"remove_obstacle","index":-1.5}"#,
                "remove_obstacle: index: expected a whole number, found `-1.5`",
            ),
            (
                r#"{"do":"set","values":3}"#,
                "set: values: expected values by name, as {\"name\": 1}, found `3`",
            ),
            (
                r#"{"do":"stick","x":0,"y":0,"turn":0,"frame":"map"}"#,
                r#"stick: frame: expected body or odom, found `"map"`"#,
            ),
            (
                r#"{"do":"drive_mode","name":"wheel_1","mode":"fast"}"#,
                r#"drive_mode: mode: expected speed or torque, found `"fast"`"#,
            ),
            (
                r#"{"do":"teach","by":"hand"}"#,
                "teach: by: expected points or {\"period_s\": …} or {\"change\": …}, found `\"hand\"`",
            ),
        ] {
            let written = serde_json::from_str(wrong).unwrap();
            assert_eq!(read(&written).unwrap_err(), words, "{wrong}");
        }
    }

    #[test]
    fn a_name_that_nobody_has_is_told_with_those_there_are_but_not_with_all_of_many() {
        let many: Vec<String> = (0..30).map(|n| format!("signal_{n}")).collect();
        let told = unknown("signal", "zzz", many.iter().map(String::as_str));
        assert!(told.ends_with("signal_10, signal_11 and 18 more"), "{told}");
    }
}
