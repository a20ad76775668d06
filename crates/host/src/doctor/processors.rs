//! The processors: their frequency, their sleep, who else runs on them.

use super::machine::cpu_list;
use super::{Finding, How, Machine, Mend};

/// All findings about the processors.
pub(super) fn examine(machine: &Machine) -> Vec<Finding> {
    vec![hypervisor(machine), governor(machine), idle(machine), isolation(machine), siblings(machine)]
}

const CPUS: &str = "/sys/devices/system/cpu";

fn hypervisor(machine: &Machine) -> Finding {
    const CHECK: &str = "machine";
    const WHY: &str = "the host of a virtual machine takes its processors away whenever it likes, for milliseconds; \
                       no setting inside can forbid it";
    let text = machine.text("/proc/cpuinfo").unwrap_or_default();
    let mut flags = text.lines().filter(|line| line.starts_with("flags"));
    if text.is_empty() {
        return Finding::unknown(CHECK, WHY, "no /proc/cpuinfo");
    }
    if flags.any(|line| line.split_whitespace().any(|flag| flag == "hypervisor")) {
        return Finding::degraded(CHECK, WHY, "a virtual one")
            .mended("run on the machine itself", How::ByHand("it is a matter of hardware"));
    }
    Finding::good(CHECK, WHY, "a real one, as far as it tells")
}

fn governor(machine: &Machine) -> Finding {
    const CHECK: &str = "frequency governor";
    const WHY: &str = "a processor that was clocked down computes the cycle two to four times slower, and takes tens \
                       of microseconds to speed up";
    let files = machine.cpus().into_iter().filter_map(|cpu| {
        let path = format!("{CPUS}/cpu{cpu}/cpufreq/scaling_governor");
        Some((machine.text(&path)?, path))
    });
    let files: Vec<(String, String)> = files.collect();
    if files.is_empty() {
        return Finding::unknown(
            CHECK,
            WHY,
            "the kernel has no say over the frequency (a virtual machine, or fixed)",
        );
    }
    let slow: Vec<&(String, String)> = files.iter().filter(|(name, _)| name != "performance").collect();
    let Some((first, _)) = slow.first() else {
        return Finding::good(CHECK, WHY, format!("`performance` on {} CPUs", files.len()));
    };
    let found = format!("`{first}` on {} of {} CPUs", slow.len(), files.len());
    let write =
        |(_, path): &&(String, String)| Mend::Write { path: path.clone(), value: "performance".to_owned() };
    Finding::degraded(CHECK, WHY, found).mended(
        format!("echo performance | sudo tee {CPUS}/cpu*/cpufreq/scaling_governor"),
        How::Now(slow.iter().map(write).collect()),
    )
}

/// A sleep from which waking takes longer than this is felt by a cycle, us.
const DEEP_US: i64 = 10;

