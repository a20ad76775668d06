//! Paths that are taught by driving or point by point, saved, and found again.

use std::path::Path;

use omnibase_platform::Pose2;
use omnibase_robot::config::{ReferenceTable, Source};
use omnibase_run::live::{Asker, TRACE_KEPT_S};
use omnibase_run::teach::{Sampling, joined, lines, taught};

use super::{CallHandler, Checked, Reply, lock, no_files};
use crate::call::{CallResult, TeachBy};

/// How far a taught path may be from where the robot was, m, where nobody says.
const TOLERANCE_M: f64 = 0.001;

impl CallHandler {
    pub(super) fn teach(&self, by: TeachBy) -> Result<Reply, String> {
        self.live.forget_points();
        let sampling = match by {
            TeachBy::Points => {
                *lock(&self.teaching) = None;
                self.live.begin_points();
                let text = "remembering single points: `teach_point`, or the joystick's button";
                return Ok(Reply::CallResult(CallResult::done(text)));
            }
            TeachBy::PeriodS(period_s) => Sampling::Period { period_s },
            TeachBy::Change { distance_m, angle_rad } => Sampling::Change { distance_m, angle_rad },
        };
        let since_s = self.live.snapshot().record.time.now_ns as f64 * 1e-9;
        *lock(&self.teaching) = Some((since_s, sampling));
        Ok(Reply::CallResult(CallResult::done(format!(
            "remembering where the robot is driven, for {:.0} minutes at most",
            TRACE_KEPT_S / 60.0
        ))))
    }

    pub(super) fn teach_end(
        &self,
        asker: Asker,
        name: &str,
        tolerance_m: Option<f64>,
    ) -> Result<Reply, String> {
        if let Some(poses) = self.live.points() {
            return self.points_end(asker, name, &poses);
        }
        let (since_s, sampling) =
            lock(&self.teaching).ok_or("expected `teach` before it: nothing was remembered")?;
        self.check_name(name)?;
        let trace = self.live.whole_trace_since(since_s).map_err(|gap| {
            // What is missing doesn't come back: teaching begins anew.
            *lock(&self.teaching) = None;
            format!("{gap}; teach it again, or in parts")
        })?;
        let limits = &self.about.robot.plan.limits;
        let taught = taught(&trace, sampling, tolerance_m.unwrap_or(TOLERANCE_M), limits)
            .map_err(|error| error.to_string())?;
        self.save(name, &taught.reference).map_err(|error| format!("saving: {error}"))?;
        *lock(&self.teaching) = None;
        let points = taught.reference.points.as_ref().map_or(0, Vec::len);
        let text = format!(
            "taught {points} points of {}, within {:.2} mm; saved as {}",
            taught.remembered,
            1e3 * taught.deviation_m,
            self.about.paths.join(format!("{name}.toml")).display(),
        );
        let checked = self.about.check(taught.reference.into(), &no_files)?;
        self.load(asker, checked, &text)
    }

    /// Single points become a path. They are kept until that is saved, and while more of them come.
    fn points_end(&self, asker: Asker, name: &str, poses: &[Pose2]) -> Result<Reply, String> {
        self.check_name(name)?;
        let taught = joined(poses, &self.about.robot.plan.limits).map_err(|error| error.to_string())?;
        let checked = self.about.check(taught.reference.clone().into(), &no_files)?;
        if !self.live.end_points(poses.len()) {
            return Err("a point came meanwhile: end it again".to_owned());
        }
        let saved = self.save(name, &taught.reference);
        if let Err(error) = saved {
            self.live.resume_points(poses);
            return Err(format!("saving: {error}; the points are kept"));
        }
        let file = self.about.paths.join(format!("{name}.toml"));
        let text = format!(
            "taught {} points, joined by straight ways at the robot's limits; saved as {}",
            poses.len(),
            file.display()
        );
        self.load(asker, checked, &text)
    }

    fn check_name(&self, name: &str) -> Result<(), String> {
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_');
        if (1..=64).contains(&name.len()) && name.bytes().all(plain) {
            return Ok(());
        }
        Err(format!("a path's name: expected letters, digits, - and _, found `{name}`"))
    }

    /// The points as a file of their own, and the reference that names it.
    fn save(&self, name: &str, table: &ReferenceTable) -> std::io::Result<()> {
        let _saving = lock(&self.saving);
        let folder: &Path = &self.about.paths;
        std::fs::create_dir_all(folder)?;
        let points = format!("{name}.dat");
        let rows = table.points.as_deref().unwrap_or_default();
        std::fs::write(folder.join(&points), lines("Taught: t s, x m, y m, heading rad, in odom.", rows))?;
        let named = ReferenceTable { points: None, points_file: Some(points), ..table.clone() };
        let text = toml::to_string(&named).map_err(std::io::Error::other)?;
        std::fs::write(folder.join(format!("{name}.toml")), text)
    }

    /// A saved path, with its points in it.
    pub(super) fn saved(&self, name: &str) -> Result<Checked, String> {
        self.check_name(name)?;
        let read = |file: &str| {
            let path = self.about.paths.join(file);
            std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
        };
        let file = format!("{name}.toml");
        let mut source = Source::read_reference(&read(&file)?, &file);
        source.file.points_file = Some(format!("{name}.dat"));
        self.about.check(source, &read)
    }

    /// Names of the saved paths.
    pub(crate) fn saved_names(&self) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(&self.about.paths) else { return Vec::new() };
        let name = |entry: std::fs::DirEntry| {
            let name = entry.file_name().into_string().ok()?.strip_suffix(".toml")?.to_owned();
            self.check_name(&name).ok()?;
            self.about.paths.join(format!("{name}.dat")).is_file().then_some(name)
        };
        let mut names: Vec<String> = entries.flatten().filter_map(name).collect();
        names.sort();
        names
    }
}
