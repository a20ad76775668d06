//! Motions from state to state against those of `ruckig`, the implementation of the method's authors.

#[path = "../../omnibase/tests/python_tools/mod.rs"]
mod python_tools;

use omnibase_trajectory::PointToPoint;
use omnibase_trajectory::point_to_point::AxisStates;
use python_tools::python;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

const STATES: usize = 10_000;

/// Numbers from 0 to 1 (G. Marsaglia, *Xorshift RNGs*, 2003).
struct Random(u64);

impl Random {
    fn between(&mut self, from: f64, to: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        from + (to - from) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}

/// Two states and the limits between them; now and then at rest, so that the way is straight.
fn problem(random: &mut Random) -> [AxisStates; 3] {
    let most: AxisStates = std::array::from_fn(|_| {
        [random.between(0.2, 2.0), random.between(0.3, 6.0), random.between(3.0, 400.0)]
    });
    let [moves, goes_on] = [random.between(0.0, 1.0) < 0.8, random.between(0.0, 1.0) < 0.5];
    let mut state = |is_moving: bool, part: f64| -> AxisStates {
        std::array::from_fn(|axis| {
            let [speed, acceleration, jerk] = most[axis];
            let place = random.between(-3.0, 3.0);
            if !is_moving {
                return [place, 0.0, 0.0];
            }
            let rate = part
                * random
                    .between(-acceleration, acceleration)
                    .clamp(-(speed * jerk).sqrt(), (speed * jerk).sqrt());
            let left = part * (speed - rate * rate / (2.0 * jerk));
            [place, random.between(-left, left), rate]
        })
    };
    [state(moves, 0.99), state(goes_on, 0.9), most]
}

#[test]
fn ten_thousand_random_states_take_the_same_time() {
    let Some(python) = python("python-ruckig", &["ruckig==0.19.4"], "import ruckig") else { return };
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let problems: Vec<[AxisStates; 3]> = (0..STATES).map(|_| problem(&mut random)).collect();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/state_to_state.py");
    let mut child =
        Command::new(python).arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let lines: Vec<String> = problems.iter().map(|problem| serde_json::to_string(problem).unwrap()).collect();
    let writer = std::thread::spawn(move || writeln!(stdin, "{}", lines.join("\n")).unwrap());
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    let answers = String::from_utf8(output.stdout).unwrap();
    let answers: Vec<Option<f64>> = answers.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(answers.len(), STATES);
    let mut motion = PointToPoint::default();
    let mut worst_s = 0.0_f64;
    for (at, ([from, to, most], answer)) in problems.into_iter().zip(answers).enumerate() {
        let own_s = motion.plan_axes([from, to], most).unwrap_or_else(|why| panic!("{at}: {why}"));
        let their_s = answer.unwrap_or_else(|| panic!("{at}: ruckig finds none"));
        worst_s = worst_s.max((own_s - their_s).abs());
        assert!((own_s - their_s).abs() < 1e-6, "state {at}: {own_s} s, by ruckig {their_s} s");
    }
    println!("{STATES} states, durations within {worst_s:e} s of ruckig's");
}
