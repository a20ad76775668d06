//! Prints what is told of slip on slopes: of the shipped robots at their limits, where their floor grips, and of robots that are told
//! twice the friction that their floor has.
//!
//! `cargo run --release -p omnibase-trials --example slopes [for how many cycles it stands before it begins] [laws]`

use omnibase_robot::signals::SafetyReason;
use omnibase_trials::fast;
use omnibase_trials::laws::{CLOSED, asked, is_of_torque};
use omnibase_trials::robots::{BMM, MECANUM};
use omnibase_trials::slip::{LEAST_M, Slid};

const SQUARE: &str = "points = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], [15, 0, 2, 0], [20, 0, 0, 0]]";
const DIRECTIONS: u32 = 8;

fn main() {
    let (laws, words) = asked(&CLOSED);
    let rests = words.first().map_or(0, |count| count.parse().expect("a number of cycles"));
    let motions = [
        "kind = \"circle\"\nradius_m = 0.4\nduration_s = 6.3".to_owned(),
        "kind = \"circle\"\nradius_m = 0.4\ntiming = \"fastest\"".to_owned(),
        "kind = \"circle\"\nradius_m = 0.8\ntiming = \"fastest\"\nheading = \"follows_tangent\"".to_owned(),
        "kind = \"eight\"\nhalf_length_m = 0.8\ntiming = \"fastest\"".to_owned(),
        "kind = \"eight\"\nhalf_length_m = 0.8\ntiming = \"fastest\"\nheading = \"follows_tangent\""
            .to_owned(),
        format!("kind = \"path\"\ntiming = \"fastest\"\n{SQUARE}"),
        format!("kind = \"path\"\ntiming = \"fastest\"\ncorner_m = 0.05\n{SQUARE}"),
    ];
    println!(
        "| robot | law | slope | floor | runs | a wheel slipped | told of these | told of the others | stopped for slip | longest slip, mm | farthest off, mm | farthest from belief, mm | took, s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (name, robot) in [("bmm", BMM), ("mecanum", MECANUM)] {
        for &law in &laws {
            for slope_rad in [0.0, 0.03, 0.04, 0.05, 0.07] {
                let texts: Vec<String> = motions.iter().map(|motion| shipped(robot, law, motion)).collect();
                row(&[name, law], slope_rad, "0.50", &texts, rests);
                let fast = fast::MOTIONS.map(|(_, motion)| {
                    fast::Case { robot, law, motion: motion.to_owned(), told: 0.5, floor: [0.25, 0.2] }.text()
                });
                row(&[name, law], slope_rad, "0.25 told as 0.50", &fast, rests);
            }
        }
    }
}

/// A robot as it is shipped, under a law.
fn shipped(robot: &str, law: &str, motion: &str) -> String {
    let known =
        if is_of_torque(law) && robot == MECANUM { "\nmass_kg = 60.0\ninertia_kg_m2 = 4.0" } else { "" };
    let text = robot.replacen("kind = \"closed_loop_speed\"", &format!("kind = \"{law}\"{known}"), 1);
    format!("{text}\n[reference]\n{motion}\n")
}

fn row(who: &[&str; 2], slope_rad: f64, floor: &str, texts: &[String], rests: u64) {
    let (mut slipped, mut told, mut falsely, mut stopped) = (0, 0, 0, 0);
    let (mut way_m, mut off_m, mut apart_m, mut took_s) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0);
    for text in texts {
        for direction in 0..DIRECTIONS {
            let direction_rad = 0.1 + std::f64::consts::TAU * f64::from(direction) / f64::from(DIRECTIONS);
            let slope =
                format!("[simulation]\nslope_rad = {slope_rad:?}\nslope_direction_rad = {direction_rad:?}\n");
            let slid = Slid::of_rested(&text.replacen("[simulation]\n", &slope, 1), rests);
            let is_true = slid.way_m > 0.1 * LEAST_M;
            slipped += u32::from(is_true);
            told += u32::from(is_true && slid.told.is_some());
            falsely += u32::from(!is_true && slid.told.is_some());
            stopped += u32::from(slid.stopped == SafetyReason::WheelSlip);
            way_m = way_m.max(slid.way_m);
            off_m = off_m.max(slid.run.true_final_m);
            apart_m = apart_m.max(slid.apart.distance_m());
            took_s += slid.run.cycles as f64 * 1e-3;
        }
    }
    let [robot, law] = who;
    let runs = texts.len() as u32 * DIRECTIONS;
    println!(
        "| {robot} | {law} | {slope_rad:.2} | {floor} | {runs} | {slipped} | {told} | {falsely} | {stopped} | {:.1} | {:.1} | {:.1} | {:.1} |",
        1e3 * way_m,
        1e3 * off_m,
        1e3 * apart_m,
        took_s / f64::from(runs)
    );
}
