//! What changes seldom: `robot_description`, `footprint`, `path`, `diagnostics`.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use omnibase_client::{Error, Found};
use omnibase_description::{Names, urdf};
use ros2_client::Publisher;
use serde_json::Value;

use crate::arguments::Arguments;
use crate::clock::Clock;
use crate::diagnostics::{Diagnostics, OfBridge};
use crate::messages::*;
use crate::node::{Ros, latched, telling};
use crate::robot::Facts;
use crate::states::Counts;

/// From one of the diagnostics to the next.
const DIAGNOSTICS: Duration = Duration::from_secs(1);

/// The topics, and what they are made of.
pub struct News {
    found: Found,
    robot: String,
    wheels: Vec<String>,
    columns: Vec<String>,
    odom_frame: String,
    counts: Arc<Counts>,
    diagnostics: (Diagnostics, Publisher<DiagnosticArray>),
    path: Publisher<Path>,
    _description: Publisher<Text>,
    _footprint: Publisher<PolygonStamped>,
    /// Which reference the path is of, and where it began.
    planned: Option<(Value, Value)>,
    told: Option<Instant>,
    asked: Sender<Result<Value, Error>>,
    answered: Receiver<Result<Value, Error>>,
}

impl News {
    /// Tells what never changes.
    pub fn new(
        ros: &mut Ros,
        found: Found,
        facts: &Facts,
        arguments: &Arguments,
        counts: Arc<Counts>,
    ) -> anyhow::Result<News> {
        let base_frame = arguments.base_frame();
        let urdf = match &arguments.urdf {
            Some(path) => std::fs::read_to_string(path).with_context(|| path.display().to_string())?,
            None => {
                let names = Names { prefix: &arguments.frame_prefix, base: &base_frame };
                urdf(&facts.description(), names)
            }
        };
        let description = ros.publisher("robot_description", latched())?;
        let unsent = || anyhow::anyhow!("DDS didn't take what never changes");
        description.publish(Text { data: urdf }).map_err(|_| unsent())?;
        let footprint = ros.publisher("footprint", latched())?;
        let corner = |[x, y]: &[f64; 2]| Point32 { x: *x as f32, y: *y as f32, z: 0.0 };
        let polygon = Polygon { points: facts.footprint.iter().map(corner).collect() };
        let header = Header { frame_id: base_frame, ..Header::default() };
        footprint.publish(PolygonStamped { header, polygon }).map_err(|_| unsent())?;
        let (asked, answered) = channel();
        Ok(News {
            found,
            robot: facts.name.clone(),
            wheels: facts.wheels.iter().map(|wheel| wheel.name.clone()).collect(),
            columns: facts.columns.clone(),
            odom_frame: arguments.odom_frame(),
            counts,
            diagnostics: (Diagnostics::default(), ros.publisher("/diagnostics", telling())?),
            path: ros.publisher("path", latched())?,
            _description: description,
            _footprint: footprint,
            planned: None,
            told: None,
            asked,
            answered,
        })
    }

    /// Tells what is due of the robot's last word.
    pub fn tell(&mut self, status: &Value, clock: &Clock, bridge: impl FnOnce() -> (usize, Option<String>)) {
        let now = Instant::now();
        let Some(stamp) = clock.now_ns().map(Time::of_ns) else { return };
        let planned = (status["reference"].clone(), status["reference_start"].clone());
        if self.planned.as_ref() != Some(&planned) {
            self.planned = Some(planned);
            // Its answer may take a while, and nobody waits for it here.
            let (found, asked) = (self.found.clone(), self.asked.clone());
            std::thread::spawn(move || asked.send(found.read("planned")));
        }
        if let Ok(Ok(planned)) = self.answered.try_recv() {
            // Nobody may listen.
            let _ = self.path.publish(path(&planned, stamp.clone(), &self.odom_frame));
        }
        if self.told.is_some_and(|told| now.saturating_duration_since(told) < DIAGNOSTICS) {
            return;
        }
        self.told = Some(now);
        let (publishers, objection) = bridge();
        let count = |counter: &std::sync::atomic::AtomicU64| counter.load(Ordering::Relaxed);
        let of_bridge = OfBridge {
            publishers,
            objection,
            missing: count(&self.counts.missing),
            unsent: count(&self.counts.unsent),
        };
        let mut all = self.diagnostics.0.of(status, &self.columns, &self.wheels, &of_bridge);
        for one in &mut all {
            one.name = format!("{}: {}", self.robot, one.name);
            one.hardware_id = self.robot.clone();
        }
        let header = Header { stamp, frame_id: String::new() };
        let _ = self.diagnostics.1.publish(DiagnosticArray { header, status: all });
    }
}

/// The planned path; none where the robot has none.
fn path(planned: &Value, stamp: Time, frame: &str) -> Path {
    let header = Header { stamp, frame_id: frame.to_owned() };
    let poses = planned["poses"].as_array().into_iter().flatten().filter_map(|pose| {
        let number = |n: usize| pose[n].as_f64();
        let position = Point { x: number(0)?, y: number(1)?, z: 0.0 };
        let pose = Pose { position, orientation: Quaternion::heading(number(2)?) };
        Some(PoseStamped { header: header.clone(), pose })
    });
    Path { poses: poses.collect(), header }
}
