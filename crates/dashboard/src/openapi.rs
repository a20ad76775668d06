//! The API described, as OpenAPI 3.1: made from the types that are read and written, so that it can't be another one.

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value, json};

use crate::call::{Call, CallResult};
use crate::inputs::{InputsNews, SentInputs};
use crate::planned::Planned;
use crate::robot_info::API_VERSION;
use crate::room_seen::MapSeen;
use crate::routes::Robot;
use crate::states::{StatesBegin, Wanted};
use crate::status::{EventSeen, StatusMessage};

/// Where schemas stand in the description.
const SCHEMAS: &str = "/components/schemas";

/// The description.
pub fn description() -> Value {
    let settings =
        || SchemaSettings::draft2020_12().with(|settings| settings.definitions_path = SCHEMAS.into());
    let (mut read, mut written) = (settings().into_generator(), settings().for_serialize().into_generator());
    let call = schema::<Call>(&mut read);
    let sent = schema::<SentInputs>(&mut read);
    let seen = schema::<StatusMessage>(&mut written);
    let news = schema::<InputsNews>(&mut written);
    let begin = schema::<StatesBegin>(&mut written);
    let result = schema::<CallResult>(&mut written);
    let [robot, planned, event, map] = [
        schema::<Robot<'static>>(&mut written),
        schema::<Option<Planned>>(&mut written),
        schema::<EventSeen>(&mut written),
        schema::<MapSeen>(&mut written),
    ];
    let mut schemas: Map<String, Value> = read.take_definitions(true);
    schemas.extend(written.take_definitions(true));
    let variants = schemas.get_mut("Call").and_then(|call| call["oneOf"].as_array_mut());
    for variant in variants.into_iter().flatten() {
        // What stands beside a call.
        variant["properties"]["stamp"] = json!({
            "type": ["integer", "null"], "minimum": 0,
            "description": "The last stamp that the client had from the robot, ms of the robot's clock.",
        });
        variant["properties"]["number"] =
            json!({ "type": "integer", "minimum": 0, "description": "Comes back in a WebSocket's answer." });
    }
    let mut now = schemas.get("StatusMessage").cloned().unwrap_or_default();
    now["properties"]["values"] = json!({
        "type": "object", "additionalProperties": { "type": ["number", "null"] },
        "description": "Every recorded signal by its name; null where it is no number.",
    });
    schemas.insert("Now".to_owned(), now);
    let trace = json!({ "type": "array", "description": "(time s, believed pose, true pose)" });
    let rows = json!({
        "type": "string", "contentEncoding": "binary",
        "description": "Every further message: the cycles that are missing so far as u64, then for each row its instant on \
            the robot's clock, ns, as u64 and its values as f64; all little-endian",
    });
    let get = |summary: &str, what: Value| {
        let json = json!({ "application/json": { "schema": what } });
        json!({ "get": { "summary": summary, "responses": answers(&json) } })
    };
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "omnibase", "version": API_VERSION,
            "description": "A running robot: what it is, what it does, and what may be asked of it. SI units.",
            "license": { "name": "MIT OR Apache-2.0", "identifier": "MIT OR Apache-2.0" },
        },
        "servers": [{ "url": "/" }],
        "security": [{}, { "token": [] }],
        "paths": {
            "/api/robot": get("What doesn't change while it runs", robot),
            "/api/now": get("What it does now, with the stamp for calls", json!({ "$ref": "#/components/schemas/Now" })),
            "/api/planned": get("The reference as it is drawn", planned),
            "/api/map": get("The room through which ways are planned", map),
            "/api/events": get("What has happened", json!({ "type": "array", "items": event })),
            "/api/trace": get("Where it was", trace),
            "/api/call": { "post": {
                "summary": "Asks for something; STOP needs no token on this machine, everything else does",
                "security": [{}, { "token": [] }],
                "requestBody": { "required": true, "content": { "application/json": { "schema": call } } },
                "responses": call_answers(&result),
            } },
            "/api/live": { "get": {
                "summary": "A WebSocket: calls in, their answers and thirty times a second what the robot does out",
                "responses": live_answers(),
                "x-client-messages": call, "x-server-messages": { "anyOf": [seen, result] },
            } },
            "/api/inputs": { "get": {
                "summary": "A WebSocket for programs that may command: what they know in, the robot's clock and what became of it fifty times a second out",
                "security": [{ "token": [] }],
                "responses": socket_answers(),
                "x-client-messages": sent, "x-server-messages": news,
            } },
            "/api/states": { "get": {
                "summary": "A WebSocket: chosen signals of every cycle, or every so many, with their instants, and how many cycles are missing",
                "parameters": parameters::<Wanted>(),
                "responses": states_answers(),
                "x-server-messages": { "prefixItems": [begin, rows] },
            } },
        },
        "components": {
            "securitySchemes": { "token": { "type": "http", "scheme": "bearer" } },
            "schemas": schemas,
        },
    })
}

