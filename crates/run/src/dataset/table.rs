//! A run from a table of text with a head: what other robots recorded, and other programs wrote.
//!
//! | column | what |
//! |---|---|
//! | `time_s` | when the row's wheels were read, rising; they count from the first row |
//! | `wheel_1_rad`, `wheel_2_rad`, … | the angle of each wheel, counted on over whole turns |
//! | `gyro_rad_s` | a gyro's rate, to the left |
//! | `pose_x_m`, `pose_y_m`, `pose_heading_rad` | where a sensor was, in its own world |
//! | `pose_time_s` | when, as the sensor says; without it the row's time |
//! | `pose_sigma_m`, `pose_sigma_rad` | how well; without them 1 mm and 3 mrad |
//!
//! An empty cell wasn't measured then. A row may hold a pose without wheels, and the other way round. Columns of other names
//! are left alone.

use omnibase_calibrate::rehearsal::PoseSensor;
use omnibase_calibrate::{PoseSample, Run, Step, TurnSample};
use omnibase_platform::{PerWheel, Pose2};

/// Why a table is no run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableError {
    /// Nothing in it.
    #[error(
        "line 1: expected names of columns, as time_s,wheel_1_rad,wheel_2_rad,wheel_3_rad, found nothing"
    )]
    Empty,
    /// A column that is needed isn't there.
    #[error("line 1: no column `{column}`, expected {why}; found {found}")]
    NoColumn {
        /// Which.
        column: String,
        /// What for.
        why: &'static str,
        /// Those that are there.
        found: String,
    },
    /// Two columns of one name.
    #[error("line 1: two columns are called `{column}`")]
    Twice {
        /// Which.
        column: String,
    },
    /// More or fewer cells than columns.
    #[error("line {line}: {found} cells, expected {expected} as in line 1")]
    Cells {
        /// Which line, from 1.
        line: usize,
        /// As many as there are names.
        expected: usize,
        /// What was found.
        found: usize,
    },
    /// A cell that is no number.
    #[error("line {line}, {column}: `{found}`, expected a finite number, or nothing")]
    NotANumber {
        /// Which line, from 1.
        line: usize,
        /// Which column.
        column: String,
        /// What was found.
        found: String,
    },
    /// A row without a time.
    #[error("line {line}, time_s: nothing, expected when the row was measured")]
    NoTime {
        /// Which line, from 1.
        line: usize,
    },
    /// Some wheels alone.
    #[error("line {line}, {column}: nothing, expected an angle as other wheels of the line have one")]
    SomeWheels {
        /// Which line, from 1.
        line: usize,
        /// The wheel that lacks.
        column: String,
    },
}

/// A table's columns by name, and its rows.
struct Table {
    names: Vec<String>,
    /// Each with its line, from 1.
    rows: Vec<(usize, Vec<Option<f64>>)>,
}

impl Table {
    fn read(text: &str) -> Result<Table, TableError> {
        // A mark of the order of bytes, as spreadsheets write it, is none of the first name's.
        let mut lines = text.trim_start_matches('\u{feff}').lines().enumerate();
        let Some((_, head)) = lines.find(|(_, line)| !line.trim().is_empty()) else {
            return Err(TableError::Empty);
        };
        let names: Vec<String> = cells(head).map(str::to_owned).collect();
        let twice = names.iter().enumerate().find(|(at, name)| names[..*at].contains(name));
        if let Some((_, column)) = twice {
            return Err(TableError::Twice { column: column.clone() });
        }
        let mut rows = Vec::new();
        for (number, text) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            let (line, expected, found) = (number + 1, names.len(), cells(text).count());
            if found != expected {
                return Err(TableError::Cells { line, expected, found });
            }
            let numbers = cells(text).zip(&names).map(|(cell, column)| match cell {
                "" => Ok(None),
                // Other programs' columns may hold anything.
                _ if !is_known(column) => Ok(None),
                cell => match cell.parse::<f64>().ok().filter(|value| value.is_finite()) {
                    Some(value) => Ok(Some(value)),
                    None => {
                        Err(TableError::NotANumber { line, column: column.clone(), found: cell.to_owned() })
                    }
                },
            });
            rows.push((line, numbers.collect::<Result<_, _>>()?));
        }
        Ok(Table { names, rows })
    }

    fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|column| column == name)
    }

    fn needed(&self, name: &str, why: &'static str) -> Result<usize, TableError> {
        let found = || self.names.join(", ");
        self.column(name).ok_or_else(|| TableError::NoColumn { column: name.to_owned(), why, found: found() })
    }
}

