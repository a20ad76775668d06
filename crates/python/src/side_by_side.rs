//! Many simulated robots of one file, on all processors.

use std::path::PathBuf;
use std::sync::Mutex;

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, rows};
use crate::failure::Failure;
use crate::robot_file::Wanted;
use crate::simulated::{REGISTRY, Simulated, frame};

/// Cycles of all robots between two looks whether somebody pressed Ctrl-C: a second or two.
const PIECE: usize = 200_000;

/// Many simulated robots, each on a virtual time of its own.
#[pyclass(frozen, module = "omnibase")]
pub struct Simulations {
    robots: Mutex<Vec<Simulated>>,
    count: usize,
    threads: usize,
    cycle_s: f64,
}

impl Simulations {
    /// Does something with every robot, on all threads; the first failure counts, after all were done.
    fn each<T: Send>(
        &self,
        py: Python<'_>,
        work: impl Fn(usize, &mut Simulated) -> Result<T, Failure> + Sync + Send,
    ) -> PyResult<Vec<T>> {
        let all = py.detach(|| {
            let mut robots = self.robots.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            on_threads(self.threads, &mut robots, work)
        });
        Ok(all.into_iter().collect::<Result<Vec<T>, Failure>>()?)
    }
}

/// Work on every item, the items shared out among threads; results in the items' order.
fn on_threads<I: Send, T: Send>(
    threads: usize,
    items: &mut [I],
    work: impl Fn(usize, &mut I) -> Result<T, Failure> + Sync,
) -> Vec<Result<T, Failure>> {
    let share = items.len().div_ceil(threads).max(1);
    let work = &work;
    std::thread::scope(|scope| {
        let of_thread = |(number, items): (usize, &mut [I])| -> Vec<Result<T, Failure>> {
            let first = number * share;
            items.iter_mut().enumerate().map(|(at, item)| work(first + at, item)).collect()
        };
        let started: Vec<_> =
            items.chunks_mut(share).enumerate().map(|share| scope.spawn(move || of_thread(share))).collect();
        let ended = started.into_iter().map(|thread| {
            thread.join().unwrap_or_else(|_| vec![Err(Failure::of("a thread of the simulation died"))])
        });
        ended.flatten().collect()
    })
}

#[pymethods]
impl Simulations {
    #[new]
    #[pyo3(signature = (robot, count, *, path=None, reference=None, settings=None, threads=None))]
    fn new(
        py: Python<'_>,
        robot: PathBuf,
        count: usize,
        path: Option<PathBuf>,
        reference: Option<&Bound<'_, PyDict>>,
        settings: Option<&Bound<'_, PyDict>>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let wanted = Wanted::new(robot, path, reference, settings)?;
        if count == 0 || threads == Some(0) {
            return Err(Failure::of("count and threads: expected at least 1, found 0").into());
        }
        let threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
        let begun = py.detach(|| {
            let (plan, leader) = wanted.load(&REGISTRY)?;
            let begin = |_, _: &mut ()| Simulated::begin(plan.clone(), leader.into());
            let begun = on_threads(threads, &mut vec![(); count], begin);
            begun.into_iter().collect::<Result<Vec<_>, Failure>>()
        })?;
        let cycle_s = begun.first().map_or(f64::NAN, Simulated::cycle_s);
        Ok(Simulations { robots: Mutex::new(begun), count, threads, cycle_s })
    }

    fn __len__(&self) -> usize {
        self.count
    }

    /// Begins again with these robots, or all of them.
    #[pyo3(signature = (robots=None))]
    fn reset(&self, py: Python<'_>, robots: Option<Vec<usize>>) -> PyResult<()> {
        if let Some(wrong) = robots.iter().flatten().find(|robot| **robot >= self.count) {
            let words = format!("reset: expected robots from 0 to {}, found {wrong}", self.count - 1);
            return Err(Failure::Broken(words).into());
        }
        let is_meant = |number: usize| robots.as_ref().is_none_or(|robots| robots.contains(&number));
        self.each(py, |number, robot| if is_meant(number) { robot.begin_again() } else { Ok(()) })?;
        Ok(())
    }

    /// Enables these robots, or all of them.
    #[pyo3(signature = (robots=None))]
    fn enable(&self, py: Python<'_>, robots: Option<Vec<usize>>) -> PyResult<()> {
        let is_meant = |number: usize| robots.as_ref().is_none_or(|robots| robots.contains(&number));
        self.each(py, |number, robot| if is_meant(number) { robot.enable() } else { Ok(()) })?;
        Ok(())
    }

    /// Holds each at the twist of its row from the next cycle on.
    #[pyo3(signature = (twists, frame="body"))]
    fn drive(&self, py: Python<'_>, twists: &Bound<'_, PyAny>, frame: &str) -> PyResult<()> {
        let frame = self::frame(frame)?;
        let twists = rows::<3>(twists, "twists", self.count)?;
        self.each(py, |number, robot| {
            robot.drive(twists[number], frame);
            Ok(())
        })?;
        Ok(())
    }

    /// So many cycles of every robot; whether each is still held at its twist, or needs none.
    #[pyo3(signature = (cycles=1))]
    fn step(&self, py: Python<'_>, cycles: usize) -> PyResult<Vec<bool>> {
        let mut good = vec![true; self.count];
        let mut left = cycles;
        while left > 0 {
            let piece = left.min((PIECE / self.count).max(1));
            let went = self.each(py, |_, robot| {
                let mut is_good = true;
                for _ in 0..piece {
                    match robot.step() {
                        Ok(()) => {}
                        Err(Failure::Refused(_)) => is_good = false,
                        Err(broken) => return Err(broken),
                    }
                }
                Ok(is_good)
            })?;
            good.iter_mut().zip(went).for_each(|(good, went)| *good &= went);
            left -= piece;
            py.check_signals()?;
        }
        Ok(good)
    }

    /// These signals of every robot's last cycle, a row a robot.
    fn values<'py>(&self, py: Python<'py>, signals: Vec<String>) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.each(py, |_, robot| {
            let mut row = Vec::new();
            robot.values(&robot.columns(&signals)?, &mut row);
            Ok(row)
        })?;
        let width = rows.first().map_or(0, Vec::len);
        array(py, &rows.concat(), &[self.count, width])
    }

    #[getter]
    fn cycle_s(&self) -> f64 {
        self.cycle_s
    }

    #[getter]
    fn signals(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let mut names = self.each(py, |number, robot| {
            Ok(if number == 0 { robot.stepped().schema().names().collect() } else { Vec::new() })
        })?;
        Ok(if names.is_empty() { Vec::new() } else { names.swap_remove(0) })
    }

    #[getter]
    fn phases(&self, py: Python<'_>) -> PyResult<Vec<&'static str>> {
        self.each(py, |_, robot| Ok(robot.phase().name()))
    }
}