fn schema<T: JsonSchema>(generator: &mut SchemaGenerator) -> Value {
    generator.subschema_for::<T>().to_value()
}

/// What comes back to who reads: what was asked for, or why not.
fn answers(content: &Value) -> Value {
    let mut all = refusals();
    all["200"] = json!({ "description": "Done", "content": content });
    all["503"] = json!({ "description": "Too much is computed already", "content": said_no() });
    all
}

/// What comes back to who may not, or asks too much.
fn refusals() -> Value {
    let mut either = said_no();
    either["text/plain"] = words()["text/plain"].clone();
    json!({
        "403": { "description": "Not with this token, or not from there", "content": words() },
        "429": { "description": "Asked too often, or with too many wrong tokens", "content": either },
    })
}

fn said_no() -> Value {
    json!({ "application/json": { "schema": { "$ref": "#/components/schemas/CallResult" } } })
}

fn words() -> Value {
    json!({ "text/plain": { "schema": { "type": "string" } } })
}

/// What comes back to who asks for a WebSocket.
fn socket_answers() -> Value {
    let mut all = refusals();
    all["101"] = json!({ "description": "It is one now" });
    all["400"] =
        json!({ "description": "No WebSocket was asked for, or of another version", "content": words() });
    all["426"] =
        json!({ "description": "This connection can't become one, as of HTTP/1.0", "content": words() });
    all
}

/// What comes back to a page.
fn live_answers() -> Value {
    let mut all = socket_answers();
    all["503"] = json!({ "description": "Too many look on without the token", "content": said_no() });
    all
}

/// What comes back to a program that follows.
fn states_answers() -> Value {
    let mut all = socket_answers();
    let mut either = said_no();
    either["text/plain"] = words()["text/plain"].clone();
    all["400"] = json!({ "description": "What is wanted can't be had, and why", "content": either });
    all["503"] = json!({ "description": "Too many programs follow", "content": said_no() });
    all
}

/// What stands behind the question mark of an address.
fn parameters<T: JsonSchema>() -> Vec<Value> {
    let schema = schemars::schema_for!(T).to_value();
    let keys = schema["properties"].as_object().into_iter().flatten();
    keys.map(|(name, key)| {
        json!({ "name": name, "in": "query", "description": key["description"], "schema": { "type": key["type"] } })
    })
    .collect()
}

/// What comes back to who calls.
fn call_answers(result: &Value) -> Value {
    let json = json!({ "application/json": { "schema": result } });
    let either =
        json!({ "application/json": { "schema": result }, "text/plain": { "schema": { "type": "string" } } });
    let mut all = answers(&json);
    all["400"] = json!({ "description": "It can't be read", "content": either });
    all["408"] = json!({ "description": "The body didn't come in time", "content": json });
    all["409"] = json!({ "description": "Refused, and why", "content": json });
    all["413"] = json!({ "description": "The body is too long", "content": words() });
    all
}

/// The description for people: a page of HTML.
pub fn page(description: &Value) -> String {
    let mut text = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>omnibase API {API_VERSION}</title>\
         <link rel=\"stylesheet\" href=\"/style.css\"><main class=\"api\"><h1>omnibase API {API_VERSION}</h1>\
         <p>For programs: <a href=\"/api/openapi.json\">/api/openapi.json</a> (OpenAPI 3.1).</p><h2>Addresses</h2><dl>"
    );
    for (path, methods) in description["paths"].as_object().into_iter().flatten() {
        for (method, operation) in methods.as_object().into_iter().flatten() {
            text += &format!(
                "<dt><code>{} {path}</code><dd>{}",
                method.to_uppercase(),
                said(&operation["summary"])
            );
        }
    }
    text += "</dl><h2>Calls</h2><p>The body of <code>POST /api/call</code>; a star: must be given.</p><dl>";
    let schemas = &description["components"]["schemas"];
    for call in schemas["Call"]["oneOf"].as_array().into_iter().flatten() {
        let keys = &call["properties"];
        text += &format!("<dt><code>{{\"do\": {}", keys["do"]["const"]);
        let needed =
            |name: &str| call["required"].as_array().is_some_and(|all| all.iter().any(|one| one == name));
        let own = keys.as_object().into_iter().flatten();
        let own: Vec<_> =
            own.filter(|(name, _)| !["do", "stamp", "number"].contains(&name.as_str())).collect();
        for (name, _) in &own {
            text += &format!(", \"{name}{}\": …", if needed(name) { "*" } else { "" });
        }
        text += &format!("}}</code><dd>{}", said(&call["description"]));
        for (name, key) in own {
            text += &format!("<br><code>{name}</code>: {}", said(&key["description"]));
        }
    }
    text + "</dl></main></html>\n"
}

/// A description as HTML.
fn said(text: &Value) -> String {
    text.as_str().unwrap_or_default().replace('&', "&amp;").replace('<', "&lt;").replace('\n', " ")
}
