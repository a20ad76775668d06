//! Other MainDevices against the simulated segment.
//!
//! A simulator that is tested with its own MainDevice alone proves little: here EtherCrab (as a crate) and SOEM
//! (as the Python package `pysoem`) drive it over a virtual cable.
#![forbid(unsafe_code)]

pub mod ethercrab;
pub mod makers;
pub mod soem;

use omnibase_ethercat_sim::{Segment, SegmentFile, serve, until_set};
use omnibase_host::{MonotonicClock, Namespace, PacketSocket};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// A segment of `count` drives of one kind (`servo` or `sgdv`), their clocks apart and drifting by up to 50 ppm.
pub fn drives(kind: &str, count: usize) -> Segment {
    let text = format!(
        "[[subdevice]]\nkind = \"{kind}\"\nname = \"drive\"\ncount = {count}\ndc_offset_ns = 1_000_000_000\n\
         dc_offset_step_ns = 77_777_777\ndc_drift_spread_ppm = 50.0\n"
    );
    let file = SegmentFile::parse(&text).expect("the description is right");
    file.build(Path::new(".")).expect("the description can be built")
}

/// Serves `segment` at the far end of a virtual cable while `work` runs at the near end, [`Namespace::NEAR`].
pub fn behind_a_cable<R: Send>(
    namespace: &Namespace,
    mut segment: Segment,
    work: impl FnOnce() -> R + Send,
) -> R {
    /// Ends the serving when the work is done, and also when it panics.
    struct StopAtEnd<'a>(&'a AtomicBool);
    impl Drop for StopAtEnd<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }

    let stop = AtomicBool::new(false);
    namespace.run(|| {
        let mut far_end = PacketSocket::open(Namespace::FAR).expect("the far end can be opened");
        std::thread::scope(|scope| {
            scope.spawn(|| {
                serve(&mut segment, &mut far_end, &MonotonicClock, &mut until_set(&stop))
                    .expect("the cable is in")
            });
            let _stop = StopAtEnd(&stop);
            work()
        })
    })
}
