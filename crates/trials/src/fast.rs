//! Motions as fast as physics allows, driven: planned by wheels and grip, on floors as they were told and on others.

use omnibase_robot::signals::SafetyReason;

use crate::robots::with_payload;
use crate::slip::Slid;

/// A motion on a floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The robot's file.
    pub robot: &'static str,
    /// The control law.
    pub law: &'static str,
    /// The table of the motion, but for its timing.
    pub motion: String,
    /// The friction that its file tells: motions are planned with four fifths of it.
    pub told: f64,
    /// The floor's own, static and sliding.
    pub floor: [f64; 2],
}

/// Limits that leave the wheels and the floor to bind: those of the platform's speed stay, in m/s and rad/s.
pub const SPEEDS: [f64; 2] = [1.5, 3.0];
const HIGH: [(&str, f64); 6] = [
    ("speed_m_s", SPEEDS[0]),
    ("acceleration_m_s2", 6.0),
    ("jerk_m_s3", 400.0),
    ("turn_speed_rad_s", SPEEDS[1]),
    ("turn_acceleration_rad_s2", 20.0),
    ("turn_jerk_rad_s3", 1600.0),
];

/// The square of 2 m, stopping at its corners or cutting them by 50 mm; circle, eight.
pub const MOTIONS: [(&str, &str); 4] = [
    (
        "square",
        "kind = \"path\"\npoints = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], [15, 0, 2, 0], [20, 0, 0, 0]]",
    ),
    (
        "blended",
        "kind = \"path\"\npoints = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], [15, 0, 2, 0], [20, 0, 0, 0]]\ncorner_m = 0.05",
    ),
    ("circle", "kind = \"circle\"\nradius_m = 0.5"),
    ("eight", "kind = \"eight\"\nhalf_length_m = 0.8"),
];

/// A path through eight random points in 3 m by 3 m, its heading within half a radian.
pub fn random_path(seed: u64) -> String {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut unit = || {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    };
    let rows = (0..8).map(|at| {
        let [x, y, heading] = [3.0, 3.0, 1.0].map(|size| size * (unit() - 0.5));
        if at == 0 { "[0, 0, 0, 0]".to_owned() } else { format!("[{at}, {x:?}, {y:?}, {heading:?}]") }
    });
    format!("kind = \"path\"\npoints = [{}]\ncorner_m = 0.05", rows.collect::<Vec<_>>().join(", "))
}

impl Case {
    /// Its file.
    pub fn text(&self) -> String {
        let Case { told, floor: [rests, slides], .. } = self;
        let robot = HIGH.iter().fold(self.robot.to_owned(), |text, (key, value)| {
            let at = text.find(&format!("\n{key} = ")).map_or(0, |at| at + 1);
            let end = text[at..].find('\n').map_or(text.len(), |end| at + end);
            format!("{}{key} = {value:?}{}", &text[..at], &text[end..])
        });
        let text = with_payload(&robot, self.law, 1.0, 0.0);
        format!(
            "{text}static_friction = {rests:?}\nsliding_friction = {slides:?}\n[estimator]\ncreep = 0.025\n[grip]\ncentre_of_mass_height_m = 0.25\nfriction = {told:?}\n\
             [reference]\ntiming = \"fastest\"\n{}\n",
            self.motion
        )
    }

    /// Drives it.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn ride(&self) -> Slid {
        Slid::of(&self.text(), false)
    }

    /// A row of the table.
    pub fn row(&self, name: &str, slid: &Slid) -> String {
        let slips = slid.stopped != SafetyReason::None || slid.told.is_some();
        format!(
            "| {} | {name} | {:.2} | {:.2}/{:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {} | {} |",
            self.law,
            self.told,
            self.floor[0],
            self.floor[1],
            slid.run.cycles as f64 * 1e-3,
            1e3 * slid.run.true_final_m,
            1e3 * slid.run.believed_greatest_m,
            1e3 * slid.way_m,
            if slips { "yes" } else { "no" },
            slid.end(),
        )
    }
}

/// Heading of the table.
pub const HEADING: &str = "| law | motion | friction told | floor | time s | true final mm | believed greatest mm | longest slip mm | slip told | end |\n|---|---|---|---|---|---|---|---|---|---|";
