//! A map's occupied cells as few rectangles, for pictures.

use omnibase_platform::Pose2;

use super::Map;
use crate::Point;

impl Map {
    /// The corners of rectangles that together are all occupied cells, in the map's frame, m: at most so many, for which cells are joined
    /// to larger ones where one of them is occupied.
    pub fn rectangles(&self, most: usize) -> Vec<[Point; 4]> {
        let mut joined = 1;
        loop {
            let found = self.joined(joined);
            if found.len() <= most.max(1) {
                let corner = |[x, y]: [usize; 2]| {
                    let [x, y] = [x.min(self.width), y.min(self.height)].map(|at| at as f64 * self.cell_m);
                    let at = self.map_from_grid.then(Pose2::new(x, y, 0.0));
                    [at.x_m, at.y_m]
                };
                let corners = |[[left, right], [low, high]]: [[usize; 2]; 2]| {
                    [[left, low], [right, low], [right, high], [left, high]]
                        .map(|place| corner(place.map(|at| at * joined)))
                };
                return found.into_iter().map(corners).collect();
            }
            joined *= 2;
        }
    }

    /// Columns and rows of rectangles in squares of so many cells: runs of a row, joined with equal ones below them.
    fn joined(&self, cells: usize) -> Vec<[[usize; 2]; 2]> {
        let (width, height) = (self.width.div_ceil(cells), self.height.div_ceil(cells));
        let is_blocked = |column: usize, row: usize| {
            let rows = row * cells..((row + 1) * cells).min(self.height);
            let columns = column * cells..((column + 1) * cells).min(self.width);
            rows.into_iter().any(|row| {
                self.blocked[row * self.width + columns.start..row * self.width + columns.end].contains(&true)
            })
        };
        let (mut done, mut open) = (Vec::new(), Vec::<[[usize; 2]; 2]>::new());
        for row in 0..height {
            let mut column = 0;
            let mut runs = Vec::new();
            while column < width {
                let begin = column;
                while column < width && is_blocked(column, row) {
                    column += 1;
                }
                if column > begin {
                    runs.push([begin, column]);
                }
                column += 1;
            }
            let (goes_on, ends): (Vec<_>, Vec<_>) = open.into_iter().partition(|[run, _]| runs.contains(run));
            done.extend(ends);
            open = goes_on;
            for run in runs {
                match open.iter_mut().find(|[other, _]| *other == run) {
                    Some([_, rows]) => rows[1] = row + 1,
                    None => open.push([run, [row, row + 1]]),
                }
            }
        }
        done.extend(open);
        done
    }
}
