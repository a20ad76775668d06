//! Prints how each control law holds on treads from soft to rigid and floors from slippery to rough.
//!
//! `cargo run --release -p omnibase-trials --example grip [seeded cases] [first seed] [laws]`
//!
//! Without numbers: the table of stiffness and damping. With them: seeded cases per law, and how many of them rang.

use omnibase_robot_sim::Tread;
use omnibase_trials::framed::Treads;
use omnibase_trials::grip::{Case, HEADING, SIDE_S};
use omnibase_trials::laws::{CLOSED, asked};

/// A control law, and what it is told of the treads.
type Law = (&'static str, Treads);

fn main() {
    let (names, words) = asked(&CLOSED);
    let laws: Vec<Law> = Treads::by_law(&names).collect();
    let mut numbers = words.iter().map(|text| text.parse::<u64>().expect("a number"));
    println!("{HEADING}");
    let Some(cases) = numbers.next() else { return table(&laws) };
    let first = numbers.next().unwrap_or(1);
    for (law, told) in laws {
        let (mut rang, mut unfinished, mut worst_m) = (0, 0, 0.0_f64);
        for seed in first..first + cases {
            let case = Case::seeded(law, told, seed);
            let ridden = case.ride();
            println!("{}", case.row(&ridden));
            rang += u64::from(ridden.ringing > 0.01);
            unfinished += u64::from(!ridden.run.finished);
            worst_m = worst_m.max(ridden.run.true_final_m);
        }
        println!(
            "{law}, treads {told:?}: {rang} of {cases} rang, {unfinished} stopped, at most {:.1} mm off",
            1e3 * worst_m
        );
    }
}

fn table(laws: &[Law]) {
    let (friction, payload_kg, estimate) = (0.5, 100.0, 0.5);
    for &(law, told) in laws {
        let rigid = Case { law, told, tread: None, friction, payload_kg, estimate, side_s: SIDE_S };
        println!("{}", rigid.row(&rigid.ride()));
        for stiffness_n_m in [1e5, 3e5, 1e6, 2e6, 3e6, 4e6] {
            for damping_ratio in [0.1, 0.3, 0.6, 1.0] {
                let case = Case { tread: Some(Tread { stiffness_n_m, damping_ratio }), ..rigid };
                println!("{}", case.row(&case.ride()));
            }
        }
        // The robot alone, its mass known, twice as fast.
        let fast = Case { payload_kg: 0.0, estimate: 1.0, side_s: 0.5 * SIDE_S, ..rigid };
        println!("{}", fast.row(&fast.ride()));
        for friction in [0.08, 0.15, 0.25, 0.35, 0.7] {
            let case = Case { friction, ..rigid };
            println!("{}", case.row(&case.ride()));
        }
    }
}
