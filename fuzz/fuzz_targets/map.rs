//! A map's YAML, a zero byte, and its image: read without a panic, and ways are looked for in whatever map comes of it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_plan::map::{MOST_CELLS, Unknown};
use omnibase_plan::{Cost, Footprint, Map, Space, Task, Until, plan};
use omnibase_platform::Pose2;

/// Larger ones are read only: a search in them takes longer than a fuzzer waits.
const SEARCHED: usize = 4096;

fuzz_target!(|bytes: &[u8]| {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (yaml, image) = bytes.split_at(end);
    let Ok(yaml) = std::str::from_utf8(yaml) else { return };
    let image = image.get(1..).unwrap_or_default();
    let Ok(map) = Map::read(yaml, Unknown::Free, |_| Ok(image.to_vec())) else { return };
    assert_eq!(map.blocked.len(), map.width * map.height);
    assert!((1..=MOST_CELLS).contains(&map.blocked.len()));
    if map.blocked.len() > SEARCHED {
        return;
    }
    let cell_m = map.cell_m;
    let corner = |column: usize, row: usize| {
        let [x_m, y_m] = map.centre_m(column, row);
        Pose2::new(x_m, y_m, 0.0)
    };
    let (from, to) = (corner(0, 0), corner(map.width - 1, map.height - 1));
    let half = 0.4 * cell_m;
    let Ok(footprint) = Footprint::new(vec![[-half, -half], [half, -half], [half, half], [-half, half]])
    else {
        return;
    };
    let space = Space::new(map);
    for cost in [Cost::Shortest, Cost::Ridge] {
        let task = Task {
            space: &space,
            footprint: &footprint,
            from,
            to,
            clearance_m: 0.05 * cell_m,
            cost,
            until: Until::default(),
        };
        if let Ok(way) = plan(&task) {
            assert!(way.length_m.is_finite() && way.poses.iter().all(|pose| pose.is_finite()));
        }
    }
});
