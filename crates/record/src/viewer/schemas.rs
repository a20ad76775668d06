//! Foxglove's messages as far as they are drawn here, with the numbers of their fields (github.com/foxglove/foxglove-sdk, `schemas`).

use crate::run::protobuf::{push_bytes, push_number};

/// What a field holds: descriptor.proto's types.
#[derive(Clone, Copy)]
enum Kind {
    Double,
    Int64,
    Int32,
    Fixed32,
    Bool,
    Text,
    Bytes,
    Message(&'static str),
    Messages(&'static str),
    /// Of the one enum of its message.
    Choice(&'static str),
    Fixed32s,
}
use Kind::{Bool, Choice, Double, Fixed32, Fixed32s, Int32, Int64, Message, Messages, Text};

struct Schema {
    name: &'static str,
    /// In the order of their numbers, from 1.
    fields: &'static [(&'static str, Kind)],
    /// Its enum: the names of 0, 1 and so on.
    choices: &'static [&'static str],
}

const fn schema(name: &'static str, fields: &'static [(&'static str, Kind)]) -> Schema {
    Schema { name, fields, choices: &[] }
}

const TIMESTAMP: &str = ".google.protobuf.Timestamp";
const DURATION: &str = ".google.protobuf.Duration";
const POSE: (&str, Kind) = ("pose", Message(".foxglove.Pose"));
const COLOR: (&str, Kind) = ("color", Message(".foxglove.Color"));
const TIME: (&str, Kind) = ("timestamp", Message(TIMESTAMP));

/// Of the package `google.protobuf`.
const WELL_KNOWN: [(&str, Schema); 2] = [
    ("timestamp", schema("Timestamp", &[("seconds", Int64), ("nanos", Int32)])),
    ("duration", schema("Duration", &[("seconds", Int64), ("nanos", Int32)])),
];

/// Of the package `foxglove`.
const FOXGLOVE: [Schema; 20] = [
    schema("Vector3", &[("x", Double), ("y", Double), ("z", Double)]),
    schema("Point3", &[("x", Double), ("y", Double), ("z", Double)]),
    schema("Quaternion", &[("x", Double), ("y", Double), ("z", Double), ("w", Double)]),
    schema("Color", &[("r", Double), ("g", Double), ("b", Double), ("a", Double)]),
    schema(
        "Pose",
        &[("position", Message(".foxglove.Vector3")), ("orientation", Message(".foxglove.Quaternion"))],
    ),
    schema("KeyValuePair", &[("key", Text), ("value", Text)]),
    schema("PoseInFrame", &[TIME, ("frame_id", Text), POSE]),
    schema(
        "FrameTransform",
        &[
            TIME,
            ("parent_frame_id", Text),
            ("child_frame_id", Text),
            ("translation", Message(".foxglove.Vector3")),
            ("rotation", Message(".foxglove.Quaternion")),
        ],
    ),
    schema("FrameTransforms", &[("transforms", Messages(".foxglove.FrameTransform"))]),
    schema(
        "ArrowPrimitive",
        &[
            POSE,
            ("shaft_length", Double),
            ("shaft_diameter", Double),
            ("head_length", Double),
            ("head_diameter", Double),
            COLOR,
        ],
    ),
    schema("CubePrimitive", &[POSE, ("size", Message(".foxglove.Vector3")), COLOR]),
    schema("SpherePrimitive", &[POSE, ("size", Message(".foxglove.Vector3")), COLOR]),
    schema(
        "CylinderPrimitive",
        &[
            POSE,
            ("size", Message(".foxglove.Vector3")),
            ("bottom_scale", Double),
            ("top_scale", Double),
            COLOR,
        ],
    ),
    Schema {
        name: "LinePrimitive",
        fields: &[
            ("type", Choice(".foxglove.LinePrimitive.Type")),
            POSE,
            ("thickness", Double),
            ("scale_invariant", Bool),
            ("points", Messages(".foxglove.Point3")),
            COLOR,
            ("colors", Messages(".foxglove.Color")),
            ("indices", Fixed32s),
        ],
        choices: &["LINE_STRIP", "LINE_LOOP", "LINE_LIST"],
    },
    schema(
        "TriangleListPrimitive",
        &[
            POSE,
            ("points", Messages(".foxglove.Point3")),
            COLOR,
            ("colors", Messages(".foxglove.Color")),
            ("indices", Fixed32s),
        ],
    ),
    schema(
        "TextPrimitive",
        &[POSE, ("billboard", Bool), ("font_size", Double), ("scale_invariant", Bool), COLOR, ("text", Text)],
    ),
    schema(
        "ModelPrimitive",
        &[
            POSE,
            ("scale", Message(".foxglove.Vector3")),
            COLOR,
            ("override_color", Bool),
            ("url", Text),
            ("media_type", Text),
            ("data", Kind::Bytes),
        ],
    ),
    Schema {
        name: "SceneEntityDeletion",
        fields: &[TIME, ("type", Choice(".foxglove.SceneEntityDeletion.Type")), ("id", Text)],
        choices: &["MATCHING_ID", "ALL"],
    },
    schema(
        "SceneEntity",
        &[
            TIME,
            ("frame_id", Text),
            ("id", Text),
            ("lifetime", Message(DURATION)),
            ("frame_locked", Bool),
            ("metadata", Messages(".foxglove.KeyValuePair")),
            ("arrows", Messages(".foxglove.ArrowPrimitive")),
            ("cubes", Messages(".foxglove.CubePrimitive")),
            ("spheres", Messages(".foxglove.SpherePrimitive")),
            ("cylinders", Messages(".foxglove.CylinderPrimitive")),
            ("lines", Messages(".foxglove.LinePrimitive")),
            ("triangles", Messages(".foxglove.TriangleListPrimitive")),
            ("texts", Messages(".foxglove.TextPrimitive")),
            ("models", Messages(".foxglove.ModelPrimitive")),
        ],
    ),
    schema(
        "SceneUpdate",
        &[
            ("deletions", Messages(".foxglove.SceneEntityDeletion")),
            ("entities", Messages(".foxglove.SceneEntity")),
        ],
    ),
];

const LOG: Schema = Schema {
    name: "Log",
    fields: &[
        TIME,
        ("level", Choice(".foxglove.Log.Level")),
        ("message", Text),
        ("name", Text),
        ("file", Text),
        ("line", Fixed32),
    ],
    choices: &["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"],
};

/// A `FileDescriptorSet` that explains all of Foxglove's messages that are written here; files after those that they need.
pub(super) fn descriptors() -> Vec<u8> {
    let mut set = Vec::new();
    for (file, schema) in &WELL_KNOWN {
        let file = format!("google/protobuf/{file}.proto");
        push_bytes(&mut set, 1, &descriptor(&file, "google.protobuf", &[], &[schema]));
    }
    let schemas: Vec<&Schema> = FOXGLOVE.iter().chain([&LOG]).collect();
    let needed = WELL_KNOWN.each_ref().map(|(file, _)| format!("google/protobuf/{file}.proto"));
    push_bytes(&mut set, 1, &descriptor("foxglove/viewer.proto", "foxglove", &needed, &schemas));
    set
}

/// A `FileDescriptorProto`.
fn descriptor(file: &str, package: &str, needed: &[String], schemas: &[&Schema]) -> Vec<u8> {
    let mut bytes = Vec::new();
    push_bytes(&mut bytes, 1, file.as_bytes());
    push_bytes(&mut bytes, 2, package.as_bytes());
    for file in needed {
        push_bytes(&mut bytes, 3, file.as_bytes());
    }
    for schema in schemas {
        push_bytes(&mut bytes, 4, &message(schema));
    }
    push_bytes(&mut bytes, 12, b"proto3");
    bytes
}

/// A `DescriptorProto`.
fn message(schema: &Schema) -> Vec<u8> {
    let mut bytes = Vec::new();
    push_bytes(&mut bytes, 1, schema.name.as_bytes());
    for (number, (name, kind)) in (1..).zip(schema.fields) {
        let (code, kind_name, is_list) = match kind {
            Kind::Double => (1, None, false),
            Kind::Int64 => (3, None, false),
            Kind::Int32 => (5, None, false),
            Kind::Fixed32 => (7, None, false),
            Kind::Fixed32s => (7, None, true),
            Kind::Bool => (8, None, false),
            Kind::Text => (9, None, false),
            Kind::Bytes => (12, None, false),
            Kind::Message(name) => (11, Some(name), false),
            Kind::Messages(name) => (11, Some(name), true),
            Kind::Choice(name) => (14, Some(name), false),
        };
        let mut field = Vec::new();
        push_bytes(&mut field, 1, name.as_bytes());
        push_number(&mut field, 3, number);
        push_number(&mut field, 4, if is_list { 3 } else { 1 });
        push_number(&mut field, 5, code);
        if let Some(name) = kind_name {
            push_bytes(&mut field, 6, name.as_bytes());
        }
        push_bytes(&mut bytes, 2, &field);
    }
    if let Some(Choice(name)) =
        schema.fields.iter().map(|(_, kind)| kind).find(|kind| matches!(kind, Choice(_)))
    {
        let name = name.rsplit('.').next().unwrap_or_default();
        let numbered: Vec<_> = (0..).zip(schema.choices).collect();
        push_bytes(&mut bytes, 4, &choices(name, &numbered));
    }
    bytes
}

/// An `EnumDescriptorProto` of codes with their names; the first of them has to be 0.
pub(super) fn choices(name: &str, names: &[(i32, impl AsRef<str>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    push_bytes(&mut bytes, 1, name.as_bytes());
    for (code, name) in names {
        let mut value = Vec::new();
        push_bytes(&mut value, 1, name.as_ref().as_bytes());
        push_number(&mut value, 2, i64::from(*code) as u64);
        push_bytes(&mut bytes, 2, &value);
    }
    bytes
}
