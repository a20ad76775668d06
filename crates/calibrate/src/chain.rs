//! Normal equations of a chain of poses with unknowns that all of them share: block by block, in time that grows with the length.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A row of small vectors, one per shared unknown.
pub(crate) type Row = Vec<Vector3<f64>>;

/// One chain: poses in order, each tied to the next one and to the shared unknowns.
#[derive(Clone)]
pub(crate) struct Chain {
    /// Of each pose with itself.
    pub(crate) own: Vec<Matrix3<f64>>,
    /// Of each pose (row) with the one before (column); the first is empty.
    pub(crate) before: Vec<Matrix3<f64>>,
    /// Of each pose with the shared unknowns.
    pub(crate) shared: Vec<Row>,
    /// The right side: what lowers the cost.
    pub(crate) right: Vec<Vector3<f64>>,
}

/// The equations of the shared unknowns.
#[derive(Clone)]
pub(crate) struct Shared {
    pub(crate) matrix: DMatrix<f64>,
    pub(crate) right: DVector<f64>,
}

/// A chain whose poses are expressed by the shared unknowns.
pub(crate) struct Eliminated {
    inverse: Vec<Matrix3<f64>>,
    before: Vec<Matrix3<f64>>,
    shared: Vec<Row>,
    right: Vec<Vector3<f64>>,
    /// Logarithm of the determinant of what was taken out.
    pub(crate) log_determinant: f64,
    /// By how much the poses alone lower the cost.
    pub(crate) lowered: f64,
}

impl Chain {
    pub(crate) fn new(poses: usize, unknowns: usize) -> Chain {
        Chain {
            own: vec![Matrix3::zeros(); poses],
            before: vec![Matrix3::zeros(); poses],
            shared: vec![vec![Vector3::zeros(); unknowns]; poses],
            right: vec![Vector3::zeros(); poses],
        }
    }

    /// Takes the poses out, from the first to the last, and what they say of the shared unknowns into these. `None` where a pose
    /// is tied to nothing.
    pub(crate) fn eliminate(self, into: &mut Shared) -> Option<Eliminated> {
        let Chain { mut own, before, mut shared, mut right } = self;
        let mut inverse: Vec<Matrix3<f64>> = Vec::with_capacity(own.len());
        let (mut log_determinant, mut lowered) = (0.0, 0.0);
        for at in 0..own.len() {
            if at > 0 {
                let share = before[at] * inverse[at - 1];
                own[at] -= share * before[at].transpose();
                let (done, rest) = shared.split_at_mut(at);
                for (mine, last) in rest[0].iter_mut().zip(&done[at - 1]) {
                    *mine -= share * last;
                }
                let change = share * right[at - 1];
                right[at] -= change;
            }
            let own_inverse = own[at].try_inverse()?;
            log_determinant += own[at].determinant().max(f64::MIN_POSITIVE).ln();
            let wanted = own_inverse * right[at];
            lowered += right[at].dot(&wanted);
            for (row, mine) in shared[at].iter().enumerate() {
                let weighted = own_inverse * mine;
                into.right[row] -= weighted.dot(&right[at]);
                for (column, other) in shared[at].iter().enumerate().skip(row) {
                    into.matrix[(column, row)] -= weighted.dot(other);
                }
            }
            inverse.push(own_inverse);
        }
        into.matrix.fill_upper_triangle_with_lower_triangle();
        Some(Eliminated { inverse, before, shared, right, log_determinant, lowered })
    }
}

impl Eliminated {
    /// The poses' steps that belong to a step of the shared unknowns.
    pub(crate) fn steps(&self, shared: &DVector<f64>) -> Vec<Vector3<f64>> {
        let mut steps = vec![Vector3::zeros(); self.inverse.len()];
        for at in (0..steps.len()).rev() {
            let mut right = self.right[at];
            for (mine, step) in self.shared[at].iter().zip(shared.iter()) {
                right -= mine * *step;
            }
            if let Some(next) = steps.get(at + 1) {
                right -= self.before[at + 1].transpose() * next;
            }
            steps[at] = self.inverse[at] * right;
        }
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_is_solved_as_the_whole_matrix_is() {
        // A chain of random blocks (SplitMix-like numbers, seed 1), against nalgebra's own solution of the whole.
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let (poses, unknowns) = (6, 4);
        let size = 3 * poses + unknowns;
        let mut whole = DMatrix::zeros(size, size);
        let mut right = DVector::from_fn(size, |_, _| random());
        let mut chain = Chain::new(poses, unknowns);
        let mut shared =
            Shared { matrix: DMatrix::identity(unknowns, unknowns) * 9.0, right: DVector::zeros(unknowns) };
        for at in 0..poses {
            chain.own[at] = Matrix3::identity() * 8.0;
            chain.right[at] = right.fixed_rows::<3>(3 * at).into();
            chain.shared[at] = (0..unknowns).map(|_| Vector3::from_fn(|_, _| random())).collect();
            whole.view_mut((3 * at, 3 * at), (3, 3)).copy_from(&chain.own[at]);
            for (column, part) in chain.shared[at].iter().enumerate() {
                whole.view_mut((3 * at, 3 * poses + column), (3, 1)).copy_from(part);
                whole.view_mut((3 * poses + column, 3 * at), (1, 3)).copy_from(&part.transpose());
            }
            if at > 0 {
                chain.before[at] = Matrix3::from_fn(|_, _| random());
                whole.view_mut((3 * at, 3 * at - 3), (3, 3)).copy_from(&chain.before[at]);
                whole.view_mut((3 * at - 3, 3 * at), (3, 3)).copy_from(&chain.before[at].transpose());
            }
        }
        whole.view_mut((3 * poses, 3 * poses), (unknowns, unknowns)).copy_from(&shared.matrix);
        right.rows_mut(3 * poses, unknowns).fill(0.25);
        shared.right.fill(0.25);
        let expected = whole.clone().lu().solve(&right).unwrap();
        let eliminated = chain.eliminate(&mut shared).unwrap();
        let rest = shared.matrix.clone().cholesky().unwrap();
        let found = rest.solve(&shared.right);
        let log_determinant = eliminated.log_determinant + rest.determinant().ln();
        assert!((log_determinant - whole.determinant().ln()).abs() < 1e-12);
        assert!((eliminated.lowered + found.dot(&shared.right) - right.dot(&expected)).abs() < 1e-12);
        assert!((&found - expected.rows(3 * poses, unknowns)).norm() < 1e-12);
        for (at, step) in eliminated.steps(&found).iter().enumerate() {
            assert!((step - expected.fixed_rows::<3>(3 * at)).norm() < 1e-12, "{at}");
        }
    }
}
