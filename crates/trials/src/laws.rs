//! The control laws of the tables, and those that an example is asked for.

/// The laws of torque.
pub const OF_TORQUE: [&str; 2] = ["adaptive_torque", "disturbance_observer"];

/// Whether a law commands torques.
pub fn is_of_torque(law: &str) -> bool {
    OF_TORQUE.contains(&law)
}

/// What an example is asked for on its command line: the laws that are named, all that it has where none is; and its other words.
pub fn asked(all: &[&'static str]) -> (Vec<&'static str>, Vec<String>) {
    let (named, others): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|word| all.contains(&word.as_str()));
    let is_asked = |law: &&'static str| named.is_empty() || named.iter().any(|name| name == law);
    (all.iter().copied().filter(is_asked).collect(), others)
}
