//! From every cell to the nearest occupied one: exact, by lower envelopes of parabolas, in linear time.
//!
//! Source: Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions (2012); the sums are whole numbers, so
//! there is no rounding before the root.

/// Where there is no occupied cell at all.
pub const NONE: f64 = f64::INFINITY;

/// Between which places of two cells is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// From centre to centre, as `scipy.ndimage.distance_transform_edt` does.
    Centres,
    /// From a centre to the nearest place of the occupied square.
    CentreAndSquare,
}

/// The squares of the distances, in cells, row by row.
pub fn squares(blocked: &[bool], width: usize, between: Between) -> Vec<f64> {
    let height = blocked.len() / width.max(1);
    let mut columns = column_distances(blocked, width, height, between);
    let mut envelope = Envelope::new(width + 1);
    let mut row_before = vec![0.0; width];
    for row in columns.chunks_exact_mut(width) {
        row_before.copy_from_slice(row);
        envelope.clear();
        match between {
            Between::Centres => {
                row_before.iter().enumerate().for_each(|(at, height)| envelope.add(at as f64, *height));
            }
            // Squares side by side share a side: the lower one has it.
            Between::CentreAndSquare => {
                let mut before = NONE;
                for (at, height) in row_before.iter().copied().chain([NONE]).enumerate() {
                    envelope.add(at as f64 - 0.5, height.min(before));
                    before = height;
                }
            }
        }
        envelope.write(row);
        if between == Between::CentreAndSquare {
            // Within its own column a square begins at once.
            row.iter_mut().zip(&row_before).for_each(|(least, own)| *least = least.min(*own));
        }
    }
    columns
}

/// The squares of the distances within each column.
fn column_distances(blocked: &[bool], width: usize, height: usize, between: Between) -> Vec<f64> {
    let mut steps: Vec<u32> = vec![u32::MAX; blocked.len()];
    let rows = (0..height).chain((0..height).rev());
    let mut carried = vec![u32::MAX; width];
    for (number, row) in rows.enumerate() {
        if number == height {
            // What was carried upwards counts for nobody below.
            carried.fill(u32::MAX);
        }
        let range = row * width..(row + 1) * width;
        let cells = steps[range.clone()].iter_mut().zip(&blocked[range]);
        for ((steps, blocked), carried) in cells.zip(&mut carried) {
            *carried = if *blocked { 0 } else { carried.saturating_add(1) };
            *steps = (*steps).min(*carried);
        }
    }
    let square = |steps: u32| match (steps, between) {
        (u32::MAX, _) => NONE,
        (0, _) => 0.0,
        (steps, Between::Centres) => f64::from(steps) * f64::from(steps),
        (steps, Between::CentreAndSquare) => (f64::from(steps) - 0.5).powi(2),
    };
    steps.into_iter().map(square).collect()
}

/// Parabolas (x − p)² + height, and where each of them is the lowest.
struct Envelope {
    places: Vec<f64>,
    heights: Vec<f64>,
    begins: Vec<f64>,
}

impl Envelope {
    fn new(most: usize) -> Self {
        let list = || Vec::with_capacity(most);
        Envelope { places: list(), heights: list(), begins: list() }
    }

    fn clear(&mut self) {
        self.places.clear();
        self.heights.clear();
        self.begins.clear();
    }

    /// Adds one to the right of all others.
    fn add(&mut self, place: f64, height: f64) {
        if height == NONE {
            return;
        }
        let mut begin = f64::NEG_INFINITY;
        while let (Some(other), Some(other_height), Some(other_begin)) =
            (self.places.last(), self.heights.last(), self.begins.last())
        {
            let meet = ((height + place * place) - (other_height + other * other)) / (2.0 * (place - other));
            if meet > *other_begin {
                begin = meet;
                break;
            }
            self.places.pop();
            self.heights.pop();
            self.begins.pop();
        }
        self.places.push(place);
        self.heights.push(height);
        self.begins.push(begin);
    }

    fn write(&self, row: &mut [f64]) {
        let mut at = 0;
        for (x, least) in row.iter_mut().enumerate() {
            let x = x as f64;
            while self.begins.get(at + 1).is_some_and(|begin| *begin <= x) {
                at += 1;
            }
            *least = match (self.places.get(at), self.heights.get(at)) {
                (Some(place), Some(height)) => (x - place) * (x - place) + height,
                _ => NONE,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_distance_is_the_least_of_all_occupied_cells() {
        let mut state = 5_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        for (width, height, share) in
            [(1, 1, 1), (1, 9, 3), (17, 1, 4), (23, 19, 2), (40, 31, 50), (12, 12, 1_000_000)]
        {
            let blocked: Vec<bool> = (0..width * height).map(|_| next() % share == 0).collect();
            for between in [Between::Centres, Between::CentreAndSquare] {
                let found = squares(&blocked, width, between);
                for (at, found) in found.iter().enumerate() {
                    let off = |a: usize, b: usize| match (a.abs_diff(b) as f64, between) {
                        (0.0, _) => 0.0,
                        (off, Between::Centres) => off,
                        (off, Between::CentreAndSquare) => off - 0.5,
                    };
                    let to =
                        |to: usize| off(at % width, to % width).powi(2) + off(at / width, to / width).powi(2);
                    let least = (0..blocked.len()).filter(|to| blocked[*to]).map(to).fold(NONE, f64::min);
                    assert_eq!(*found, least, "{width} by {height}, {between:?}, cell {at}");
                }
            }
        }
    }
}
