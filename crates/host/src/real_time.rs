//! Giving a thread what the cycle needs: priority, memory that stays, a CPU, and a machine that wakes fast.
//!
//! Each wish is granted or refused on its own; a refusal says why and what to do, and nothing fails because of it.
//! Whether a refusal is acceptable is the caller's decision.

use rustix::mm::MlockAllFlags;
use rustix::thread::{CpuSet, sched_setaffinity};
use std::fmt;
use std::fs::File;
use std::io::{self, Write};

/// What a thread wishes for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wishes {
    /// Priority under SCHED_FIFO, 1 to 99; `None` keeps the scheduling as it is.
    pub fifo_priority: Option<u8>,
    /// Whether all memory, present and future, is kept in RAM and the stack is touched ahead.
    pub memory: Memory,
    /// The CPU to stay on; `None` keeps the affinity as it is.
    pub cpu: Option<usize>,
    /// Whether CPUs may fall asleep so deeply that they wake late.
    pub idle: Idle,
}

/// What happens with the process's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// Pages may be swapped and are mapped at their first use.
    AsIs,
    /// Pages are locked, and the stack is mapped ahead: no page fault in the cycle.
    Locked,
}

/// How deep idle CPUs may sleep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Idle {
    /// As the system decides.
    AsIs,
    /// Shallow only, while the [`Granted`] lives: waking takes no extra microseconds, at the cost of power.
    Shallow,
}

impl Default for Wishes {
    /// FIFO priority 80 (above the usual interrupt threads at 50), locked memory, shallow idle, any CPU.
    fn default() -> Self {
        Wishes { fifo_priority: Some(80), memory: Memory::Locked, cpu: None, idle: Idle::Shallow }
    }
}

/// One wish and what became of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// The wish, in words.
    pub wish: String,
    /// `Ok` where it was granted; else why not and what to do.
    pub result: Result<(), String>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.result {
            Ok(()) => write!(f, "{}: granted", self.wish),
            Err(reason) => write!(f, "{}: REFUSED, {reason}", self.wish),
        }
    }
}

/// What was granted; keeps the idle limit while it lives.
#[derive(Debug)]
pub struct Granted {
    /// Each wish with its outcome, in order.
    pub outcomes: Vec<Outcome>,
    // The kernel takes the limit back when the file is closed.
    _idle_limit: Option<File>,
}

impl Granted {
    /// The wishes that were refused.
    pub fn refused(&self) -> impl Iterator<Item = &Outcome> {
        self.outcomes.iter().filter(|outcome| outcome.result.is_err())
    }
}

/// Takes away the 50 us by which the kernel may delay the wake-ups of an ordinary thread to save power.
///
/// Holds for the calling thread and for those that it starts; needs no rights.
pub fn exact_timers() {
    // SAFETY: no pointers; one nanosecond is the least slack there is (0 means the default).
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1) };
}

/// Bytes of stack that are touched ahead; enough for a cycle, little against a thread's 2 MiB.
const STACK_AHEAD: usize = 256 * 1024;

/// Applies `wishes` to the calling thread (memory and idle: to the whole process).
pub fn apply(wishes: &Wishes) -> Granted {
    let mut outcomes = Vec::new();
    let mut note = |wish: String, result: Result<(), String>| outcomes.push(Outcome { wish, result });
    if wishes.memory == Memory::Locked {
        let result = rustix::mm::mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
        touch_stack();
        note("locked memory".to_owned(), result.map_err(|error| lock_advice(error.into())));
    }
    if let Some(cpu) = wishes.cpu {
        note(format!("CPU {cpu}"), pin(cpu));
    }
    let mut idle_limit = None;
    if wishes.idle == Idle::Shallow {
        let result = limit_idle();
        note(
            "shallow idle".to_owned(),
            match result {
                Ok(file) => {
                    idle_limit = Some(file);
                    Ok(())
                }
                Err(error) => Err(format!("/dev/cpu_dma_latency: {error}; it is writable for root only")),
            },
        );
    }
    // Last: from here on the thread can starve others.
    if let Some(priority) = wishes.fifo_priority {
        note(format!("SCHED_FIFO priority {priority}"), set_fifo(priority));
    }
    Granted { outcomes, _idle_limit: idle_limit }
}

