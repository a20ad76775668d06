//! All unknowns at once, by least squares over the whole of all runs.
//!
//! The platform's pose at each measurement is an unknown as well (a smoother over a graph; Dellaert and Kaess,
//! *Factor Graphs for Robot Perception*, 2017): from one to the next by the exact arcs of the wheels, within
//! what an uneven floor adds; each as the sensor saw it, or the tape; the turn between them as the gyro has it.
//!
//! Gauss and Newton's steps, each as long as it lowers the cost; Huber's weights (*Ann. Math. Statist.*
//! 35, 1964) for poses, so that a wild one counts little.

mod factors;

use nalgebra::{DMatrix, DVector, Vector3};
use omnibase_platform::{Kinematics, LayoutError, Pose2};

use crate::build::{Build, Tolerances};
use crate::chain::Shared;
use crate::creep::{self, Tread};
use crate::dataset::{Dataset, DatasetError, Run};
use crate::unknown::{Asked, Unknown, build_at, moved_frame};
use crate::way::{Displacement, Steps};
use factors::{Knots, Linear, Turned};

/// Steps at most: poses that count for less let each step take away but a share of what is left.
const MOST_STEPS: usize = 100;
/// A step's halves at most.
const MOST_HALVES: usize = 12;
/// How often the floor is looked at, each time with what was found so far.
const FLOORS: usize = 2;
/// Bounds of the floor's variances over what tolerances say, and how surely they are right: a factor of so much is one standard
/// deviation.
const UNEVENNESS: [f64; 2] = [1e-4, 1e3];
const UNEVENNESS_SIGMA: f64 = 100.0;
/// Looks of the search for it: golden sections.
const LOOKS: usize = 12;
/// A step that lowers the cost by no more than this is the last one: it changes nothing by more than a thirtieth of what is
/// uncertain about it.
const DONE: f64 = 1e-3;

/// Why nothing was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// Of the dataset.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Of the expected wheels, or those on the way to a solution.
    #[error("the wheels: {0}")]
    Layout(#[from] LayoutError),
    /// The equations have no solution.
    #[error("{run}: the equations can't be solved: a pose in it is tied to nothing")]
    Singular {
        /// Which run.
        run: String,
    },
    /// A tolerance that is none.
    #[error("the tolerance of {what} is {found}, expected a positive number")]
    Tolerance {
        /// Of which unknown.
        what: String,
        /// What was found.
        found: f64,
    },
    /// It went on and on.
    #[error(
        "no solution after {steps} steps: the last one still lowered the sum of squares by {lowered:.2e}"
    )]
    Endless {
        /// How many.
        steps: usize,
        /// By how much.
        lowered: f64,
    },
}

/// One unknown, found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Which.
    pub unknown: Unknown,
    /// By how much it differs from what was expected.
    pub amount: f64,
    /// Its standard deviation beforehand.
    pub sigma_before: f64,
    /// Its standard deviation now, wherever the base frame is in the body.
    pub sigma: f64,
    /// Its standard deviation where the base frame is held to the sensor of poses; without one, to all wheels together.
    pub sigma_held: f64,
}

impl Found {
    /// Whether the runs showed it: it is three times as well known as before.
    pub fn is_observed(&self) -> bool {
        self.sigma_told() < self.sigma_before / 3.0
    }

    /// The standard deviation that a person is told: where base is held, but for the sensor to which it is held.
    pub fn sigma_told(&self) -> f64 {
        match self.unknown {
            Unknown::SensorX | Unknown::SensorY | Unknown::SensorHeading => self.sigma,
            _ => self.sigma_held,
        }
    }
}

/// χ² per freedom of runs that don't fit what was said of them is above this.
pub const WORST_CHI_SQUARE: f64 = 4.0;
/// Or more poses than this part of them are in doubt.
pub const MOST_DOUBTED: f64 = 0.1;

