//! Writes random maps with their distances to a file, for `scipy` to look at: width and height as u32, a byte a cell, then its distance as f64
//! (little-endian); `check_distances.py` beside this file does so.

use std::io::Write;

use omnibase_plan::distance::{Between, squares};

fn main() -> std::io::Result<()> {
    let file = std::env::args().nth(1).unwrap_or_else(|| "distances.bin".into());
    let mut file = std::io::BufWriter::new(std::fs::File::create(file)?);
    let mut state = 11_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 33
    };
    for number in 0..200 {
        let (width, height) = (1 + next() as usize % 300, 1 + next() as usize % 300);
        let share = 2 + next() % (1 + 10 * number);
        let mut blocked: Vec<bool> = (0..width * height).map(|_| next() % share == 0).collect();
        // What has no occupied cell at all is told otherwise by scipy.
        blocked[0] = true;
        file.write_all(&(width as u32).to_le_bytes())?;
        file.write_all(&(height as u32).to_le_bytes())?;
        file.write_all(&blocked.iter().map(|blocked| u8::from(*blocked)).collect::<Vec<u8>>())?;
        for square in squares(&blocked, width, Between::Centres) {
            file.write_all(&square.sqrt().to_le_bytes())?;
        }
    }
    Ok(())
}
