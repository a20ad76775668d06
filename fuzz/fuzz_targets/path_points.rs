//! Any text as path points: refused in words, or finite points with rising times.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_trajectory::PathPoints;

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(path) = PathPoints::parse(text) else { return };
    assert!(path.as_slice().len() >= 2);
    for pair in path.as_slice().windows(2) {
        assert!(pair[0].time_s < pair[1].time_s);
    }
    for point in path.as_slice() {
        let pose = point.odom_from_base;
        assert!([point.time_s, pose.x_m, pose.y_m, pose.heading_rad].iter().all(|value| value.is_finite()));
    }
});