fn cells(line: &str) -> impl Iterator<Item = &str> {
    line.split([',', ';', '\t']).map(|cell| cell.trim().trim_matches('"'))
}

fn is_known(column: &str) -> bool {
    matches!(
        column,
        "time_s"
            | "gyro_rad_s"
            | "pose_x_m"
            | "pose_y_m"
            | "pose_heading_rad"
            | "pose_time_s"
            | "pose_sigma_m"
            | "pose_sigma_rad"
    ) || column.starts_with("wheel_")
}

/// The run of a table, for a robot with so many wheels.
pub fn run_of_table(text: &str, wheels: usize, name: &str) -> Result<Run, TableError> {
    let table = Table::read(text)?;
    let time = table.needed("time_s", "when each row was measured")?;
    let of_wheel = |wheel: usize| table.needed(&format!("wheel_{wheel}_rad"), "the angle of each wheel");
    let wheel_columns: Vec<usize> = (1..=wheels).map(of_wheel).collect::<Result<_, _>>()?;
    let [gyro, x, y, heading, stated, sigma_m, sigma_rad] = [
        "gyro_rad_s",
        "pose_x_m",
        "pose_y_m",
        "pose_heading_rad",
        "pose_time_s",
        "pose_sigma_m",
        "pose_sigma_rad",
    ]
    .map(|name| table.column(name));
    let mut run = Run { name: name.to_owned(), ..Run::default() };
    let mut before: Option<PerWheel> = None;
    // Of seconds since 1970 a number has no more than some 0.2 us.
    let first_s = table.rows.first().and_then(|(_, row)| row[time]).unwrap_or(0.0);
    for (line, row) in &table.rows {
        let cell = |column: Option<usize>| column.and_then(|column| row[column]);
        let time_s = row[time].ok_or(TableError::NoTime { line: *line })? - first_s;
        let angles: Vec<f64> = wheel_columns.iter().filter_map(|column| row[*column]).collect();
        if angles.len() == wheels {
            let angles = PerWheel::from_fn(wheels, |wheel| angles[wheel]);
            match &before {
                Some(before) => run.steps.push(Step {
                    end_s: time_s,
                    turned_rad: PerWheel::from_fn(wheels, |wheel| angles[wheel] - before[wheel]),
                }),
                None => run.begin_s = time_s,
            }
            before = Some(angles);
        } else if !angles.is_empty() {
            let missing = wheel_columns.iter().find(|column| row[**column].is_none());
            let column = missing.map(|column| table.names[*column].clone()).unwrap_or_default();
            return Err(TableError::SomeWheels { line: *line, column });
        }
        if let Some(rate_rad_s) = cell(gyro) {
            run.turns.push(TurnSample { instant_s: time_s, rate_rad_s });
        }
        if let (Some(x_m), Some(y_m)) = (cell(x), cell(y)) {
            let ready = PoseSensor::default();
            let heading_rad = cell(heading);
            run.poses.push(PoseSample {
                instant_s: cell(stated).map_or(time_s, |stated_s| stated_s - first_s),
                world_from_sensor: Pose2::new(x_m, y_m, heading_rad.unwrap_or(0.0)),
                sigma_m: cell(sigma_m).unwrap_or(ready.sigma_m),
                sigma_rad: match heading_rad {
                    Some(_) => cell(sigma_rad).unwrap_or(ready.sigma_rad),
                    None => f64::INFINITY,
                },
            });
        }
    }
    Ok(run)
}

