//! Giving a thread what the cycle needs: priority, memory that stays, a CPU, and a machine that wakes fast.
//!
//! Each wish is granted or refused on its own; a refusal says why and what to do, and nothing fails because of it.
//! Whether a refusal is acceptable is the caller's decision.

use rustix::mm::MlockAllFlags;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use rustix::time::{ClockId, clock_gettime};
use std::fmt;
use std::fs::File;
use std::io::{self, Read, Write};
use std::time::Duration;

/// What a thread wishes for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wishes {
    /// When it runs among other threads.
    pub scheduling: Scheduling,
    /// Whether all memory, present and future, is kept in RAM, and stack and heap are touched ahead.
    pub memory: Memory,
    /// The CPU to stay on; `None` keeps the affinity as it is.
    pub cpu: Option<usize>,
    /// Whether CPUs may fall asleep so deeply that they wake late.
    pub idle: Idle,
}

/// When a thread runs among others. Threads that it starts are ordinary ones again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheduling {
    /// As it is.
    AsIs,
    /// SCHED_FIFO with this priority, 1 to 99: before all of lower priority, for as long as it wants.
    Fifo(u8),
    /// SCHED_DEADLINE: before all others, but no longer than its budget in each period.
    Deadline {
        /// Budget, ns.
        runtime_ns: u64,
        /// Period, and deadline within it, ns.
        period_ns: u64,
    },
}

/// What happens with the process's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// Pages may be swapped and are mapped at their first use.
    AsIs,
    /// Pages are locked, and stack and heap are mapped ahead: no page fault in the cycle.
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
        Wishes { scheduling: Scheduling::Fifo(80), memory: Memory::Locked, cpu: None, idle: Idle::Shallow }
    }
}

/// One wish and what became of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// The wish, in words.
    pub wish: String,
    /// What the kernel says it is now, where it was granted; else why not and what to do.
    pub result: Result<String, String>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.result {
            Ok(found) => write!(f, "{}: granted, {found}", self.wish),
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

/// The CPU time that the calling thread has used so far.
pub fn thread_cpu_time() -> Duration {
    Duration::from_nanos(crate::clock::nanoseconds(clock_gettime(ClockId::ThreadCPUTime)))
}

/// Bytes of stack that are touched ahead; enough for a cycle, little against a thread's 2 MiB.
const STACK_AHEAD: usize = 256 * 1024;
/// Bytes of heap that are touched ahead and stay with the process: more than a run asks for after its set-up.
const HEAP_AHEAD: usize = 16 * 1024 * 1024;
/// What gives a program all rights that it needs: frames, priority, locked memory.
pub(crate) fn grant(program: &str) -> String {
    format!("sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep {program}")
}

/// Whose rights they are, where the program's own path doesn't matter.
const PROGRAM: &str = "<program>";

/// Applies `wishes` to the calling thread (memory and idle: to the whole process), and reads back what came of them.
///
/// Start other threads before: they would inherit the CPU.
pub fn apply(wishes: &Wishes) -> Granted {
    let mut outcomes = Vec::new();
    let mut note = |wish: String, result: Result<String, String>| outcomes.push(Outcome { wish, result });
    if wishes.memory == Memory::Locked {
        note("locked memory".to_owned(), lock_memory());
        touch_stack();
        touch_heap();
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
                Ok((file, found)) => {
                    idle_limit = Some(file);
                    Ok(found)
                }
                Err(error) => Err(format!(
                    "/dev/cpu_dma_latency: {error}; it is writable for root only, unless \
                     `sudo chmod 666 /dev/cpu_dma_latency` or a udev rule says otherwise"
                )),
            },
        );
    }
    // Last: from here on the thread can starve others.
    match wishes.scheduling {
        Scheduling::AsIs => {}
        Scheduling::Fifo(priority) => note(format!("SCHED_FIFO priority {priority}"), set_fifo(priority)),
        Scheduling::Deadline { runtime_ns, period_ns } => note(
            format!("SCHED_DEADLINE {} of {} us", runtime_ns / 1000, period_ns / 1000),
            set_deadline(runtime_ns, period_ns),
        ),
    }
    Granted { outcomes, _idle_limit: idle_limit }
}

