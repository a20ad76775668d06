//! The kernel: how it schedules, what moves memory, and how time is read.

use super::machine::chosen;
use super::{Finding, How, Machine, Mend};

/// All findings about the kernel.
pub(super) fn examine(machine: &Machine) -> Vec<Finding> {
    vec![
        preemption(machine),
        throttling(machine),
        clock_source(machine),
        huge_pages(machine),
        page_movers(machine),
    ]
}

const PREEMPT_FILE: &str = "/sys/kernel/debug/sched/preempt";

fn preemption(machine: &Machine) -> Finding {
    const CHECK: &str = "preemption";
    const WHY: &str = "a kernel that can't be interrupted anywhere lets a due cycle wait for whatever system call or \
                       interrupt another program is in: tens of microseconds with full preemption, milliseconds \
                       without";
    const RT: &str = "install a PREEMPT_RT kernel: on Debian `sudo apt install linux-image-rt-amd64`, on Ubuntu \
                      `sudo pro enable realtime-kernel`";
    const REBOOT: How = How::ByHand("another kernel needs a reboot");
    let version = machine.text("/proc/version").unwrap_or_default();
    let has = |word: &str| version.split([' ', '(', ')']).any(|part| part == word);
    if machine.number("/sys/kernel/realtime") == Some(1) || has("PREEMPT_RT") {
        return Finding::good(
            CHECK,
            WHY,
            "PREEMPT_RT: the kernel itself can be interrupted nearly everywhere",
        );
    }
    let text = machine.text(PREEMPT_FILE);
    let option = machine.kernel_option("preempt");
    let mode = text.as_deref().and_then(|text| chosen(text, ['(', ')'])).or(option.as_deref());
    match (mode, has("PREEMPT_DYNAMIC"), has("PREEMPT")) {
        (Some("full"), ..) | (None, false, true) => {
            Finding::degraded(CHECK, WHY, "full preemption, but no PREEMPT_RT: interrupts still come first")
                .mended(RT, REBOOT)
        }
        (Some(mode), ..) => {
            let found = format!("preemption `{mode}`: a system call of any program delays the cycle");
            let finding = Finding::bad(CHECK, WHY, found);
            if text.is_some_and(|text| text.contains("full")) {
                let full = Mend::Write { path: PREEMPT_FILE.to_owned(), value: "full".to_owned() };
                let command = format!("{full}   (until the next boot; better: {RT})");
                finding.mended(command, How::Now(vec![full]))
            } else {
                let command = format!("kernel option preempt=full; better: {RT}");
                finding.mended(command, How::ByHand("kernel options need a reboot"))
            }
        }
        (None, true, _) => {
            let found = "PREEMPT_DYNAMIC without PREEMPT_RT; the mode can't be read here";
            let command = format!("kernel option preempt=full; better: {RT}");
            Finding::degraded(CHECK, WHY, found).mended(command, How::ByHand("kernel options need a reboot"))
        }
        (None, false, false) if version.is_empty() => Finding::unknown(CHECK, WHY, "no /proc/version"),
        (None, false, false) => Finding::bad(CHECK, WHY, "a kernel without preemption").mended(RT, REBOOT),
    }
}

fn throttling(machine: &Machine) -> Finding {
    const CHECK: &str = "real-time throttling";
    const WHY: &str = "where real-time threads use up their share of a period, the kernel stops them for the rest of \
                       it: 50 ms without a cycle by default. A cycle that sleeps stays far below its share; one \
                       that polls (--busy-poll) or a runaway thread does not";
    const RUNTIME: &str = "/proc/sys/kernel/sched_rt_runtime_us";
    let (runtime, period) =
        (machine.number(RUNTIME), machine.number("/proc/sys/kernel/sched_rt_period_us").unwrap_or(1_000_000));
    match runtime {
        None => Finding::unknown(CHECK, WHY, format!("no {RUNTIME}")),
        Some(runtime_us) if runtime_us < 0 || runtime_us >= period => {
            Finding::good(CHECK, WHY, "off: real-time threads are never stopped")
        }
        Some(0) => {
            let mend = Mend::Write { path: RUNTIME.to_owned(), value: "-1".to_owned() };
            Finding::bad(CHECK, WHY, "real-time threads get no time at all")
                .mended(mend.to_string(), How::Now(vec![mend]))
        }
        Some(runtime_us) => {
            let mend = Mend::Write { path: RUNTIME.to_owned(), value: "-1".to_owned() };
            let found = format!("real-time threads get {runtime_us} of each {period} us");
            Finding::degraded(CHECK, WHY, found).mended(mend.to_string(), How::Now(vec![mend]))
        }
    }
}