/// Where the platform was in a run, as the solution has it.
#[derive(Clone, Debug, PartialEq)]
pub struct RunFit {
    /// When, s: instants of the wheels' clock.
    pub instants_s: Vec<f64>,
    /// Where its base was, in the sensor's world or on the floor.
    pub world_from_base: Vec<Pose2>,
    /// What each pose of the sensor is off by, in its own axes, over standard deviations; empty without poses.
    pub residuals: Vec<[f64; 3]>,
    /// Poses that count for less, for they are far off.
    pub doubted: usize,
    /// The gyro's bias, rad/s, where there is one.
    pub gyro_bias_rad_s: Option<f64>,
}

/// What came out.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The platform as it is.
    pub build: Build,
    /// Every unknown.
    pub found: Vec<Found>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// What the runs alone say of them: the information matrix without tolerances.
    pub information: DMatrix<f64>,
    /// How each run went.
    pub runs: Vec<RunFit>,
    /// Sum of squares of all residuals over their standard deviations; a doubted pose counts as one at the edge of doubt.
    pub chi_square: f64,
    /// Residuals less unknowns.
    pub freedoms: usize,
    /// Steps until then.
    pub steps: usize,
    /// How uneven the floor was: its variances over what tolerances said.
    pub unevenness: f64,
}

impl Solution {
    /// χ² per freedom: 1 where standard deviations are what they are said to be, less where the floor is better than that.
    pub fn reduced_chi_square(&self) -> f64 {
        self.chi_square / self.freedoms.max(1) as f64
    }

    /// Which part of all poses is in doubt.
    pub fn doubted(&self) -> f64 {
        let poses: usize = self.runs.iter().map(|run| run.residuals.len()).sum();
        let doubted: usize = self.runs.iter().map(|run| run.doubted).sum();
        doubted as f64 / poses.max(1) as f64
    }

    /// Whether the runs fit what was said of them: residuals are as great as they should be, and few poses are doubted.
    pub fn is_sound(&self) -> bool {
        self.reduced_chi_square() <= WORST_CHI_SQUARE && self.doubted() <= MOST_DOUBTED
    }

    /// One of the unknowns.
    pub fn of(&self, unknown: Unknown) -> Option<&Found> {
        self.found.iter().find(|found| found.unknown == unknown)
    }
}

/// A run with what is computed of it once.
pub(crate) struct Prepared<'a> {
    pub(crate) run: &'a Run,
    pub(crate) treads: Vec<Tread>,
    pub(crate) turned: Option<Turned>,
    pub(crate) knots: Knots,
    pub(crate) bias: Option<usize>,
}

/// What is solved for, at a moment.
#[derive(Clone)]
struct State {
    amounts: DVector<f64>,
    /// Poses of each run.
    poses: Vec<Vec<Pose2>>,
    /// Variances of the floor over what tolerances say.
    unevenness: f64,
}

/// A step of a state: of the unknowns, and of each run's poses, each in its own axes.
struct Stride {
    amounts: DVector<f64>,
    poses: Vec<Vec<Vector3<f64>>>,
}

/// A state with everything about it to first order.
struct Moment {
    linear: Linear,
    ways: Vec<Vec<Displacement>>,
}

/// Finds what a platform is really like, from what is expected of it and how well.
///
/// Expected is what its file says; amounts are found with the tolerances as what is known of them beforehand, so that what no run
/// shows stays as it is.
pub fn solve(dataset: &Dataset, expected: &Build, tolerances: &Tolerances) -> Result<Solution, SolveError> {
    let problem = LeastSquares::new(dataset, expected, tolerances)?;
    let mut state = problem.start()?;
    let mut steps = 0;
    for _ in 0..FLOORS {
        let moment;
        (state, moment) = problem.settled(state, &mut steps)?;
        state.unevenness = problem.likeliest_floor(&state, &moment.ways)?;
    }
    let (state, moment) = problem.settled(state, &mut steps)?;
    problem.solution(&state, &moment.linear, steps)
}

