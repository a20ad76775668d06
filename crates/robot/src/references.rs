//! References: wished motions.

use omnibase_platform::Pose2;

use crate::registry::Registry;
use crate::signals::Setpoint;
use crate::stages::Reference;

/// Registers the built-in references.
pub fn register(registry: &mut Registry) {
    registry.reference("hold", |_| Ok(Box::new(Hold::default())));
}

/// Stays where the platform stands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hold {
    pose: Pose2,
}

impl Reference for Hold {
    fn start(&mut self, from: &Setpoint) {
        self.pose = from.odom_from_body;
    }

    fn sample(&mut self, _: f64) -> Setpoint {
        Setpoint::at_rest(self.pose)
    }

    fn duration_s(&self) -> Option<f64> {
        None
    }
}

/// Reads path points: lines `(t, x, y, θ)`, SI.
pub fn read_points(text: &str) -> Result<Vec<[f64; 4]>, String> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines
        .map(|(index, line)| {
            let words = line.trim().trim_start_matches('(').trim_end_matches(')').split(',');
            let numbers: Vec<f64> = words.filter_map(|word| word.trim().parse().ok()).collect();
            numbers
                .try_into()
                .map_err(|_| format!("line {}: expected (t, x, y, θ), found `{line}`", index + 1))
        })
        .collect()
}
