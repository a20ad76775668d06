//! What a disc sees: whether it gets straight from one place to another.

use super::Search;

/// Behind a border by this, in cells, one is in the next square; in a very long map less could be rounded away.
const INSIDE: f32 = 1e-3;
/// From any place of a square between centres to its first corner, at most, in cells.
const BESIDE: f32 = 1.5;
/// With so much more room than the disc needs squares needn't be looked at one by one, in cells.
const FAR: f32 = 3.0;

/// From this radius on, in cells, the room between two centres is nearly what is drawn straight from one to the other.
const BENT: f32 = 2.0;

/// One coordinate along a straight way.
#[derive(Clone, Copy)]
struct Along {
    from: f32,
    rate: f32,
    /// Infinite where it doesn't move.
    per_rate: f32,
    /// From where it is to what is cut to the lower centre.
    inside: f32,
    /// Whether it goes along a line of centres, which then are all that it needs.
    is_still: bool,
}

impl Along {
    fn new(from: f32, rate: f32) -> Self {
        let moves = rate.abs() >= 1e-6;
        let is_still = !moves && from.fract() == 0.0;
        let inside = if is_still { 0.5 } else { INSIDE.copysign(rate) };
        Along { from, rate, per_rate: if moves { 1.0 / rate } else { f32::INFINITY }, inside, is_still }
    }

    /// The lower one of the centres between which it is. A cast cuts as `floor` does where nothing is negative, and is no call.
    #[inline]
    fn first(&self, done: f32) -> usize {
        let at = self.from + done * self.rate + self.inside;
        if at > 0.0 { at as i32 as usize } else { 0 }
    }

    /// How far the way goes until it leaves a square that begins with this centre.
    #[inline]
    fn leaves(&self, low: usize) -> f32 {
        let end = if self.rate > 0.0 { low + 1 } else { low };
        if self.per_rate == f32::INFINITY { f32::INFINITY } else { (end as f32 - self.from) * self.per_rate }
    }

    /// Where it is between two centres, the lower of which is given: 0 to 1.
    fn part(&self, low: usize, done: f32) -> f32 {
        (self.from + done * self.rate - low as f32).clamp(0.0, 1.0)
    }
}

impl Search<'_> {
    /// Whether the disc gets straight from one cell's place to another's.
    pub fn sees(&self, from: usize, to: usize) -> bool {
        let ([x, y], [x_to, y_to]) = (self.place(from), self.place(to));
        let (dx, dy) = (x_to - x, y_to - y);
        let length = (dx * dx + dy * dy).sqrt();
        if length <= 0.0 {
            return self.takes(from);
        }
        let (across, along) = (Along::new(x, dx / length), Along::new(y, dy / length));
        let mut done = 0.0_f32;
        while done < length - INSIDE {
            // The square between four centres that is being crossed.
            let (column, row) = (across.first(done), along.first(done));
            let low = row * self.width + column;
            let spare = self.clearance[low] - self.radius;
            if spare >= FAR + self.barred {
                done += spare - self.barred - BESIDE;
                continue;
            }
            let above = if along.is_still { 0 } else { self.width };
            let beside = usize::from(!across.is_still);
            let high = low + above;
            let is_open = spare >= 0.0
                && self.is_open(low + beside)
                && self.is_open(high)
                && self.is_open(high + beside);
            let (leaves, other) = (across.leaves(column), along.leaves(row));
            let (leaves, is_across) = if leaves < other { (leaves, true) } else { (other, false) };
            if !is_open {
                let corners = [[low, low + beside], [high, high + beside]];
                let border = if leaves >= length {
                    None
                } else if is_across {
                    let right = usize::from(across.rate > 0.0);
                    Some(Border { ends: corners.map(|row| row[right]), part: along.part(row, leaves) })
                } else {
                    let upper = usize::from(along.rate > 0.0);
                    Some(Border { ends: corners[upper], part: across.part(column, leaves) })
                };
                if !self.is_free_in_square(corners, border) {
                    return false;
                }
            }
            let least = done + INSIDE;
            done = if leaves > least { leaves } else { least };
        }
        self.takes(to)
    }

    /// Whether the disc gets through a square between four centres, not all of which are known to be open, from where it got into it to where it
    /// leaves it; without that the way ends in it.
    ///
    /// The room of one thing in the way, from a distance r on, is bent by at most 1/r: between two centres it is less than what is drawn
    /// straight from one to the other by at most 1/(8 r).
    fn is_free_in_square(&self, corners: [[usize; 2]; 2], leaves: Option<Border>) -> bool {
        if corners.as_flattened().iter().all(|corner| self.room(*corner) >= self.radius) {
            return true;
        }
        if self.radius < BENT {
            return false;
        }
        let Some(Border { ends, part }) = leaves else { return true };
        let [first, last] = ends.map(|end| self.room(end));
        first + part * (last - first) >= self.radius + 0.125 / (self.radius - 1.0)
    }
}

/// A place on a square's border.
struct Border {
    /// The centres between which it lies.
    ends: [usize; 2],
    /// In which part of the way from the first to the second.
    part: f32,
}