fn set_fifo(priority: u8) -> Result<String, String> {
    if !(1..=99).contains(&priority) {
        return Err(format!("priority {priority} is outside of 1 to 99"));
    }
    let attributes =
        Attributes { policy: libc::SCHED_FIFO as u32, priority: u32::from(priority), ..Attributes::new() };
    attributes.set().map_err(|error| match error.raw_os_error() {
        Some(libc::EPERM) => format!(
            "the capability CAP_SYS_NICE or an rtprio limit is missing; grant it with `{}` or a line \
             `@realtime - rtprio 90` in /etc/security/limits.conf",
            grant(PROGRAM)
        ),
        _ => error.to_string(),
    })?;
    let found = Attributes::get().map_err(|error| error.to_string())?;
    if found.policy != attributes.policy || found.priority != attributes.priority {
        return Err(format!("the kernel says policy {} priority {} instead", found.policy, found.priority));
    }
    Ok(format!("read back as SCHED_FIFO {}", found.priority))
}

fn set_deadline(runtime_ns: u64, period_ns: u64) -> Result<String, String> {
    let attributes = Attributes {
        policy: SCHED_DEADLINE,
        runtime_ns,
        deadline_ns: period_ns,
        period_ns,
        ..Attributes::new()
    };
    attributes.set().map_err(|error| match error.raw_os_error() {
        Some(libc::EPERM) => format!(
            "the capability CAP_SYS_NICE is missing (grant it with `{}`; no limit stands in for it), or the \
             thread may not use all CPUs (leave out --cpu and taskset)",
            grant(PROGRAM)
        ),
        Some(libc::EBUSY) => "other threads under SCHED_DEADLINE have used up what \
             /proc/sys/kernel/sched_rt_runtime_us allows to all of them"
            .to_owned(),
        Some(libc::EINVAL) => format!(
            "the kernel takes no period of {} us: see /proc/sys/kernel/sched_deadline_period_min_us",
            period_ns / 1000
        ),
        _ => error.to_string(),
    })?;
    let found = Attributes::get().map_err(|error| error.to_string())?;
    if found.policy != SCHED_DEADLINE || (found.runtime_ns, found.period_ns) != (runtime_ns, period_ns) {
        return Err(format!("the kernel says policy {} instead", found.policy));
    }
    Ok("read back as SCHED_DEADLINE".to_owned())
}

/// `linux/sched.h`: the policy that libc lacks for some targets.
const SCHED_DEADLINE: u32 = 6;
/// `linux/sched.h`: threads that are started are ordinary ones. Under SCHED_DEADLINE none could be started without it.
const RESET_ON_FORK: u64 = 1;

/// `struct sched_attr` of `linux/sched/types.h`, in its first version.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
struct Attributes {
    size: u32,
    policy: u32,
    flags: u64,
    nice: i32,
    priority: u32,
    runtime_ns: u64,
    deadline_ns: u64,
    period_ns: u64,
}

impl Attributes {
    fn new() -> Self {
        Attributes { size: size_of::<Self>() as u32, flags: RESET_ON_FORK, ..Attributes::default() }
    }

    /// Gives them to the calling thread.
    fn set(&self) -> io::Result<()> {
        // SAFETY: a live structure whose size stands in it; thread 0 is the calling one, flags have to be 0.
        let result = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, self as *const Self, 0) };
        if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
    }

    /// Those of the calling thread.
    fn get() -> io::Result<Self> {
        let mut found = Attributes::new();
        // SAFETY: a live structure and its size; the kernel writes no more than that.
        let result =
            unsafe { libc::syscall(libc::SYS_sched_getattr, 0, &raw mut found, size_of::<Self>() as u32, 0) };
        if result == 0 { Ok(found) } else { Err(io::Error::last_os_error()) }
    }
}

fn lock_memory() -> Result<String, String> {
    rustix::mm::mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
        .map_err(|error| lock_advice(error.into()))?;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let locked_kib = status
        .lines()
        .find_map(|line| line.strip_prefix("VmLck:")?.trim().strip_suffix(" kB")?.parse::<u64>().ok());
    match locked_kib {
        Some(0) => Err("the kernel took it and locked nothing".to_owned()),
        Some(kib) => Ok(format!("read back as {} MiB locked, stack and heap touched ahead", kib >> 10)),
        None => Ok("stack and heap touched ahead".to_owned()),
    }
}

fn lock_advice(error: io::Error) -> String {
    match error.raw_os_error() {
        Some(libc::EPERM | libc::ENOMEM) => format!(
            "the memlock limit is too low; grant CAP_IPC_LOCK with `{}` or a line \
             `@realtime - memlock unlimited` in /etc/security/limits.conf",
            grant(PROGRAM)
        ),
        _ => error.to_string(),
    }
}

