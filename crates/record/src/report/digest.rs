//! A run of any length, reduced while it is read to the rows that its charts show.

use super::curve::{self, COLUMNS};
use super::sections::Speeds;
use super::sensors::MapSeries;
use super::signals::Signals;
use super::totals::Totals;
use super::tracking::Tracking;
use crate::run::{Keep, RecordedRow, RecordedRun, RunError};
use std::io::{self, Read};
use std::ops::ControlFlow;

/// Rows that are looked at together.
const PIECE: usize = 8192;
/// Whole numbers up to here are taken for codes: a row in which one changes is seen.
const GREATEST_CODE: f64 = 16.0;
/// Changes of one code that are seen in a column of a chart.
const MOST_CHANGES: u32 = 32;
/// Points that shape a path, in a column's time.
const MOST_CORNERS: usize = 16;
/// Points of a path nearer than this to the line between others shape nothing, m.
const STRAIGHT_M: f64 = 1e-6;

/// What a page shows of a run: the rows of least and greatest values for each column of its charts, those in which something
/// changes, those that shape its path, and the figures of all rows.
pub struct Digest {
    /// The rows that are seen, and all else that is known of the run.
    pub run: RecordedRun,
    /// The motion as it was planned, as a picture (SVG) by whoever knows the robot; without one the page has no such section.
    pub planned: Option<String>,
    totals: Totals,
}

impl Digest {
    /// Reads a recording twice: how long it is, then what it holds. The room that it needs doesn't grow with the recording.
    pub fn read<R: Read>(mut open: impl FnMut() -> io::Result<R>) -> Result<Self, RunError> {
        let mut length = Length::default();
        RecordedRun::read_each(open()?, Keep::Times, &mut |_, row| {
            length.take(row.time_ns);
            ControlFlow::Continue(())
        })?;
        let mut reduction = Reduction { length, ..Reduction::default() };
        let read = RecordedRun::read_each(open()?, super::SHOWN, &mut |run, row| {
            reduction.take(run, row);
            ControlFlow::Continue(())
        })?;
        Ok(reduction.finish(read))
    }

    /// Cycles of the recording.
    pub fn cycles(&self) -> u64 {
        self.totals.cycles
    }

    /// The page, as a whole HTML file.
    pub fn html(&self) -> String {
        let signals = Signals::new(&self.run);
        super::page(&signals, &Tracking::new(&signals), &self.totals, self.planned.as_deref())
    }
}

/// How long a run is.
#[derive(Clone, Copy, Debug, Default)]
struct Length {
    first_ns: Option<u64>,
    /// Since the first; it never runs backwards.
    last_ns: u64,
    rows: usize,
}

impl Length {
    fn take(&mut self, time_ns: u64) {
        self.last_ns = time_ns.saturating_sub(*self.first_ns.get_or_insert(time_ns)).max(self.last_ns);
        self.rows += 1;
    }

    /// In which column of a chart a run so long ends, as [`curve::envelope`] has them, where the whole is as long as `whole`.
    fn column(&self, whole: &Length) -> usize {
        let width_s = whole.last_ns as f64 * 1e-9 / COLUMNS as f64;
        if width_s > 0.0 { (self.last_ns as f64 * 1e-9 / width_s) as usize } else { 0 }
    }
}

/// A run while it is reduced.
#[derive(Default)]
struct Reduction {
    /// Of the whole run.
    length: Length,
    /// As far as it was read.
    read: Length,
    column: usize,
    /// The rows of the column that is read: first those that were reduced already.
    piece: RecordedRun,
    /// So many of its rows stand in the totals.
    counted: usize,
    seen: RecordedRun,
    totals: Totals,
}

impl Reduction {
    fn take(&mut self, run: &RecordedRun, row: RecordedRow<'_>) {
        if self.read.rows == 0 {
            self.piece.schema = run.schema.clone();
            self.piece.description = run.description.clone();
        }
        self.read.take(row.time_ns);
        let column = self.read.column(&self.length);
        if column != self.column {
            self.end_column();
            self.column = column;
        } else if self.piece.times_ns.len() >= PIECE {
            self.reduce();
        }
        self.piece.times_ns.push(row.time_ns);
        self.piece.values.extend(row.values.iter().take(self.piece.schema.width()));
    }

    /// Takes rows into the totals, and those out of the piece that nobody sees.
    fn reduce(&mut self) {
        let signals = Signals::new(&self.piece);
        let tracking = Tracking::new(&signals);
        let place = MapSeries::of(&signals, &tracking);
        self.totals.add(&signals, &tracking, place.as_ref(), self.counted);
        // Where there are few rows, each is drawn.
        if self.length.rows > 2 * COLUMNS {
            let is_seen = seen(&self.piece, &signals, &tracking, place.as_ref());
            keep(&mut self.piece, &is_seen);
        }
        self.counted = self.piece.times_ns.len();
    }