/// The first place where a wheel turns faster than it can, in words.
pub fn too_fast(text: &str, wheels: usize, most_rad_s: f64) -> Result<Option<String>, TableError> {
    let table = Table::read(text)?;
    let time = table.needed("time_s", "when each row was measured")?;
    for wheel in 1..=wheels {
        let name = format!("wheel_{wheel}_rad");
        let column = table.needed(&name, "the angle of each wheel")?;
        let mut before: Option<[f64; 2]> = None;
        for (line, row) in &table.rows {
            let (Some(time_s), Some(angle_rad)) = (row[time], row[column]) else { continue };
            if let Some([from_s, from_rad]) = before.replace([time_s, angle_rad]) {
                let rad_s = (angle_rad - from_rad).abs() / (time_s - from_s);
                if time_s > from_s && rad_s > most_rad_s {
                    return Ok(Some(format!(
                        "line {line}, {name}: it turned at {rad_s:.0} rad/s, and limits.wheel_speed_rad_s is {most_rad_s}: \
                         is it counted on over whole turns, and in radians?"
                    )));
                }
            }
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "time_s,wheel_1_rad,wheel_2_rad,wheel_3_rad,gyro_rad_s,pose_x_m,pose_y_m,pose_heading_rad,note\n\
                        0.0,0,0,0,0.1,,,,begin\n0.1,0.5,0.25,0,,1.5,-2,0.3,\n\n0.2,1.0,0.5,-1,0.2,1.6,-2,,\n0.25,,,,,1.7,-2,0.3,x\n";

    #[test]
    fn a_table_is_read_as_it_says() {
        let run = run_of_table(TEXT, 3, "other").unwrap();
        assert_eq!((run.begin_s, run.steps.len(), run.turns.len(), run.poses.len()), (0.0, 2, 2, 3));
        assert_eq!(run.steps[1].turned_rad[..], [0.5, 0.25, -1.0]);
        assert_eq!((run.poses[0].sigma_m, run.poses[0].sigma_rad), (1e-3, 3e-3));
        assert_eq!(run.poses[1].sigma_rad, f64::INFINITY);
        assert_eq!(run.poses[2].instant_s, 0.25);
        let semicolons = TEXT.replace(',', ";");
        assert_eq!(run_of_table(&semicolons, 3, "other"), Ok(run));
    }

    #[test]
    fn times_count_from_the_first_row() {
        let table = |from_s: f64| {
            let rows = (0..3).map(|n| format!("{:.2},0,0,{n},0,{n},0\n", from_s + 0.01 * f64::from(n)));
            let head = "time_s,wheel_1_rad,wheel_2_rad,wheel_3_rad,gyro_rad_s,pose_x_m,pose_y_m\n";
            run_of_table(&(head.to_owned() + &rows.collect::<String>()), 3, "other").unwrap()
        };
        let (early, late) = (table(0.0), table(1.7e9));
        assert_eq!((late.begin_s, late.turns[0].instant_s, late.poses[0].instant_s), (0.0, 0.0, 0.0));
        assert!((late.steps[1].end_s - early.steps[1].end_s).abs() < 1e-6, "{late:?}");
    }

    #[test]
    fn a_wheel_that_turns_faster_than_it_can_is_told_with_its_first_line() {
        assert_eq!(too_fast(TEXT, 3, 15.0), Ok(None));
        let wrapped = TEXT.replace("0.5,-1", "-5.78,-1");
        let words = too_fast(&wrapped, 3, 15.0).unwrap().unwrap();
        assert!(words.starts_with("line 5, wheel_2_rad: it turned at 60 rad/s"), "{words}");
    }

    #[test]
    fn mistakes_have_their_line_and_column() {
        let words = |text: &str| run_of_table(text, 3, "other").unwrap_err().to_string();
        for (text, expected) in [
            (String::new(), "line 1: expected names of columns, as time_s,"),
            (
                TEXT.replace("wheel_3_rad", "wheel_4"),
                "line 1: no column `wheel_3_rad`, expected the angle of each wheel; found time_s, ",
            ),
            (TEXT.replace("pose_y_m", "pose_x_m"), "line 1: two columns are called `pose_x_m`"),
            (TEXT.replace("0.25,0,,", "0.25,0,"), "line 3: 8 cells, expected 9 as in line 1"),
            (
                TEXT.replace("0.5,0.25", "0.5,nan"),
                "line 3, wheel_2_rad: `nan`, expected a finite number, or nothing",
            ),
            (TEXT.replace("0.2,1.0", ",1.0"), "line 5, time_s: nothing, expected when the row was measured"),
            (
                TEXT.replace("0.5,-1", "0.5,"),
                "line 5, wheel_3_rad: nothing, expected an angle as other wheels of the line have one",
            ),
        ] {
            assert!(words(&text).starts_with(expected), "{}", words(&text));
        }
    }
}
