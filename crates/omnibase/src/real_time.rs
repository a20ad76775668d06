//! What the command line asks of the machine for a thread that must keep its times.

use crate::progress::{note, warn};
use omnibase_host::real_time::{self, Idle, Memory, Scheduling, Wishes};
use omnibase_robot::config::RunTable;
use std::time::Duration;

/// Priority, memory and CPU of the thread that keeps the times.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct RealTime {
    /// Real-time scheduling, locked memory, shallow idle, as far as granted.
    #[arg(long)]
    realtime: bool,
    /// How the thread of the cycle is scheduled with --realtime.
    #[arg(long, value_enum, default_value_t = Scheduler::Fifo, requires = "realtime")]
    scheduler: Scheduler,
    /// The CPU on which to run; under --scheduler deadline the kernel chooses it.
    #[arg(long, value_name = "CPU")]
    cpu: Option<usize>,
}

/// Real-time schedulers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum Scheduler {
    /// SCHED_FIFO, priority 80: before everything of lower priority.
    #[default]
    Fifo,
    /// SCHED_DEADLINE: before everything, for at most half of each cycle.
    Deadline,
}

impl RealTime {
    /// Whether anything is asked for.
    pub fn is_wished(&self) -> bool {
        self.realtime || self.cpu.is_some()
    }

    /// Takes over what the robot's file says where the command line says nothing.
    pub fn fill(&mut self, table: &RunTable) {
        self.realtime |= table.realtime.unwrap_or_default();
        if self.scheduler == Scheduler::Fifo && self.cpu.is_none() {
            self.cpu = table.cpu.and_then(|cpu| usize::try_from(cpu).ok());
        }
    }

    /// Asks for it, for a cycle of this length, and says what was granted; keeps it while the result lives.
    ///
    /// Start other threads before: they would inherit the CPU.
    pub fn apply(&self, cycle: Duration) -> anyhow::Result<Option<real_time::Granted>> {
        let period_ns = cycle.as_nanos() as u64;
        let scheduling = match (self.realtime, self.scheduler) {
            (false, _) => Scheduling::AsIs,
            (true, Scheduler::Fifo) => Wishes::default().scheduling,
            (true, Scheduler::Deadline) => Scheduling::Deadline { runtime_ns: period_ns / 2, period_ns },
        };
        anyhow::ensure!(
            self.scheduler == Scheduler::Fifo || self.cpu.is_none(),
            "--scheduler deadline and --cpu exclude each other: under SCHED_DEADLINE the kernel chooses the CPU"
        );
        let wishes = match (self.realtime, self.cpu) {
            (false, None) => return Ok(None),
            (true, cpu) => Wishes { scheduling, cpu, ..Wishes::default() },
            (false, cpu) => Wishes { scheduling, memory: Memory::AsIs, cpu, idle: Idle::AsIs },
        };
        let granted = real_time::apply(&wishes);
        for outcome in &granted.outcomes {
            note(format_args!("real time: {outcome}"));
        }
        if granted.refused().next().is_some() {
            warn("real time: DEGRADED, cycles may be late; `omnibase doctor` says what this machine lacks");
        }
        Ok(Some(granted))
    }
}
