//! What the command line asks of the machine for a thread that must keep its times.

use crate::progress::note;
use omnibase_host::real_time::{self, Idle, Memory, Wishes};

/// Priority, memory and CPU of the thread that keeps the times.
#[derive(Debug, clap::Args)]
pub struct RealTime {
    /// SCHED_FIFO, locked memory, shallow idle, as far as granted.
    #[arg(long)]
    realtime: bool,
    /// The CPU on which to run.
    #[arg(long, value_name = "CPU")]
    cpu: Option<usize>,
}

impl RealTime {
    /// Whether anything is asked for.
    pub fn is_wished(&self) -> bool {
        self.realtime || self.cpu.is_some()
    }

    /// Asks for it and says what was granted; keeps it while the result lives.
    pub fn apply(&self) -> Option<real_time::Granted> {
        let wishes = match (self.realtime, self.cpu) {
            (false, None) => return None,
            (true, cpu) => Wishes { cpu, ..Wishes::default() },
            (false, cpu) => Wishes { fifo_priority: None, memory: Memory::AsIs, cpu, idle: Idle::AsIs },
        };
        let granted = real_time::apply(&wishes);
        for outcome in &granted.outcomes {
            note(format_args!("real time: {outcome}"));
        }
        Some(granted)
    }
}
