//! The table of the reference: which motion is wished.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use super::custom::Parameters;

/// The motion that is wished; also a file of its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ReferenceTable {
    /// Which motion; it says which of the keys below are read.
    pub kind: Option<String>,
    /// Time of the whole motion, s, at most 1e6; default: as short as the limits allow.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub duration_s: Option<f64>,
    /// Radius, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub radius_m: Option<f64>,
    /// Time of one turn, s, in place of `duration_s`.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub period_s: Option<f64>,
    /// Turns, or `endless`: until somebody stops it; default: 1.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub turns: Option<Turns>,
    /// How the heading goes along; default: `given`.
    pub heading: Option<HeadingName>,
    /// Semi-axis along x, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub semi_axis_x_m: Option<f64>,
    /// Semi-axis along y, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub semi_axis_y_m: Option<f64>,
    /// Distance between neighbouring turns, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub step_m: Option<f64>,
    /// From its centre to an end, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub half_length_m: Option<f64>,
    /// Lines `[t, x, y, θ]`, SI, t rising.
    pub points: Option<Vec<[f64; 4]>>,
    /// A file of lines `(t, x, y, θ)` in place of `points`.
    pub points_file: Option<String>,
    /// What joins the points; default: `smooth`, which at corners is the thesis's rule.
    pub interpolation: Option<InterpolationName>,
    /// What repeats taught: lines `[t, x, y, θ]` in the platform's axes, SI, added to the motion as a B-spline; 0 in the first
    /// one. `omnibase learn` finds it.
    pub correction: Option<Vec<[f64; 4]>>,
    /// A file of lines `(t, x, y, θ)` in place of `correction`.
    pub correction_file: Option<String>,
    /// Control points `[x, y, θ]`, SI.
    pub controls: Option<Vec<[f64; 3]>>,
    /// Degree of the curve, from 1, straight lines, to one less than there are control points; default: 3.
    #[schemars(extend("minimum" = 1))]
    pub degree: Option<u32>,
    /// How strongly each control point draws the curve; default: 1.
    pub weights: Option<Vec<f64>>,
    /// Knots, not falling, `degree` + 1 more than control points; default: equally spaced, from the first control point to the last.
    pub knots: Option<Vec<f64>>,
    /// Path data as SVG has them (the attribute `d`), in one go.
    pub drawing: Option<String>,
    /// A file in place of `drawing`: SVG with one `path`, or DXF with one polyline.
    pub drawing_file: Option<String>,
    /// What one unit of the drawing is, m; default: as a DXF file says by `$INSUNITS`. Its x is forward; its y, which SVG points down,
    /// to the right, and DXF's to the left.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub unit_m: Option<f64>,
    /// How fast it is gone along; default: `as_given`, of curves `fastest`.
    pub timing: Option<Timing>,
    /// How far the fastest way through points may cut their corners, m; default: 0, it stops at them.
    #[schemars(extend("minimum" = 0.0))]
    pub corner_m: Option<f64>,
    /// Greatest speed of the fastest motion, m/s; default: the platform's.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub speed_m_s: Option<f64>,
    /// Greatest speed with which it turns, rad/s; default: the platform's.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub turn_speed_rad_s: Option<f64>,
    /// Speed with which the fastest motion passes the start of its way, m/s; a run from rest leads onto it; default: 0, it rests there.
    #[schemars(extend("minimum" = 0.0))]
    pub start_speed_m_s: Option<f64>,
    /// Speed with which it passes the end of its way, m/s; a run to rest leads on from it; default: 0, it rests there.
    #[schemars(extend("minimum" = 0.0))]
    pub end_speed_m_s: Option<f64>,
    /// Where its coordinates begin; default: `start`.
    pub frame: Option<PathFrame>,
    /// What obstacles in its way make the platform do, where it is `guarded`; default: `go_around`.
    pub obstacles: Option<AtObstacles>,
    /// The reference's own keys.
    pub custom: Parameters,
}

/// How often a shape is gone round.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Turns {
    /// So often.
    Count(f64),
    /// Until somebody stops it.
    Named(EndlessName),
}

/// The one name that a number of turns can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EndlessName {
    /// Until somebody stops it.
    Endless,
}

impl JsonSchema for Turns {
    fn schema_name() -> Cow<'static, str> {
        "Turns".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "string"], "oneOf": [{ "type": "number" }, { "const": "endless" }] })
    }
}

/// Where a motion's coordinates begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathFrame {
    /// It begins where the platform stands at the start.
    Start,
    /// Its poses are in odom; the platform must stand at the first one.
    Odom,
    /// It begins where the platform stands, and goes on in the platform's axes: along x is forward, however it has turned.
    Platform,
}

/// What obstacles in the way of a motion make the platform do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AtObstacles {
    /// It leaves its path, goes around them, and comes back.
    GoAround,
    /// It waits before them on its path, which it never leaves for them: what else is in the way, only who planned it knows.
    Wait,
}

/// What joins path points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InterpolationName {
    /// Cubic with continuous acceleration where the points lie smoothly; at corners (turns by more than 30°), and where the speed
    /// changes more than fourfold, as `cubic_previous_slope`.
    Smooth,
    /// Cubic; speed at a point: the slope before it, 0 where the slope changes sign.
    CubicPreviousSlope,
    /// Cubic; speed at a point: the mean of both slopes, 0 where the slope changes sign.
    CubicMeanSlope,
    /// Quintic with rest at every point.
    Quintic,
    /// Cubic spline with continuous acceleration.
    Spline,
    /// Cubic B-spline: smooth, within the points' hull, but past inner points.
    BSpline,
}

/// How fast a motion is gone along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Timing {
    /// By its own times; what the limits don't allow in them is refused.
    AsGiven,
    /// By its own times, all of them longer by one factor where the limits ask for it.
    Stretched,
    /// In the shortest time that the platform's limits allow; its own times don't count. Points are joined smoothly but for their
    /// corners (turns by more than 30°).
    Fastest,
}

/// How the heading goes along a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HeadingName {
    /// As the motion has it: a shape its own, points and control points theirs; of a drawing it stays.
    Given,
    /// It stays.
    Fixed,
    /// It follows the tangent; of points with `timing = "fastest"` alone.
    FollowsTangent,
    /// From the first to the last one, but for whole turns, it turns as is fastest; with `timing = "fastest"` alone.
    Free,
}
