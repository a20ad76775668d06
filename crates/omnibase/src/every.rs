//! Time from row to row, as the command line says it.

use std::str::FromStr;

/// `10ms`, or `5cycles`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Every {
    /// So many ns.
    Ns(u64),
    /// So many cycles.
    Cycles(u64),
}

impl Every {
    /// In ns, for a robot with that cycle; a time that isn't a whole multiple of it is refused.
    pub fn of_cycle(self, cycle_ns: u64) -> anyhow::Result<u64> {
        let cycle_ms = cycle_ns as f64 / 1e6;
        match self {
            Every::Cycles(cycles) => Ok(cycles.saturating_mul(cycle_ns)),
            Every::Ns(ns) if ns >= cycle_ns && ns.is_multiple_of(cycle_ns) => Ok(ns),
            Every::Ns(ns) => anyhow::bail!(
                "--every {}ms: expected a whole multiple of the cycle of {cycle_ms} ms",
                ns as f64 / 1e6
            ),
        }
    }
}

impl FromStr for Every {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("expected a time as 10ms or 0.5s, or a number of cycles as 10cycles, found `{text}`");
        let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let (number, unit) = text.split_at(digits);
        let cycles = |number: &str| number.parse().ok().filter(|cycles| *cycles > 0).map(Every::Cycles);
        let ns_of_unit = match unit {
            "cycle" | "cycles" => return cycles(number).ok_or_else(wrong),
            "us" => 1e3,
            "ms" => 1e6,
            "s" => 1e9,
            _ => return Err(wrong()),
        };
        let ns = number.parse::<f64>().map_err(|_| wrong())? * ns_of_unit;
        if (1.0..=1e15).contains(&ns) { Ok(Every::Ns(ns.round() as u64)) } else { Err(wrong()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_or_a_number_of_cycles() {
        let every = |text: &str| text.parse::<Every>();
        assert_eq!(every("10ms"), Ok(Every::Ns(10_000_000)));
        assert_eq!(every("0.5s"), Ok(Every::Ns(500_000_000)));
        assert_eq!(every("250us"), Ok(Every::Ns(250_000)));
        assert_eq!(every("1cycle"), Ok(Every::Cycles(1)));
        for wrong in ["10", "ms", "0ms", "-1ms", "1.5cycles", "0cycles", "1h", "1e30s", "", "10 ms"] {
            assert!(every(wrong).is_err(), "{wrong}");
        }
        assert_eq!(Every::Ns(10_000_000).of_cycle(1_000_000).unwrap(), 10_000_000);
        assert_eq!(Every::Cycles(10).of_cycle(250_000).unwrap(), 2_500_000);
        let refused = Every::Ns(1_500_000).of_cycle(1_000_000).unwrap_err().to_string();
        assert_eq!(refused, "--every 1.5ms: expected a whole multiple of the cycle of 1 ms");
    }
}
