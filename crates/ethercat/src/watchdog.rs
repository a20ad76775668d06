//! Watchdogs: how long a SubDevice lives on without process data or without its application.

use alloc::vec::Vec;

use crate::config::WatchdogConfig;
use crate::start_up::{Refusal, StartUpStep};
use crate::wire::register;

/// The steps that write what the user set; the rest stays as the device has it.
pub fn steps(config: &WatchdogConfig) -> Vec<StartUpStep> {
    let values = [
        ("the watchdogs' divider", register::WATCHDOG_DIVIDER, config.divider),
        ("the PDI watchdog", register::WATCHDOG_PDI, config.pdi),
        ("the process-data watchdog", register::WATCHDOG_PROCESS_DATA, config.process_data),
    ];
    values
        .into_iter()
        .filter_map(|(what, register, value)| {
            Some(StartUpStep::Registers {
                register,
                data: value?.to_le_bytes().to_vec(),
                what,
                refusal: Refusal::IsError,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_set_is_written() {
        let config = WatchdogConfig { process_data: Some(1000), ..WatchdogConfig::default() };
        let steps = steps(&config);
        let expected = StartUpStep::Registers {
            register: 0x0420,
            data: vec![0xE8, 0x03],
            what: "the process-data watchdog",
            refusal: Refusal::IsError,
        };
        assert_eq!(steps, [expected]);
    }
}
