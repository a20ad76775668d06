//! Distances between cells' centres against `scipy.ndimage.distance_transform_edt`, to the bit.

#[path = "../../omnibase/tests/python_tools/mod.rs"]
mod python_tools;

use omnibase_plan::distance::{Between, squares};
use python_tools::{python, successful};
use std::path::Path;
use std::process::Command;

const MAPS: u64 = 100;

#[test]
fn a_hundred_random_maps_have_the_same_distances() {
    let Some(python) = python("python-scipy", &["scipy==1.17.1"], "import scipy.ndimage") else { return };
    let mut state = 11_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 33
    };
    let (mut bytes, mut cells) = (Vec::new(), 0);
    for number in 0..MAPS {
        let (width, height) = (1 + next() as usize % 300, 1 + next() as usize % 300);
        let share = 2 + next() % (1 + 20 * number);
        let mut blocked: Vec<bool> = (0..width * height).map(|_| next() % share == 0).collect();
        // What has no occupied cell at all is told otherwise by scipy.
        blocked[0] = true;
        cells += blocked.len();
        bytes.extend([width, height].iter().flat_map(|side| (*side as u32).to_le_bytes()));
        bytes.extend(blocked.iter().map(|blocked| u8::from(*blocked)));
        let distances = squares(&blocked, width, Between::Centres);
        bytes.extend(distances.into_iter().flat_map(|square| square.sqrt().to_le_bytes()));
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("distances-{}.bin", std::process::id()));
    std::fs::write(&file, bytes).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/distances.py");
    let said = successful(Command::new(python).arg(script).arg(&file)).unwrap();
    std::fs::remove_file(file).unwrap();
    assert_eq!(String::from_utf8(said).unwrap(), format!("{cells} 0\n"), "cells, and those that differ");
    println!("{cells} cells of {MAPS} maps");
}