fn clock_source(machine: &Machine) -> Finding {
    const CHECK: &str = "clock source";
    const WHY: &str = "the cycle reads the clock several times; from the processor's own counter that takes 20 ns \
                       and no system call, from a chip on the board a microsecond and more each";
    const FOLDER: &str = "/sys/devices/system/clocksource/clocksource0";
    let Some(source) = machine.text(&format!("{FOLDER}/current_clocksource")) else {
        return Finding::unknown(CHECK, WHY, "the kernel names no clock source");
    };
    match source.as_str() {
        "tsc" | "arch_sys_counter" => {
            Finding::good(CHECK, WHY, format!("`{source}`: the processor's own counter"))
        }
        "kvm-clock" | "hyperv_clocksource_tsc_page" | "xen" => {
            Finding::degraded(CHECK, WHY, format!("`{source}`: this is a virtual machine")).mended(
                "run on the machine itself",
                How::ByHand("the host may take a virtual machine's processor away at any time"),
            )
        }
        other => Finding::bad(CHECK, WHY, format!("`{other}`: slow to read")).mended(
            "look why with `dmesg | grep -i tsc`; where the counter is known to be steady: kernel option tsc=reliable",
            How::ByHand("the kernel may have had a reason to distrust the processor's counter"),
        ),
    }
}

fn huge_pages(machine: &Machine) -> Finding {
    const CHECK: &str = "transparent huge pages";
    const WHY: &str = "the kernel joins small pages behind the program's back; an access meanwhile waits, locked \
                       memory or not";
    const FILE: &str = "/sys/kernel/mm/transparent_hugepage/enabled";
    let text = machine.text(FILE);
    match text.as_deref().and_then(|text| chosen(text, ['[', ']'])) {
        None => Finding::good(CHECK, WHY, "this kernel has none"),
        Some("always") => {
            let mend = Mend::Write { path: FILE.to_owned(), value: "madvise".to_owned() };
            Finding::degraded(CHECK, WHY, "for every program").mended(mend.to_string(), How::Now(vec![mend]))
        }
        Some(mode) => Finding::good(CHECK, WHY, format!("`{mode}`: not for this program")),
    }
}

fn page_movers(machine: &Machine) -> Finding {
    const CHECK: &str = "moved pages";
    const WHY: &str = "locked pages are never swapped out, but the kernel may move them to other places to tidy up \
                       (compaction) or to bring them nearer (NUMA balancing); an access meanwhile waits";
    let files = ["/proc/sys/vm/compact_unevictable_allowed", "/proc/sys/kernel/numa_balancing"];
    let known: Vec<_> = files.iter().filter_map(|file| Some((*file, machine.number(file)?))).collect();
    let on: Vec<&str> = known.iter().filter(|(_, value)| *value != 0).map(|(file, _)| *file).collect();
    if known.is_empty() {
        return Finding::unknown(CHECK, WHY, "the kernel doesn't say");
    }
    if on.is_empty() {
        return Finding::good(CHECK, WHY, "locked pages stay where they are");
    }
    let zero = |file: &&str| Mend::Write { path: (*file).to_owned(), value: "0".to_owned() };
    let mends: Vec<Mend> = on.iter().map(zero).collect();
    let words: Vec<String> = mends.iter().map(Mend::to_string).collect();
    Finding::degraded(CHECK, WHY, format!("allowed by {}", on.join(" and ")))
        .mended(words.join("; "), How::Now(mends))
}