fn idle(machine: &Machine) -> Finding {
    const CHECK: &str = "idle states";
    const WHY: &str = "a processor that sleeps deeply wakes late: the cycle begins by that much later, and the \
                       frame's interrupt is served by that much later";
    let driver = machine.text(&format!("{CPUS}/cpuidle/current_driver"));
    let states = machine.cpus().into_iter().flat_map(|cpu| {
        let folder = format!("{CPUS}/cpu{cpu}/cpuidle");
        let names = machine.names(&folder).into_iter().filter(|name| name.starts_with("state"));
        names.map(move |name| format!("{folder}/{name}")).collect::<Vec<_>>()
    });
    let enabled = states.filter(|state| machine.number(&format!("{state}/disable")) != Some(1));
    let deepest = enabled
        .filter_map(|state| {
            let name = machine.text(&format!("{state}/name")).unwrap_or_default();
            Some((machine.number(&format!("{state}/latency"))?, name))
        })
        .max();
    let Some((latency_us, name)) = deepest else {
        let driver = driver.as_deref().unwrap_or("none");
        return match machine.kernel_option("idle").as_deref() {
            Some("poll") => Finding::good(CHECK, WHY, "idle=poll: the processors never sleep"),
            _ => Finding::unknown(CHECK, WHY, format!("the kernel shows no idle states (driver `{driver}`)")),
        };
    };
    if latency_us <= DEEP_US {
        return Finding::good(CHECK, WHY, format!("the deepest, {name}, wakes within {latency_us} us"));
    }
    let options = "kernel options intel_idle.max_cstate=1 processor.max_cstate=1";
    let found = format!("down to {name}, which takes {latency_us} us to wake");
    if machine.may_write("/dev/cpu_dma_latency") {
        Finding::degraded(CHECK, WHY, format!("{found}, unless a program forbids it")).mended(
            format!(
                "`omnibase run --realtime` holds /dev/cpu_dma_latency at 0 while it runs; for good: {options}"
            ),
            How::WhileRunning,
        )
    } else {
        Finding::bad(CHECK, WHY, format!("{found}, and this user may not forbid it")).mended(
            format!("sudo chmod 666 /dev/cpu_dma_latency (or a udev rule for it); for good: {options}"),
            How::ByHand("who may keep the processors awake is for the machine's owner to say"),
        )
    }
}

fn isolation(machine: &Machine) -> Finding {
    const CHECK: &str = "isolated CPU";
    const WHY: &str = "on a CPU of its own no other program, no timer tick and no deferred kernel work comes between \
                       the cycle and its instant";
    let list = |path: &str| cpu_list(&machine.text(path).unwrap_or_default());
    let isolated = list(&format!("{CPUS}/isolated"));
    let tickless = list(&format!("{CPUS}/nohz_full"));
    let count = machine.cpus().len();
    let last = count.saturating_sub(1);
    let others = if last > 1 { format!("0-{}", last - 1) } else { "0".to_owned() };
    let command = format!(
        "kernel options isolcpus=domain,managed_irq,{last} nohz_full={last} rcu_nocbs={last} \
         irqaffinity={others}; then `omnibase run --realtime --cpu {last}`"
    );
    let reboot = How::ByHand("kernel options need a reboot");
    let both: Vec<String> =
        isolated.iter().filter(|cpu| tickless.contains(cpu)).map(ToString::to_string).collect();
    match (count, isolated.is_empty(), both.is_empty()) {
        (0, ..) => Finding::unknown(CHECK, WHY, "the kernel names no CPUs"),
        (1, ..) => Finding::degraded(CHECK, WHY, "there is one CPU alone: nothing can be kept from it")
            .mended("a machine with two CPUs or more", How::ByHand("it is a matter of hardware")),
        (_, true, _) => {
            Finding::degraded(CHECK, WHY, format!("none of {count} CPUs is isolated")).mended(command, reboot)
        }
        (_, false, true) => {
            let words: Vec<String> = isolated.iter().map(ToString::to_string).collect();
            Finding::degraded(
                CHECK,
                WHY,
                format!("CPU {} is isolated, but its timer ticks on", words.join(",")),
            )
            .mended(command, reboot)
        }
        (_, false, false) => Finding::good(CHECK, WHY, format!("CPU {}, without ticks", both.join(","))),
    }
}

fn siblings(machine: &Machine) -> Finding {
    const CHECK: &str = "hyper-threading";
    const WHY: &str = "two logical CPUs share one core's units and caches: work on the sibling slows the cycle down \
                       by up to a half, at any moment";
    match machine.text(&format!("{CPUS}/smt/active")).as_deref() {
        Some("0") => Finding::good(CHECK, WHY, "off, or not there"),
        Some("1") => Finding::degraded(CHECK, WHY, "on").mended(
            format!("echo off | sudo tee {CPUS}/smt/control (or in the BIOS; or isolate both siblings)"),
            How::ByHand("it takes half of the logical CPUs away from other programs"),
        ),
        _ => Finding::unknown(CHECK, WHY, "the kernel doesn't say"),
    }
}