fn set_fifo(priority: u8) -> Result<(), String> {
    if !(1..=99).contains(&priority) {
        return Err(format!("priority {priority} is outside of 1 to 99"));
    }
    // SAFETY: sched_param is plain data; thread 0 is the calling one.
    let result = unsafe {
        let mut parameters: libc::sched_param = std::mem::zeroed();
        parameters.sched_priority = i32::from(priority);
        libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters)
    };
    if result == 0 {
        return Ok(());
    }
    let error = io::Error::last_os_error();
    Err(match error.raw_os_error() {
        Some(libc::EPERM) => {
            "the capability CAP_SYS_NICE or an rtprio limit is missing; grant it with `sudo setcap \
             cap_net_raw,cap_sys_nice,cap_ipc_lock=ep <program>` or a line `@realtime - rtprio 90` in \
             /etc/security/limits.conf"
                .to_owned()
        }
        _ => error.to_string(),
    })
}

fn lock_advice(error: io::Error) -> String {
    match error.raw_os_error() {
        Some(libc::EPERM | libc::ENOMEM) => "the memlock limit is too low; grant CAP_IPC_LOCK with `sudo setcap \
             cap_net_raw,cap_sys_nice,cap_ipc_lock=ep <program>` or a line `@realtime - memlock unlimited` in \
             /etc/security/limits.conf"
            .to_owned(),
        _ => error.to_string(),
    }
}

fn pin(cpu: usize) -> Result<(), String> {
    if cpu >= CpuSet::MAX_CPU {
        return Err(format!("CPU {cpu} is beyond {}", CpuSet::MAX_CPU - 1));
    }
    let mut set = CpuSet::new();
    set.set(cpu);
    sched_setaffinity(None, &set).map_err(|error| {
        let there = std::thread::available_parallelism().map_or(1, usize::from);
        format!("{error}; {there} CPUs can be used here")
    })
}

fn limit_idle() -> io::Result<File> {
    let mut file = File::options().write(true).open("/dev/cpu_dma_latency")?;
    file.write_all(&0i32.to_ne_bytes())?;
    Ok(file)
}

#[inline(never)]
fn touch_stack() {
    let mut ahead = [0u8; STACK_AHEAD];
    for page in ahead.chunks_mut(4096) {
        page[0] = 1;
    }
    std::hint::black_box(&ahead);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nothing() -> Wishes {
        Wishes { fifo_priority: None, memory: Memory::AsIs, cpu: None, idle: Idle::AsIs }
    }

    #[test]
    fn no_wish_no_outcome() {
        assert!(apply(&nothing()).outcomes.is_empty());
    }

    #[test]
    fn impossible_wishes_are_refused_in_words() {
        let granted = apply(&Wishes { fifo_priority: Some(100), cpu: Some(1023), ..nothing() });
        let words: Vec<String> = granted.refused().map(ToString::to_string).collect();
        assert_eq!(words.len(), 2, "{words:?}");
        assert!(words[0].starts_with("CPU 1023: REFUSED, "), "{words:?}");
        assert!(words[1].contains("outside of 1 to 99"), "{words:?}");
    }

    #[test]
    fn timers_are_exact_in_threads_started_later() {
        let slack = || {
            // SAFETY: no pointers.
            unsafe { libc::prctl(libc::PR_GET_TIMERSLACK) }
        };
        let seen = std::thread::spawn(move || {
            exact_timers();
            std::thread::spawn(slack).join().unwrap()
        });
        assert_eq!(seen.join().unwrap(), 1);
    }

    #[test]
    fn each_wish_has_an_outcome() {
        let outcomes = std::thread::spawn(|| apply(&Wishes::default()).outcomes).join().unwrap();
        let wishes: Vec<&str> = outcomes.iter().map(|outcome| outcome.wish.as_str()).collect();
        assert_eq!(wishes, ["locked memory", "shallow idle", "SCHED_FIFO priority 80"]);
    }
}