fn pin(cpu: usize) -> Result<String, String> {
    if cpu >= CpuSet::MAX_CPU {
        return Err(format!("CPU {cpu} is beyond {}", CpuSet::MAX_CPU - 1));
    }
    let mut set = CpuSet::new();
    set.set(cpu);
    sched_setaffinity(None, &set).map_err(|error| {
        let there = std::thread::available_parallelism().map_or(1, usize::from);
        format!("{error}; {there} CPUs can be used here")
    })?;
    let found = sched_getaffinity(None).map_err(|error| error.to_string())?;
    if found.count() != 1 || !found.is_set(cpu) {
        return Err(format!("the kernel says {} CPUs instead", found.count()));
    }
    Ok(format!("read back as CPU {cpu} alone"))
}

fn limit_idle() -> io::Result<(File, String)> {
    let mut file = File::options().read(true).write(true).open("/dev/cpu_dma_latency")?;
    file.write_all(&0i32.to_ne_bytes())?;
    let mut found = [0; 4];
    file.read_exact(&mut found)?;
    match i32::from_ne_bytes(found) {
        0 => Ok((file, "read back as 0 us".to_owned())),
        other => Err(io::Error::other(format!("the kernel says {other} us instead of 0"))),
    }
}

#[inline(never)]
fn touch_stack() {
    let mut ahead = [0u8; STACK_AHEAD];
    for page in ahead.chunks_mut(4096) {
        page[0] = 1;
    }
    std::hint::black_box(&ahead);
}

/// Grows the heap now, so that what is asked for later finds pages that are there already.
fn touch_heap() {
    #[cfg(target_env = "gnu")]
    // SAFETY: numbers only. Memory that is freed stays with the process, and large pieces come from the heap too.
    unsafe {
        libc::mallopt(libc::M_TRIM_THRESHOLD, -1);
        libc::mallopt(libc::M_MMAP_MAX, 0);
    }
    let mut ahead = vec![0u8; HEAP_AHEAD];
    for page in ahead.chunks_mut(4096) {
        page[0] = 1;
    }
    std::hint::black_box(&ahead);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nothing() -> Wishes {
        Wishes { scheduling: Scheduling::AsIs, memory: Memory::AsIs, cpu: None, idle: Idle::AsIs }
    }

    #[test]
    fn no_wish_no_outcome() {
        assert!(apply(&nothing()).outcomes.is_empty());
    }

    #[test]
    fn impossible_wishes_are_refused_in_words() {
        let granted = apply(&Wishes { scheduling: Scheduling::Fifo(100), cpu: Some(1023), ..nothing() });
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

    /// What is granted was read back; what is refused says what to do. Whether it is granted is this machine's say.
    #[test]
    fn threads_that_are_started_later_are_ordinary() {
        let schedulings =
            [Scheduling::Fifo(10), Scheduling::Deadline { runtime_ns: 200_000, period_ns: 10_000_000 }];
        for scheduling in schedulings {
            let seen = std::thread::spawn(move || {
                let granted = apply(&Wishes { scheduling, ..nothing() });
                let of_child = std::thread::spawn(|| Attributes::get().unwrap().policy).join().unwrap();
                (granted.outcomes, of_child)
            });
            let (outcomes, of_child) = seen.join().unwrap();
            assert_eq!((outcomes.len(), of_child), (1, 0), "{outcomes:?}");
            match &outcomes[0].result {
                Ok(found) => assert!(found.starts_with("read back as SCHED_"), "{found}"),
                Err(reason) => {
                    eprintln!("SKIPPED: {scheduling:?} is not granted here: {reason}");
                    assert!(reason.len() > 20, "what to do? {reason}");
                }
            }
        }
    }

    #[test]
    fn a_period_that_the_kernel_does_not_take_is_refused_in_words() {
        let scheduling = Scheduling::Deadline { runtime_ns: 1, period_ns: 2 };
        let granted = std::thread::spawn(move || apply(&Wishes { scheduling, ..nothing() })).join().unwrap();
        let words: Vec<String> = granted.refused().map(ToString::to_string).collect();
        assert!(words.len() == 1 && words[0].starts_with("SCHED_DEADLINE 0 of 0 us: REFUSED, "), "{words:?}");
    }

    #[test]
    fn cpu_time_passes_while_a_thread_works() {
        let before = thread_cpu_time();
        let mut sum = 0u64;
        while thread_cpu_time() == before {
            sum = std::hint::black_box(sum + 1);
        }
        assert!(thread_cpu_time() > before);
    }

    #[test]
    fn each_wish_has_an_outcome() {
        let outcomes = std::thread::spawn(|| apply(&Wishes::default()).outcomes).join().unwrap();
        let wishes: Vec<&str> = outcomes.iter().map(|outcome| outcome.wish.as_str()).collect();
        assert_eq!(wishes, ["locked memory", "shallow idle", "SCHED_FIFO priority 80"]);
    }
}
