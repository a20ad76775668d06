//! Where the platform is at the end, against a batch smoother of other people that sees all of it at once: GTSAM.

use crate::batch::Ends;
use crate::python_tools::python;

/// The version that the test was written with; of numpy any does, as the Python at hand takes it.
const PACKAGES: [&str; 2] = ["gtsam==4.3.0", "numpy"];

#[test]
fn the_filter_ends_where_a_batch_smoother_does_on_the_same_data_and_is_as_sure() {
    let Some(python) = python("python-gtsam", &PACKAGES, "import gtsam, numpy") else { return };
    for seed in 0..2 {
        let ends = Ends::of(seed, 100, &python);
        let [off, surer] = [&ends.filter_off, &ends.filter_sigma].map(|all| ends.over_batch(all));
        println!("{seed}: {off:.3?} of its standard deviations off, {surer:.3?} of them itself");
        assert!(off.iter().all(|off| off.abs() < 0.25), "{seed}: {off:?}");
        assert!(surer.iter().all(|one| (0.98..1.05).contains(one)), "{seed}: {surer:?}");
    }
}