struct LeastSquares<'a> {
    expected: &'a Build,
    tolerances: &'a Tolerances,
    unknowns: Vec<Unknown>,
    sigmas: Vec<f64>,
    runs: Vec<Prepared<'a>>,
}

impl<'a> LeastSquares<'a> {
    fn new(
        dataset: &'a Dataset,
        expected: &'a Build,
        tolerances: &'a Tolerances,
    ) -> Result<LeastSquares<'a>, SolveError> {
        let kinematics = Kinematics::new(expected.wheels.clone())?;
        dataset.check(expected.wheels.len())?;
        let unknowns = Asked {
            wheels: expected.wheels.len(),
            runs: dataset.runs.len(),
            has_poses: dataset.runs.iter().any(|run| !run.poses.is_empty()),
            has_gyro: dataset.runs.iter().any(|run| run.turns.len() > 1),
            has_creep: tolerances.creep > 0.0,
        }
        .unknowns();
        let names: Vec<String> = expected.wheels.iter().map(|wheel| wheel.name.clone()).collect();
        let sigmas: Vec<f64> = unknowns.iter().map(|unknown| unknown.sigma(tolerances)).collect();
        let wrong = sigmas.iter().position(|sigma| !(sigma.is_finite() && *sigma > 0.0));
        if let Some(at) = wrong {
            return Err(SolveError::Tolerance { what: unknowns[at].words(&names), found: sigmas[at] });
        }
        let prepared = dataset.runs.iter().enumerate().map(|(number, run)| Prepared {
            run,
            treads: creep::treads(run, &kinematics, expected.roller_resistance),
            turned: Turned::of(run),
            knots: Knots::of(run, expected.sensor.delay_s),
            bias: unknowns.iter().position(|unknown| *unknown == Unknown::GyroBias(number)),
        });
        Ok(LeastSquares { expected, tolerances, sigmas, runs: prepared.collect(), unknowns })
    }

    fn start(&self) -> Result<State, SolveError> {
        let amounts = DVector::zeros(self.unknowns.len());
        let steps = Steps::new(self.expected, self.expected, &[])?;
        let poses = self.runs.iter().map(|run| factors::first_poses(run, &steps, self.expected));
        Ok(State { amounts, poses: poses.collect(), unevenness: 1.0 })
    }

    /// Steps from a state until one lowers the cost by next to nothing.
    fn settled(&self, mut state: State, number: &mut usize) -> Result<(State, Moment), SolveError> {
        let mut moment = self.moment(&state)?;
        let mut lowered = f64::INFINITY;
        for _ in 0..MOST_STEPS {
            *number += 1;
            let stride = self.step(&moment.linear)?;
            let (mut share, mut tried) = (1.0, 0);
            lowered = 0.0;
            while tried < MOST_HALVES {
                let next = state.moved(&stride, share);
                // Wheels of a step too long may be no layout.
                if let Ok(after) = self.moment(&next)
                    && after.linear.cost <= moment.linear.cost
                {
                    lowered = moment.linear.cost - after.linear.cost;
                    (state, moment) = (next, after);
                    break;
                }
                tried += 1;
                share *= 0.5;
            }
            if lowered < DONE {
                return Ok((state, moment));
            }
        }
        Err(SolveError::Endless { steps: *number, lowered })
    }

    fn moment(&self, state: &State) -> Result<Moment, SolveError> {
        let build = build_at(self.expected, &self.unknowns, &state.amounts);
        let steps = Steps::new(&build, self.expected, &self.unknowns)?;
        let ways = self
            .runs
            .iter()
            .map(|run| steps.ways(run.run, &run.treads, &run.knots.instants_s(build.sensor.delay_s)));
        let ways: Vec<Vec<Displacement>> = ways.collect();
        Ok(Moment { linear: self.linear(state, &build, &ways), ways })
    }

    fn linear(&self, state: &State, build: &Build, ways: &[Vec<Displacement>]) -> Linear {
        let count = self.unknowns.len();
        let mut linear =
            Linear::new(Shared { matrix: DMatrix::zeros(count, count), right: DVector::zeros(count) });
        for (at, sigma) in self.sigmas.iter().enumerate() {
            let weight = 1.0 / (sigma * sigma);
            linear.shared.matrix[(at, at)] += weight;
            linear.shared.right[at] -= weight * state.amounts[at];
            linear.cost += weight * state.amounts[at].powi(2);
        }
        linear.residuals += count;
        let view = factors::View {
            unevenness: state.unevenness,
            build,
            tolerances: self.tolerances,
            unknowns: &self.unknowns,
            amounts: &state.amounts,
        };
        for ((run, poses), ways) in self.runs.iter().zip(&state.poses).zip(ways) {
            linear.add(run, poses, ways, &view);
        }
        linear
    }

    /// How uneven the floor is: that with which all measurements are likeliest, whatever poses and unknowns are (their marginal
    /// likelihood, by Laplace: exact where all is linear).
    fn likeliest_floor(&self, state: &State, ways: &[Vec<Displacement>]) -> Result<f64, SolveError> {
        let build = build_at(self.expected, &self.unknowns, &state.amounts);
        let unlikely = |log: f64| -> Result<f64, SolveError> {
            let linear = self.linear(&State { unevenness: log.exp(), ..state.clone() }, &build, ways);
            let (shared, chains) = self.eliminated(&linear)?;
            let rest = shared.matrix.cholesky().ok_or_else(|| self.singular())?;
            let lowered: f64 = chains.iter().map(|chain| chain.lowered).sum();
            let log_determinant: f64 = chains.iter().map(|chain| chain.log_determinant).sum();
            let left = linear.cost - lowered - rest.solve(&shared.right).dot(&shared.right);
            let known = (log / UNEVENNESS_SIGMA.ln()).powi(2);
            Ok(left + log_determinant + 2.0 * rest.l().diagonal().map(f64::ln).sum() - linear.log_weight
                + known)
        };
        let [mut low, mut high] = UNEVENNESS.map(f64::ln);
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let inner = |low: f64, high: f64| [high - golden * (high - low), low + golden * (high - low)];
        let [mut a, mut b] = inner(low, high);
        let (mut at_a, mut at_b) = (unlikely(a)?, unlikely(b)?);
        for _ in 0..LOOKS {
            if at_a < at_b {
                (high, b, at_b) = (b, a, at_a);
                a = inner(low, high)[0];
                at_a = unlikely(a)?;
            } else {
                (low, a, at_a) = (a, b, at_b);
                b = inner(low, high)[1];
                at_b = unlikely(b)?;
            }
        }
        Ok((0.5 * (low + high)).exp())
    }

    fn singular(&self) -> SolveError {
        SolveError::Singular { run: self.runs.first().map(|run| run.run.name.clone()).unwrap_or_default() }
    }

    /// The step that would end at the least cost were everything linear.
    fn step(&self, linear: &Linear) -> Result<Stride, SolveError> {
        let (shared, chains) = self.eliminated(linear)?;
        let singular = || self.singular();
        let amounts = shared.matrix.cholesky().ok_or_else(singular)?.solve(&shared.right);
        let poses = chains.iter().map(|chain| chain.steps(&amounts)).collect();
        Ok(Stride { amounts, poses })
    }

    fn eliminated(&self, linear: &Linear) -> Result<(Shared, Vec<crate::chain::Eliminated>), SolveError> {
        let mut shared = linear.shared.clone();
        let mut chains = Vec::with_capacity(self.runs.len());
        for (run, chain) in self.runs.iter().zip(linear.chains()) {
            let eliminated = chain.eliminate(&mut shared);
            chains.push(eliminated.ok_or_else(|| SolveError::Singular { run: run.run.name.clone() })?);
        }
        Ok((shared, chains))
    }

    fn solution(&self, state: &State, linear: &Linear, steps: usize) -> Result<Solution, SolveError> {
        let singular = || self.singular();
        let (shared, _) = self.eliminated(linear)?;
        let count = self.unknowns.len();
        let freedoms =
            linear.residuals.saturating_sub(count + 3 * state.poses.iter().map(Vec::len).sum::<usize>());
        // Where residuals are greater than they should be, so are the errors; where they are smaller, luck isn't counted on.
        let chi_square = linear.cost - linear.of_doubted;
        let excess = (chi_square / freedoms.max(1) as f64).max(1.0);
        let mut information = shared.matrix;
        let covariance = information.clone().cholesky().ok_or_else(singular)?.inverse() * excess;
        let held = self.held(&information).cholesky().ok_or_else(singular)?.inverse() * excess;
        for (at, sigma) in self.sigmas.iter().enumerate() {
            information[(at, at)] -= 1.0 / (sigma * sigma);
        }
        let found = self.unknowns.iter().enumerate().map(|(at, unknown)| Found {
            unknown: *unknown,
            amount: state.amounts[at],
            sigma_before: self.sigmas[at],
            sigma: covariance[(at, at)].max(0.0).sqrt(),
            sigma_held: held[(at, at)].max(0.0).sqrt(),
        });
        let build = build_at(self.expected, &self.unknowns, &state.amounts);
        let runs = self.runs.iter().zip(&state.poses).zip(&linear.looks).map(|((run, poses), look)| RunFit {
            instants_s: run.knots.instants_s(build.sensor.delay_s),
            world_from_base: poses.clone(),
            residuals: look.residuals.clone(),
            doubted: look.doubted,
            gyro_bias_rad_s: run.bias.filter(|_| run.turned.is_some()).map(|bias| state.amounts[bias]),
        });
        Ok(Solution {
            found: found.collect(),
            runs: runs.collect(),
            chi_square,
            freedoms,
            steps,
            unevenness: state.unevenness,
            build,
            covariance,
            information,
        })
    }

    /// The information where the base frame is held: to the sensor, or to all wheels together.
    fn held(&self, information: &DMatrix<f64>) -> DMatrix<f64> {
        let mut held = information.clone();
        let place = |unknown: Unknown| self.unknowns.iter().position(|one| *one == unknown);
        let sensor = [Unknown::SensorX, Unknown::SensorY, Unknown::SensorHeading].map(place);
        if let [Some(x), Some(y), Some(heading)] = sensor {
            for at in [x, y, heading] {
                held[(at, at)] += 1e6 / self.sigmas[at].powi(2);
            }
            return held;
        }
        let weights = DVector::from_iterator(self.sigmas.len(), self.sigmas.iter().map(|sigma| 1.0 / sigma));
        for frame in observed_frames() {
            let scaled = moved_frame(self.expected, &self.unknowns, frame).component_mul(&weights);
            let Some(unit) = scaled.try_normalize(1e-12) else { continue };
            let direction = unit.component_mul(&weights);
            held += 1e6 * &direction * direction.transpose();
        }
        held
    }
}

/// A base frame a little farther along x, along y, and turned.
pub(crate) fn observed_frames() -> [Pose2; 3] {
    [Pose2::new(1.0, 0.0, 0.0), Pose2::new(0.0, 1.0, 0.0), Pose2::new(0.0, 0.0, 1.0)]
}

impl State {
    fn moved(&self, stride: &Stride, share: f64) -> State {
        let moved = self.poses.iter().zip(&stride.poses).map(|(poses, steps)| {
            let pairs = poses.iter().zip(steps);
            pairs.map(|(pose, step)| factors::shifted(*pose, &(step * share))).collect()
        });
        State {
            amounts: &self.amounts + &stride.amounts * share,
            poses: moved.collect(),
            unevenness: self.unevenness,
        }
    }
}
