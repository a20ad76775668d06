//! What a SubDevice has that isn't operational.

use std::fmt;

use omnibase_ethercat::cyclic::Health;
use omnibase_ethercat::wire::AlState;

/// A SubDevice's health in words.
pub struct HealthWords(pub Health);

impl fmt::Display for HealthWords {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (status, code) = match self.0 {
            Health::Operational => return f.write_str("in OP"),
            Health::Silent => return f.write_str("it does not answer (no power, cable out, or restarted)"),
            Health::NotAlone => {
                return f.write_str(
                    "another SubDevice answers at its address, too (plugged in with the addresses of another start: \
                     unplug it, switch it off and on, and start again)",
                );
            }
            Health::NotOperational { status, code } => (status, code),
        };
        match AlState::from_bits(status) {
            Some(state) => write!(f, "it is in {state}")?,
            None => write!(f, "its AL status is 0x{status:04x}")?,
        }
        if status & AlState::ERROR != 0 { write!(f, " with error {code}") } else { Ok(()) }
    }
}
