//! What this program may do here, started by this user.

use super::{Finding, How, Machine};

const CAP_NET_RAW: u32 = 13;
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;

/// Less than this can't hold a run with its recording, bytes.
const ENOUGH_LOCKED_BYTES: u64 = 512 << 20;
/// The least priority under SCHED_FIFO that stands above the kernel's interrupt threads (50).
const ENOUGH_PRIORITY: u64 = 51;

/// All findings about rights.
pub(super) fn examine(machine: &Machine) -> Vec<Finding> {
    let capabilities = machine.text("/proc/self/status").and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("CapEff:"))?;
        u64::from_str_radix(line.trim(), 16).ok()
    });
    let Some(capabilities) = capabilities else {
        let why =
            "without the rights to send frames, to come first and to lock memory there is no hard real time";
        return vec![Finding::unknown("rights", why, "/proc/self/status doesn't say")];
    };
    let may = |capability: u32| capabilities >> capability & 1 == 1;
    vec![
        frames(may(CAP_NET_RAW)),
        priority(may(CAP_SYS_NICE), limit(machine, "Max realtime priority")),
        locked_memory(may(CAP_IPC_LOCK), limit(machine, "Max locked memory")),
    ]
}

/// The soft limit of this name; `u64::MAX` for an unlimited one.
fn limit(machine: &Machine, name: &str) -> Option<u64> {
    let text = machine.text("/proc/self/limits")?;
    let words = text.lines().find_map(|line| line.strip_prefix(name))?;
    let soft = words.split_whitespace().next()?;
    if soft == "unlimited" { Some(u64::MAX) } else { soft.parse().ok() }
}

/// What gives all three rights to the program.
fn grant() -> String {
    let program =
        std::env::current_exe().map_or_else(|_| "<omnibase>".to_owned(), |path| path.display().to_string());
    crate::real_time::grant(&program)
}

const OWNER: How = How::ByHand("who may do what is for the machine's owner to say");

fn frames(granted: bool) -> Finding {
    const CHECK: &str = "right to send frames";
    const WHY: &str = "EtherCAT frames pass through a raw socket; without CAP_NET_RAW there is no bus";
    if granted {
        return Finding::good(CHECK, WHY, "CAP_NET_RAW");
    }
    Finding::bad(CHECK, WHY, "CAP_NET_RAW is missing").mended(grant(), OWNER)
}

fn priority(granted: bool, limit: Option<u64>) -> Finding {
    const CHECK: &str = "right to come first";
    const WHY: &str = "as an ordinary thread the cycle waits for its turn among all programs: milliseconds late \
                       whenever the machine is busy";
    match (granted, limit) {
        (true, _) => Finding::good(CHECK, WHY, "CAP_SYS_NICE"),
        (false, Some(limit)) if limit >= ENOUGH_PRIORITY => {
            Finding::good(CHECK, WHY, format!("SCHED_FIFO up to priority {limit} by the limit `rtprio`"))
        }
        (false, limit) => {
            let allowed = limit.map_or_else(|| "unknown".to_owned(), |limit| limit.to_string());
            Finding::bad(CHECK, WHY, format!("CAP_SYS_NICE is missing, and the limit `rtprio` is {allowed}"))
                .mended(
                    format!("{}, or a line `@realtime - rtprio 90` in /etc/security/limits.conf", grant()),
                    OWNER,
                )
        }
    }
}

fn locked_memory(granted: bool, limit: Option<u64>) -> Finding {
    const CHECK: &str = "right to lock memory";
    const WHY: &str = "a page that was swapped out or is used for the first time stops the cycle until it is there: \
                       microseconds from memory, milliseconds from a disk";
    match (granted, limit) {
        (true, _) => Finding::good(CHECK, WHY, "CAP_IPC_LOCK"),
        (false, Some(u64::MAX)) => Finding::good(CHECK, WHY, "no limit `memlock`"),
        (false, Some(bytes)) if bytes >= ENOUGH_LOCKED_BYTES => {
            Finding::good(CHECK, WHY, format!("the limit `memlock` is {} MiB", bytes >> 20))
        }
        (false, limit) => {
            let allowed = limit.map_or_else(|| "unknown".to_owned(), |bytes| format!("{} KiB", bytes >> 10));
            Finding::degraded(
                CHECK,
                WHY,
                format!("CAP_IPC_LOCK is missing, and the limit `memlock` is {allowed}"),
            )
            .mended(
                format!(
                    "{}, or a line `@realtime - memlock unlimited` in /etc/security/limits.conf",
                    grant()
                ),
                OWNER,
            )
        }
    }
}
