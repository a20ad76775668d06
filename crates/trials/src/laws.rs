//! The control laws of the tables, as the registry has them, and those that an example is asked for.

use std::sync::LazyLock;

use omnibase_robot::Registry;
use omnibase_robot::signals::Quantity;

use crate::plan_of;
use crate::robots::{BMM, with_payload};

/// All laws.
pub static ALL: LazyLock<Vec<&'static str>> = LazyLock::new(|| Registry::with_built_in().controllers.names());

/// Those that look at the pose.
pub static CLOSED: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| ALL.iter().copied().filter(|law| *law != "open_loop").collect());

/// The laws of torque.
pub static OF_TORQUE: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
    let registry = Registry::with_built_in();
    let commands = |law: &str, quantity| {
        let made = registry.make_controllers(&plan_of(&with_payload(BMM, law, 1.0, 0.0)));
        made.unwrap_or_else(|error| panic!("{error}"))[0].quantity() == quantity
    };
    ALL.iter().copied().filter(|law| commands(law, Quantity::Torque)).collect()
});

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
