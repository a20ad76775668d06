//! Normal equations of a chain of poses with unknowns that all of them share: block by block, in time that grows with the length.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};

/// One chain: poses in order, each tied to the next one and to the shared unknowns.
#[derive(Clone)]
pub(crate) struct Chain {
    /// Of each pose with itself.
    pub(crate) own: Vec<Matrix3<f64>>,
    /// Of each pose (row) with the one before (column); the first is empty.
    pub(crate) before: Vec<Matrix3<f64>>,
    /// Of each pose with the shared unknowns.
    pub(crate) shared: Vec<Matrix3xX<f64>>,
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
    shared: Vec<Matrix3xX<f64>>,
    right: Vec<Vector3<f64>>,
}

impl Chain {
    pub(crate) fn new(poses: usize, unknowns: usize) -> Chain {
        Chain {
            own: vec![Matrix3::zeros(); poses],
            before: vec![Matrix3::zeros(); poses],
            shared: vec![Matrix3xX::zeros(unknowns); poses],
            right: vec![Vector3::zeros(); poses],
        }
    }

    /// Takes the poses out, from the first to the last, and what they say of the shared unknowns into these. `None` where a pose
    /// is tied to nothing.
    pub(crate) fn eliminate(self, into: &mut Shared) -> Option<Eliminated> {
        let Chain { mut own, before, mut shared, mut right } = self;
        let mut inverse = Vec::with_capacity(own.len());
        for at in 0..own.len() {
            if at > 0 {
                let last: &Matrix3<f64> = &inverse[at - 1];
                let share = before[at] * last;
                own[at] -= share * before[at].transpose();
                let (done, rest) = shared.split_at_mut(at);
                rest[0] -= share * &done[at - 1];
                let change = share * right[at - 1];
                right[at] -= change;
            }
            let own_inverse = own[at].try_inverse()?;
            let weighted = own_inverse * &shared[at];
            into.matrix -= shared[at].transpose() * &weighted;
            into.right -= weighted.transpose() * right[at];
            inverse.push(own_inverse);
        }
        Some(Eliminated { inverse, before, shared, right })
    }
}

impl Eliminated {
    /// The poses' steps that belong to a step of the shared unknowns.
    pub(crate) fn steps(&self, shared: &DVector<f64>) -> Vec<Vector3<f64>> {
        let mut steps = vec![Vector3::zeros(); self.inverse.len()];
        for at in (0..steps.len()).rev() {
            let mut right = self.right[at] - &self.shared[at] * shared;
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
            chain.shared[at] = Matrix3xX::from_fn(unknowns, |_, _| random());
            whole.view_mut((3 * at, 3 * at), (3, 3)).copy_from(&chain.own[at]);
            whole.view_mut((3 * at, 3 * poses), (3, unknowns)).copy_from(&chain.shared[at]);
            whole.view_mut((3 * poses, 3 * at), (unknowns, 3)).copy_from(&chain.shared[at].transpose());
            if at > 0 {
                chain.before[at] = Matrix3::from_fn(|_, _| random());
                whole.view_mut((3 * at, 3 * at - 3), (3, 3)).copy_from(&chain.before[at]);
                whole.view_mut((3 * at - 3, 3 * at), (3, 3)).copy_from(&chain.before[at].transpose());
            }
        }
        whole.view_mut((3 * poses, 3 * poses), (unknowns, unknowns)).copy_from(&shared.matrix);
        right.rows_mut(3 * poses, unknowns).fill(0.25);
        shared.right.fill(0.25);
        let expected = whole.lu().solve(&right).unwrap();
        let eliminated = chain.eliminate(&mut shared).unwrap();
        let found = shared.matrix.clone().cholesky().unwrap().solve(&shared.right);
        assert!((&found - expected.rows(3 * poses, unknowns)).norm() < 1e-12);
        for (at, step) in eliminated.steps(&found).iter().enumerate() {
            assert!((step - expected.fixed_rows::<3>(3 * at)).norm() < 1e-12, "{at}");
        }
    }
}
