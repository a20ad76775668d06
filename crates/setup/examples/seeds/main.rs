//! Robots that nobody knows, set up by a script: wiring, order, direction, gear and encoder wrong in seeded ways.
//!
//! `seeds [COUNT]`: so many seeds, 100 where nothing is said. Of each: whether the file is right, whether its square was driven.

mod unknown;

use unknown::{Unknown, differences, drive_square, set_up};

fn main() {
    let count: u64 = std::env::args().nth(1).and_then(|word| word.parse().ok()).unwrap_or(100);
    let (mut right, mut driven, mut worst_m) = (0, 0, 0.0f64);
    let (mut wired, mut found_wires, mut unheld, mut asked, mut metres) = (0, 0, 0, 0, 0);
    for seed in 1..=count {
        let robot = Unknown::of(seed);
        let said = |text: &str| Some(omnibase_setup::Answer::Text(text.to_owned()));
        // Every tenth is driven on the floor, too.
        let on_floor = |question: &omnibase_setup::Question| match question.id.as_str() {
            "floor" if seed % 10 == 1 => said("drive"),
            "calibrate" if seed % 10 == 1 => said("calibrate"),
            _ => None,
        };
        let found = match set_up(&robot, &mut { on_floor }) {
            Ok(found) => found,
            Err(error) => {
                println!("seed {seed}: {error}");
                continue;
            }
        };
        let wrong = differences(&robot, &found.text);
        let square = drive_square(&robot, &found.text);
        let told = found.record.findings.iter().any(|finding| finding.contains("counted against its motor"));
        wired += u64::from(robot.turned_encoder.is_some());
        found_wires += u64::from(robot.turned_encoder.is_some() && told);
        right += u64::from(wrong.is_empty());
        asked += found.asked.len();
        metres += u32::from(found.record.legs.len() == 3);
        unheld += found
            .record
            .log
            .iter()
            .filter(|line| line.contains("without a held key") && !line.contains(" 0 without a held key"))
            .count();
        match square {
            Ok(rms_m) => {
                driven += 1;
                worst_m = worst_m.max(rms_m);
            }
            Err(error) => println!("seed {seed}: the square: {error}"),
        }
        if !wrong.is_empty() {
            println!("seed {seed}: {robot:?}: {}", wrong.join("; "));
        }
    }
    println!(
        "{right} of {count} files right, {driven} drove their square (true RMS at most {:.2} mm); wrong wires found: {found_wires} of {wired}; \
         on the floor: {metres} drove three ways against a tape; motions without a held key: {unheld}; {asked} questions answered",
        1e3 * worst_m
    );
}
