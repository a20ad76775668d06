//! What the registry says to editors and people: the JSON schema of robot files, and every kind with its keys.

use schemars::schema_for;
use serde_json::{Value, json};

use super::{Custom, Key, Kind, Registry, Sort, capital};
use crate::config::RobotFile;

impl Registry {
    /// Every sort with its kinds.
    pub fn sorts(&self) -> [(Sort, Vec<&Kind>); 8] {
        [
            (self.controllers.sort, self.controllers.kinds().collect()),
            (self.references.sort, self.references.kinds().collect()),
            (self.estimators.sort, self.estimators.kinds().collect()),
            (self.devices.sort, self.devices.kinds().collect()),
            (self.peripherals.sort, self.peripherals.kinds().collect()),
            (self.layouts.sort, self.layouts.kinds().collect()),
            (self.events.sort, self.events.kinds().collect()),
            (self.receivers.sort, self.receivers.kinds().collect()),
        ]
    }

    /// The JSON schema of robot files: what may be chosen by name is listed, and each key says which kinds read it.
    pub fn json_schema(&self) -> Value {
        let mut schema = Value::from(schema_for!(RobotFile));
        for (sort, kinds) in self.sorts() {
            let names = format!("{}Name", capital(sort.name));
            let choice = json!({ "$ref": format!("#/$defs/{names}") });
            let table = &mut schema["$defs"][sort.definition()]["properties"];
            for key in kinds.iter().flat_map(|kind| &kind.keys) {
                let readers = kinds.iter().filter(|kind| kind.reads(&key.path())).map(|kind| kind.name);
                let readers = readers.collect::<Vec<_>>().join("`, `");
                let property = match &key.custom {
                    None => &mut table[key.name],
                    Some(custom) => {
                        let property = &mut table["custom"]["properties"][key.name];
                        *property = custom_schema(custom);
                        property
                    }
                };
                say(property, &format!("Read by `{readers}`."));
            }
            let chosen = &mut table[sort.key];
            if let Some(chosen) = chosen.as_object_mut() {
                chosen.remove("type");
                chosen.insert("anyOf".into(), json!([choice, { "type": "null" }]));
            }
            if let Some(default) = sort.default {
                say(chosen, &format!("Default: `{default}`."));
            }
            if let Some(items) = table.pointer_mut("/others/items") {
                *items = choice;
            }
            let one_of: Vec<Value> = kinds.iter().map(|kind| kind_schema(kind)).collect();
            schema["$defs"][names] =
                json!({ "description": format!("The {}s by name.", sort.name), "oneOf": one_of });
        }
        schema
    }

    /// Every kind with its keys, as JSON: `[{table, key, default, kinds: [{name, meaning, keys: [{name, needed, meaning,
    /// allowed}]}]}]`.
    pub fn describe(&self) -> Value {
        let schema = Value::from(schema_for!(RobotFile));
        let sorts = self.sorts().into_iter().map(|(sort, kinds)| {
            let kind = |kind: &&Kind| {
                let keys: Vec<Value> = kind.keys.iter().map(|key| key_facts(key, &sort, &schema)).collect();
                json!({ "name": kind.name, "meaning": kind.meaning, "keys": keys })
            };
            let kinds: Vec<Value> = kinds.iter().map(kind).collect();
            json!({ "table": sort.table, "key": sort.key, "default": sort.default, "kinds": kinds })
        });
        sorts.collect()
    }
}

/// Adds a sentence to a description, once.
fn say(property: &mut Value, sentence: &str) {
    let before = property["description"].as_str().unwrap_or_default();
    if !before.contains(sentence) {
        property["description"] = format!("{before} {sentence}").into();
    }
}

fn kind_schema(kind: &Kind) -> Value {
    let needs: Vec<String> = kind.keys.iter().filter(|key| key.is_needed).map(Key::path).collect();
    let needs = if needs.is_empty() { String::new() } else { format!(" Needs {}.", needs.join(", ")) };
    json!({ "const": kind.name, "description": format!("{}.{needs}", kind.meaning), "type": "string" })
}

fn custom_schema(custom: &Custom) -> Value {
    let mut schema = json!({ "description": format!("{}.", custom.meaning) });
    if let Some(bounds) = &custom.bounds {
        schema["type"] = "number".into();
        (schema["minimum"], schema["maximum"]) = (json!(bounds.start()), json!(bounds.end()));
    }
    schema
}

fn key_facts(key: &Key, sort: &Sort, schema: &Value) -> Value {
    let own = key.custom.as_ref().map(custom_schema);
    let property = own.as_ref().unwrap_or(&schema["$defs"][sort.definition()]["properties"][key.name]);
    let words = [("minimum", "at least"), ("exclusiveMinimum", "above"), ("maximum", "at most")];
    let bounds = words.iter().filter_map(|(bound, word)| {
        let bound = property.get(bound).or_else(|| property["items"].get(bound))?.as_f64()?;
        Some(format!("{word} {bound}"))
    });
    let bounds = bounds.collect::<Vec<_>>().join(" and ");
    let choices = property["anyOf"][0]["$ref"].as_str().and_then(|name| schema.pointer(&name[1..]));
    let choices = choices.and_then(|choices| choices["oneOf"].as_array()).into_iter().flatten();
    let choices = choices.filter_map(|choice| choice["const"].as_str()).collect::<Vec<_>>().join(", ");
    let meaning = property["description"].as_str().unwrap_or_default().replace('\n', " ");
    let allowed = [bounds, choices].into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>();
    let allowed = allowed.join(", or ");
    json!({ "name": key.path(), "needed": key.is_needed, "meaning": meaning, "allowed": allowed })
}