    fn end_column(&mut self) {
        if !self.piece.times_ns.is_empty() {
            self.reduce();
        }
        self.seen.times_ns.append(&mut self.piece.times_ns);
        self.seen.values.append(&mut self.piece.values);
        self.counted = 0;
    }

    /// What was read otherwise comes without rows.
    fn finish(mut self, read: RecordedRun) -> Digest {
        self.end_column();
        let RecordedRun { times_ns, values, .. } = self.seen;
        let schema = if self.read.rows == 0 { read.schema.clone() } else { self.piece.schema };
        Digest { run: RecordedRun { schema, times_ns, values, ..read }, planned: None, totals: self.totals }
    }
}

/// Leaves out the rows that aren't seen.
fn keep(piece: &mut RecordedRun, is_seen: &[bool]) {
    let width = piece.schema.width();
    let seen = is_seen.iter().enumerate().filter(|(_, seen)| **seen);
    let mut left = 0;
    for (row, _) in seen {
        piece.times_ns[left] = piece.times_ns[row];
        piece.values.copy_within(row * width..(row + 1) * width, left * width);
        left += 1;
    }
    piece.times_ns.truncate(left);
    piece.values.truncate(left * width);
}

/// Which rows of a column are seen.
fn seen(
    piece: &RecordedRun,
    signals: &Signals<'_>,
    tracking: &Tracking,
    place: Option<&MapSeries>,
) -> Vec<bool> {
    let rows = signals.times_s.len();
    let mut is_seen = vec![false; rows];
    let Some(last) = rows.checked_sub(1) else { return is_seen };
    (is_seen[0], is_seen[last]) = (true, true);
    see_values(piece, &mut is_seen);
    let speeds = Speeds::of(signals, tracking);
    let speeds = [speeds.believed, speeds.truth].into_iter().flatten().flat_map(|[x, y, _]| [x, y]);
    speeds.for_each(|values| see_ends(&values, &mut is_seen));
    for error in [&tracking.believed_error, &tracking.true_error].into_iter().flatten() {
        for values in [&error.distance, &error.along, &error.across, &error.heading] {
            see_ends(values, &mut is_seen);
        }
    }
    if let Some(place) = place {
        see_ends(&place.known_m, &mut is_seen);
        for off in [&place.truth, &place.odom].into_iter().flatten() {
            see_ends(&off.distance_m, &mut is_seen);
            see_ends(&off.turned_rad, &mut is_seen);
        }
    }
    for poses in [&tracking.planned, &tracking.believed, &tracking.truth].into_iter().flatten() {
        let path = poses.x.iter().copied().zip(poses.y.iter().copied());
        for row in curve::corners(path, MOST_CORNERS, STRAIGHT_M) {
            is_seen[row] = true;
        }
    }
    is_seen
}

/// Sees the least and the greatest value, as [`curve::envelope`] does.
fn see_ends(values: &[f64], is_seen: &mut [bool]) {
    let finite = || values.iter().enumerate().filter(|(_, value)| value.is_finite());
    let least = finite().min_by(|one, other| one.1.total_cmp(other.1));
    // Of equal ones the first.
    let greatest = finite().rev().max_by(|one, other| one.1.total_cmp(other.1));
    for (row, _) in least.into_iter().chain(greatest) {
        is_seen[row] = true;
    }
}

/// Sees the least and the greatest of each signal, and the rows on both sides of a change of a code.
fn see_values(piece: &RecordedRun, is_seen: &mut [bool]) {
    #[derive(Clone, Copy)]
    struct Ends {
        least: (f64, usize),
        greatest: (f64, usize),
        before: f64,
        changes: u32,
    }
    let is_code = |value: f64| value.fract() == 0.0 && (0.0..=GREATEST_CODE).contains(&value);
    let width = piece.schema.width();
    let none =
        Ends { least: (f64::INFINITY, 0), greatest: (f64::NEG_INFINITY, 0), before: f64::NAN, changes: 0 };
    let mut all = vec![none; width];
    for (row, values) in piece.values.chunks_exact(width.max(1)).take(is_seen.len()).enumerate() {
        for (ends, &value) in all.iter_mut().zip(values) {
            if value < ends.least.0 && value.is_finite() {
                ends.least = (value, row);
            }
            if value > ends.greatest.0 && value.is_finite() {
                ends.greatest = (value, row);
            }
            let before = std::mem::replace(&mut ends.before, value);
            if value != before
                && ends.changes < MOST_CHANGES
                && (is_code(value) || is_code(before))
                && row > 0
            {
                ends.changes += 1;
                (is_seen[row - 1], is_seen[row]) = (true, true);
            }
        }
    }
    for ends in all {
        for (value, row) in [ends.least, ends.greatest] {
            is_seen[row] |= value.is_finite();
        }
    }
}
