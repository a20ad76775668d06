//! The kinds that omnibase brings along.

use crate::registry::Registry;
use crate::{controllers, devices, estimators, events, layouts, peripherals, receivers, references};

impl Registry {
    /// A registry with the built-in kinds.
    pub fn with_built_in() -> Self {
        let mut registry = Registry::empty();
        controllers::register(&mut registry);
        references::register(&mut registry);
        estimators::register(&mut registry);
        devices::register(&mut registry);
        peripherals::register(&mut registry);
        layouts::register(&mut registry);
        events::register(&mut registry);
        receivers::register(&mut registry);
        registry
    }
}
