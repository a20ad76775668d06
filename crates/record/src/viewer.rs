//! A run for viewers: Foxglove's messages for what is drawn, with the wall clock's times, and signals whose codes have names.
//!
//! [`Drawing`] is one moment of a robot; [`messages`] makes it Foxglove's messages. [`Channels`] are all that viewers see of a
//! robot; [`ViewerFile`] writes them as MCAP.

mod channels;
mod file;
mod schemas;

pub use channels::{Channel, Channels, LOG, Named, TOPICS};
pub use file::{ViewerError, ViewerFile};

use crate::run::protobuf::{push_bytes, push_double, push_number};

/// Red, green, blue and opacity, 0 to 1.
pub type Colour = [f64; 4];

/// Where something is, and how it is turned: x, y, z in m, and a unit quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Position, m.
    pub at_m: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub turned: [f64; 4],
}

impl Placed {
    /// On the floor.
    pub fn on_floor(x_m: f64, y_m: f64, heading_rad: f64) -> Self {
        let (sine, cosine) = (heading_rad / 2.0).sin_cos();
        Placed { at_m: [x_m, y_m, 0.0], turned: [0.0, 0.0, sine, cosine] }
    }

    /// Turned by an angle about a unit vector.
    pub fn about(at_m: [f64; 3], axis: [f64; 3], angle_rad: f64) -> Self {
        let (sine, cosine) = (angle_rad / 2.0).sin_cos();
        let [x, y, z] = axis.map(|part| part * sine);
        Placed { at_m, turned: [x, y, z, cosine] }
    }
}

/// A frame in another one.
#[derive(Clone, Debug, PartialEq)]
pub struct Transform {
    /// The other one.
    pub parent: String,
    /// It.
    pub child: String,
    /// Where it is.
    pub placed: Placed,
}

/// Something drawn in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Entity {
    /// Its name: drawn again it replaces what was.
    pub id: String,
    /// The frame.
    pub frame: String,
    /// What is drawn.
    pub shapes: Vec<Shape>,
}

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line through points.
    Line {
        /// The points, m.
        points_m: Vec<[f64; 3]>,
        /// Whether its end meets its begin.
        is_closed: bool,
        /// m.
        thickness_m: f64,
        /// Its colour.
        colour: Colour,
    },
    /// A cylinder along the z of its place.
    Cylinder {
        /// Where its middle is.
        placed: Placed,
        /// m.
        radius_m: f64,
        /// m.
        height_m: f64,
        /// Its colour.
        colour: Colour,
    },
}

/// A robot at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Frames.
    pub transforms: Vec<Transform>,
    /// Where it believes to be, in odom.
    pub pose: Option<Placed>,
    /// Where it wishes to be, in odom.
    pub wished: Option<Placed>,
    /// What is drawn anew.
    pub entities: Vec<Entity>,
    /// What is no longer there.
    pub gone: Vec<String>,
}

/// A drawing's messages with their topics' places in [`TOPICS`]; those without content are left out.
pub fn messages(drawing: &Drawing, unix_ns: u64) -> Vec<(usize, Vec<u8>)> {
    let stamp = stamp(unix_ns);
    let mut all = Vec::new();
    if !drawing.transforms.is_empty() {
        let mut bytes = Vec::new();
        for transform in &drawing.transforms {
            let mut one = Vec::new();
            push_bytes(&mut one, 1, &stamp);
            push_bytes(&mut one, 2, transform.parent.as_bytes());
            push_bytes(&mut one, 3, transform.child.as_bytes());
            push_bytes(&mut one, 4, &doubles(&transform.placed.at_m));
            push_bytes(&mut one, 5, &doubles(&transform.placed.turned));
            push_bytes(&mut bytes, 1, &one);
        }
        all.push((0, bytes));
    }
    for (topic, placed) in [(1, drawing.pose), (2, drawing.wished)] {
        if let Some(placed) = placed {
            let mut bytes = Vec::new();
            push_bytes(&mut bytes, 1, &stamp);
            push_bytes(&mut bytes, 2, b"odom");
            push_bytes(&mut bytes, 3, &pose(&placed));
            all.push((topic, bytes));
        }
    }
    if !drawing.entities.is_empty() || !drawing.gone.is_empty() {
        let mut bytes = Vec::new();
        for id in &drawing.gone {
            let mut one = Vec::new();
            push_bytes(&mut one, 1, &stamp);
            push_bytes(&mut one, 3, id.as_bytes());
            push_bytes(&mut bytes, 1, &one);
        }
        for entity in &drawing.entities {
            push_bytes(&mut bytes, 2, &scene_entity(entity, &stamp));
        }
        all.push((3, bytes));
    }
    all
}

/// An event as Foxglove's `Log`, of level information or warning.
pub fn log(text: &str, is_warning: bool, unix_ns: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    push_bytes(&mut bytes, 1, &stamp(unix_ns));
    push_number(&mut bytes, 2, if is_warning { 3 } else { 2 });
    push_bytes(&mut bytes, 3, text.as_bytes());
    push_bytes(&mut bytes, 4, b"omnibase");
    bytes
}

fn scene_entity(entity: &Entity, stamp: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    push_bytes(&mut bytes, 1, stamp);
    push_bytes(&mut bytes, 2, entity.frame.as_bytes());
    push_bytes(&mut bytes, 3, entity.id.as_bytes());
    // It moves with its frame until it is drawn again.
    push_number(&mut bytes, 5, 1);
    for shape in &entity.shapes {
        let mut one = Vec::new();
        let field = match shape {
            Shape::Cylinder { placed, radius_m, height_m, colour } => {
                push_bytes(&mut one, 1, &pose(placed));
                push_bytes(&mut one, 2, &doubles(&[2.0 * radius_m, 2.0 * radius_m, *height_m]));
                push_double(&mut one, 3, 1.0);
                push_double(&mut one, 4, 1.0);
                push_bytes(&mut one, 5, &doubles(colour));
                10
            }
            Shape::Line { points_m, is_closed, thickness_m, colour } => {
                push_number(&mut one, 1, u64::from(*is_closed));
                push_bytes(&mut one, 2, &pose(&Placed::on_floor(0.0, 0.0, 0.0)));
                push_double(&mut one, 3, *thickness_m);
                for point in points_m {
                    push_bytes(&mut one, 5, &doubles(point));
                }
                push_bytes(&mut one, 6, &doubles(colour));
                11
            }
        };
        push_bytes(&mut bytes, field, &one);
    }
    bytes
}

fn pose(placed: &Placed) -> Vec<u8> {
    let mut bytes = Vec::new();
    push_bytes(&mut bytes, 1, &doubles(&placed.at_m));
    push_bytes(&mut bytes, 2, &doubles(&placed.turned));
    bytes
}

/// A message of doubles alone.
fn doubles(values: &[f64]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(9 * values.len());
    for (number, value) in (1..).zip(values) {
        push_double(&mut bytes, number, *value);
    }
    bytes
}

/// `google.protobuf.Timestamp`.
fn stamp(unix_ns: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    push_number(&mut bytes, 1, unix_ns / 1_000_000_000);
    push_number(&mut bytes, 2, unix_ns % 1_000_000_000);
    bytes
}
