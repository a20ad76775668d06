//! Odometry that drifts: where the body truly is, by errors drawn from what the estimator says of itself.
//!
//! A third of the worlds wander: the error's steps are drawn so that its covariance is the estimator's at every
//! moment, wrong headings turn the way that follows.
//!
//! A third is wrong all the time, by a direction of the covariance's ellipsoid that stays and two to three
//! standard deviations: an error that nothing averages out.
//!
//! And a third is in every cycle wrong by what leaves the least room of all errors within three standard
//! deviations.

use omnibase_platform::Pose2;
use omnibase_robot::signals::PlatformState;

use super::Random;

pub(crate) type Matrix = [[f64; 3]; 3];
pub(crate) type Vector = [f64; 3];

/// How an error comes about.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Wanders,
    /// In this direction of the ellipsoid, by so many standard deviations.
    Stays(Vector),
    /// By as much as leaves the least room.
    Worst,
}

/// The error of a believed pose.
#[derive(Clone, Debug)]
pub struct Drift {
    kind: Kind,
    random: Random,
    /// x and y in odom, m, and heading, rad.
    error: Vector,
    before: Option<(Pose2, Matrix)>,
}

impl Drift {
    /// The drift of a seed.
    pub fn new(seed: u64) -> Drift {
        let mut random = Random::new(seed ^ 0xD81F_7000_0000_0000);
        let kind = match random.below(3) {
            0 => Kind::Wanders,
            1 => Kind::Worst,
            _ => {
                let direction = [random.normal(), random.normal(), random.normal()];
                let size = direction.iter().map(|value| value * value).sum::<f64>().sqrt().max(1e-9);
                let sigmas = random.between(2.0, 3.0);
                Kind::Stays(direction.map(|value| sigmas * value / size))
            }
        };
        Drift { kind, random, error: [0.0; 3], before: None }
    }

    /// The true pose of a cycle, and how many standard deviations the believed one is off; `room` is that of a pose.
    pub fn truth(&mut self, state: &PlatformState, room: impl Fn(&Pose2) -> f64) -> (Pose2, f64) {
        let pose = state.odom_from_body;
        let [xx, xy, xh, yy, yh, hh] = state.covariance;
        let covariance = [[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]];
        self.error = match self.kind {
            Kind::Stays(direction) => times(&root(&covariance), &direction),
            Kind::Worst => {
                let here_m = room(&pose);
                // Towards less room: by 0.1 mm and 0.1 mrad, for which the room is as good as linear.
                let less = |error: Vector| (here_m - room(&moved(&pose, &error))) / PROBE;
                let slope = [less([PROBE, 0.0, 0.0]), less([0.0, PROBE, 0.0]), less([0.0, 0.0, PROBE])];
                let towards = times(&covariance, &slope);
                let size = slope.iter().zip(&towards).map(|(a, b)| a * b).sum::<f64>().max(0.0).sqrt();
                towards.map(|value| if size > 0.0 { WORST_SIGMAS * value / size } else { 0.0 })
            }
            Kind::Wanders => {
                let (carried, added) = match self.before {
                    None => ([0.0; 3], covariance),
                    Some((from, before)) => {
                        let (dx, dy) = (pose.x_m - from.x_m, pose.y_m - from.y_m);
                        let carry = [[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]];
                        let kept = product(&product(&carry, &before), &transposed(&carry));
                        let added =
                            std::array::from_fn(|i| std::array::from_fn(|j| covariance[i][j] - kept[i][j]));
                        (times(&carry, &self.error), added)
                    }
                };
                let chance = [self.random.normal(), self.random.normal(), self.random.normal()];
                let step = times(&root(&added), &chance);
                std::array::from_fn(|i| carried[i] + step[i])
            }
        };
        self.before = Some((pose, covariance));
        let [x, y, heading] = self.error;
        let truth = Pose2 { x_m: pose.x_m + x, y_m: pose.y_m + y, heading_rad: pose.heading_rad + heading };
        (truth, sigmas(&root(&covariance), &self.error))
    }
}

/// How far the room is felt for, m and rad.
const PROBE: f64 = 1e-4;
/// Three, but for rounding.
const WORST_SIGMAS: f64 = 3.0 - 1e-9;

fn moved(pose: &Pose2, [x, y, heading]: &Vector) -> Pose2 {
    Pose2 { x_m: pose.x_m + x, y_m: pose.y_m + y, heading_rad: pose.heading_rad + heading }
}

fn times(matrix: &Matrix, vector: &Vector) -> Vector {
    matrix.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
}

fn transposed(matrix: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[j][i]))
}

fn product(one: &Matrix, other: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| one[i][k] * other[k][j]).sum()))
}

/// The lower root of a covariance (Cholesky); what rounding made negative counts as none.
pub(crate) fn root(matrix: &Matrix) -> Matrix {
    let mut root = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let rest = matrix[i][j] - (0..j).map(|k| root[i][k] * root[j][k]).sum::<f64>();
            root[i][j] = if i == j {
                rest.max(0.0).sqrt()
            } else if root[j][j] > 0.0 {
                rest / root[j][j]
            } else {
                0.0
            };
        }
    }
    root
}

/// The length of an error in standard deviations of a covariance with this root.
pub(crate) fn sigmas(root: &Matrix, error: &Vector) -> f64 {
    let mut solved = [0.0; 3];
    for i in 0..3 {
        let rest = error[i] - (0..i).map(|k| root[i][k] * solved[k]).sum::<f64>();
        solved[i] = if root[i][i] > 0.0 { rest / root[i][i] } else { 0.0 };
    }
    solved.iter().map(|value| value * value).sum::<f64>().sqrt()
}
