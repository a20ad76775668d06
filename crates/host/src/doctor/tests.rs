use super::*;
use crate::EthtoolError;
use crate::interface::LinkState;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// A made-up machine, gone with the value.
struct MadeUp {
    root: PathBuf,
}

static COUNT: AtomicU32 = AtomicU32::new(0);

impl MadeUp {
    fn with(files: &[(&str, &str)]) -> Self {
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let root = std::env::temp_dir().join(format!("omnibase-doctor-{}-{number}", std::process::id()));
        let made_up = MadeUp { root };
        fs::create_dir_all(&made_up.root).unwrap();
        files.iter().for_each(|(path, text)| made_up.put(path, text));
        made_up
    }

    fn put(&self, path: &str, text: &str) {
        let place = self.root.join(path.trim_start_matches('/'));
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::write(place, text).unwrap();
    }

    fn link(&self, path: &str, target: &str) {
        let place = self.root.join(path.trim_start_matches('/'));
        let target = self.root.join(target.trim_start_matches('/'));
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::create_dir_all(&target).unwrap();
        std::os::unix::fs::symlink(target, place).unwrap();
    }

    fn machine(&self) -> Machine {
        Machine::at(&self.root)
    }

    fn finding(&self, check: &str) -> Finding {
        find(&examine(&self.machine(), None), check)
    }
}

impl Drop for MadeUp {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.root);
    }
}

fn find(findings: &[Finding], check: &str) -> Finding {
    let found = findings.iter().find(|finding| finding.check == check);
    found.unwrap_or_else(|| panic!("no finding `{check}` in {findings:#?}")).clone()
}

const CPUS: &str = "/sys/devices/system/cpu";

/// A machine as it should be: two CPUs, one of them isolated.
fn fit() -> MadeUp {
    let made_up = MadeUp::with(&[
        ("/proc/version", "Linux version 6.12.9-rt1 (x@y) (gcc) #1 SMP PREEMPT_RT Mon"),
        ("/sys/kernel/realtime", "1\n"),
        ("/proc/cpuinfo", "processor : 0\nflags : fpu tsc\n"),
        ("/proc/cmdline", "quiet isolcpus=1 nohz_full=1"),
        ("/proc/sys/kernel/sched_rt_runtime_us", "-1\n"),
        ("/proc/sys/kernel/sched_rt_period_us", "1000000\n"),
        ("/proc/sys/vm/compact_unevictable_allowed", "0\n"),
        ("/sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never\n"),
        ("/sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
        ("/sys/devices/system/cpu/isolated", "1\n"),
        ("/sys/devices/system/cpu/nohz_full", "1\n"),
        ("/sys/devices/system/cpu/smt/active", "0\n"),
        ("/proc/self/status", "Name:\tx\nCapEff:\t0000000000806000\n"),
        (
            "/proc/self/limits",
            "Limit      Soft Limit  Hard Limit  Units\n\
             Max locked memory         8388608              8388608              bytes     \n\
             Max realtime priority     0                    0\n",
        ),
    ]);
    for cpu in 0..2 {
        made_up.put(&format!("{CPUS}/cpu{cpu}/cpufreq/scaling_governor"), "performance\n");
        made_up.put(&format!("{CPUS}/cpu{cpu}/cpuidle/state0/name"), "C1\n");
        made_up.put(&format!("{CPUS}/cpu{cpu}/cpuidle/state0/latency"), "2\n");
        made_up.put(&format!("{CPUS}/cpu{cpu}/cpuidle/state0/disable"), "0\n");
    }
    made_up
}

/// A card as it should be, on the isolated CPU of [`fit`].
fn fit_nic(made_up: &MadeUp) -> Nic {
    made_up.put("/sys/class/net/eth1/speed", "100\n");
    made_up.put("/sys/class/net/eth1/duplex", "full\n");
    made_up.link("/sys/class/net/eth1/device", "/sys/devices/pci0000:00/0000:01:00.0");
    made_up.link("/sys/devices/pci0000:00/0000:01:00.0/driver", "/sys/bus/pci/drivers/igb");
    made_up.put(
        "/proc/interrupts",
        "  CPU0 CPU1\n 44: 0 7 PCI-MSIX-0000:01:00.0 1-edge eth1-TxRx-0\n 45: 1 0 x eth11\n",
    );
    made_up.put("/proc/irq/44/smp_affinity_list", "1\n");
    made_up.put("/proc/irq/44/effective_affinity_list", "1\n");
    made_up.put("/proc/sys/net/ipv6/conf/eth1/disable_ipv6", "1\n");
    Nic {
        name: "eth1".to_owned(),
        link: LinkState::Up,
        driver: Some("igb".to_owned()),
        settings: vec![
            (NicSetting::ReceiveDelay, 0),
            (NicSetting::SendDelay, 0),
            (NicSetting::ReceiveOffload, 0),
            (NicSetting::EnergyEfficient, 0),
        ],
        refused: Vec::new(),
    }
}

#[test]
fn a_machine_as_it_should_be_has_only_good_findings() {
    let made_up = fit();
    let nic = fit_nic(&made_up);
    let findings = examine(&made_up.machine(), Some(&nic));
    assert_eq!(worst(&findings), Verdict::Good, "{findings:#?}");
    assert_eq!(findings.len(), 20);
    assert!(findings.iter().all(|finding| finding.remedy.is_none()));
    assert!(find(&findings, "interrupts of the card").found.starts_with("44, "), "eth11 is another card");
}

#[test]
fn an_empty_machine_is_unknown_and_breaks_nothing() {
    let nothing = MadeUp::with(&[]);
    let findings = examine(&nothing.machine(), None);
    assert_eq!(worst(&findings), Verdict::Unknown, "{findings:#?}");
}

/// One fault each: the file, its text, the check that finds it, its verdict.
#[test]
fn each_fault_is_found_by_its_check_alone() {
    let faults = [
        ("/proc/sys/kernel/sched_rt_runtime_us", "950000", "real-time throttling", Verdict::Degraded),
        ("/proc/sys/kernel/sched_rt_runtime_us", "0", "real-time throttling", Verdict::Bad),
        ("/proc/sys/vm/compact_unevictable_allowed", "1", "moved pages", Verdict::Degraded),
        ("/proc/sys/kernel/numa_balancing", "1", "moved pages", Verdict::Degraded),
        (
            "/sys/kernel/mm/transparent_hugepage/enabled",
            "[always] madvise never",
            "transparent huge pages",
            Verdict::Degraded,
        ),
        (
            "/sys/devices/system/clocksource/clocksource0/current_clocksource",
            "hpet",
            "clock source",
            Verdict::Bad,
        ),
        (
            "/sys/devices/system/clocksource/clocksource0/current_clocksource",
            "kvm-clock",
            "clock source",
            Verdict::Degraded,
        ),
        ("/proc/cpuinfo", "flags : fpu hypervisor tsc", "machine", Verdict::Degraded),
        ("/sys/devices/system/cpu/isolated", "", "isolated CPU", Verdict::Degraded),
        ("/sys/devices/system/cpu/nohz_full", "", "isolated CPU", Verdict::Degraded),
        ("/sys/devices/system/cpu/smt/active", "1", "hyper-threading", Verdict::Degraded),
        (
            "/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor",
            "powersave",
            "frequency governor",
            Verdict::Degraded,
        ),
        ("/sys/devices/system/cpu/cpu1/cpuidle/state0/latency", "133", "idle states", Verdict::Bad),
        ("/proc/self/status", "CapEff:\t0000000000804000", "right to send frames", Verdict::Bad),
        ("/proc/self/status", "CapEff:\t0000000000006000", "right to come first", Verdict::Bad),
        ("/proc/self/status", "CapEff:\t0000000000802000", "right to lock memory", Verdict::Degraded),
    ];
    for (path, text, check, verdict) in faults {
        let made_up = fit();
        made_up.put(path, text);
        let findings = examine(&made_up.machine(), None);
        let wrong: Vec<_> = findings.iter().filter(|finding| finding.verdict != Verdict::Good).collect();
        assert_eq!(wrong.len(), 1, "{path} = {text}: {wrong:#?}");
        assert_eq!((wrong[0].check, wrong[0].verdict), (check, verdict), "{path} = {text}");
        assert!(!wrong[0].why.is_empty() && !wrong[0].remedy.as_ref().unwrap().command.is_empty());
    }
}

#[test]
fn kernels_are_told_apart_by_their_preemption() {
    let kernels = [
        ("#1 SMP PREEMPT_RT", None, "", Verdict::Good),
        ("#1 SMP PREEMPT", None, "", Verdict::Degraded),
        ("#1 SMP PREEMPT_DYNAMIC", Some("none voluntary (full) lazy"), "", Verdict::Degraded),
        ("#1 SMP PREEMPT_DYNAMIC", Some("none (voluntary) full"), "", Verdict::Bad),
        ("#1 SMP PREEMPT_DYNAMIC", None, "", Verdict::Degraded),
        ("#1 SMP PREEMPT_DYNAMIC", None, "preempt=voluntary", Verdict::Bad),
        ("#1 SMP", None, "", Verdict::Bad),
    ];
    for (version, mode, option, verdict) in kernels {
        let made_up = fit();
        fs::remove_file(made_up.root.join("sys/kernel/realtime")).unwrap();
        made_up.put("/proc/version", &format!("Linux version 6.1 {version} Mon"));
        made_up.put("/proc/cmdline", option);
        if let Some(mode) = mode {
            made_up.put("/sys/kernel/debug/sched/preempt", mode);
        }
        let finding = made_up.finding("preemption");
        assert_eq!(finding.verdict, verdict, "{version} {mode:?} {option}: {finding:?}");
    }
}

#[test]
fn limits_stand_in_for_capabilities() {
    let made_up = fit();
    made_up.put("/proc/self/status", "CapEff:\t0000000000002000");
    made_up.put(
        "/proc/self/limits",
        "Max locked memory  unlimited unlimited bytes\nMax realtime priority 95 95",
    );
    assert_eq!(worst(&examine(&made_up.machine(), None)), Verdict::Good);
}

#[test]
fn deep_sleep_is_less_bad_where_a_run_may_forbid_it() {
    let made_up = fit();
    made_up.put("/sys/devices/system/cpu/cpu1/cpuidle/state0/latency", "133");
    made_up.put("/dev/cpu_dma_latency", "");
    let finding = made_up.finding("idle states");
    assert_eq!(finding.verdict, Verdict::Degraded);
    assert_eq!(finding.remedy.unwrap().how, How::WhileRunning);
}

#[test]
fn each_fault_of_a_card_is_found_by_its_check_alone() {
    type Edit = fn(&MadeUp, &mut Nic);
    let faults: [(&str, Verdict, Edit); 12] = [
        ("link", Verdict::Bad, |_, nic| nic.link = LinkState::NoCarrier),
        ("link", Verdict::Bad, |_, nic| nic.link = LinkState::Off),
        ("link", Verdict::Degraded, |made_up, _| made_up.put("/sys/class/net/eth1/speed", "1000")),
        ("link", Verdict::Bad, |made_up, _| made_up.put("/sys/class/net/eth1/duplex", "half")),
        ("network driver", Verdict::Bad, |made_up, _| made_up.put("/sys/class/net/eth1/wireless/x", "")),
        ("interrupts of the card", Verdict::Degraded, |made_up, _| {
            made_up.put("/proc/irq/44/smp_affinity_list", "0-1");
        }),
        ("interrupts of the card", Verdict::Degraded, |made_up, _| {
            made_up.put("/proc/71/comm", "irqbalance\n")
        }),
        ("coalescing", Verdict::Degraded, |_, nic| nic.settings[0].1 = 50),
        ("coalescing", Verdict::Degraded, |_, nic| nic.settings.push((NicSetting::AdaptiveReceive, 1))),
        ("offloads", Verdict::Degraded, |_, nic| nic.settings[2].1 = 1),
        ("energy-efficient Ethernet", Verdict::Degraded, |_, nic| nic.settings[3].1 = 1),
        ("other traffic", Verdict::Bad, |made_up, _| made_up.put("/proc/net/route", "Iface\tx\neth1\t0\n")),
    ];
    for (check, verdict, edit) in faults {
        let made_up = fit();
        let mut nic = fit_nic(&made_up);
        edit(&made_up, &mut nic);
        let findings = examine(&made_up.machine(), Some(&nic));
        let wrong: Vec<_> = findings.iter().filter(|finding| finding.verdict != Verdict::Good).collect();
        assert_eq!(wrong.len(), 1, "{check}: {wrong:#?}");
        assert_eq!((wrong[0].check, wrong[0].verdict), (check, verdict));
        assert!(!wrong[0].remedy.as_ref().unwrap().command.is_empty());
    }
}

#[test]
fn a_setting_that_cannot_be_read_is_unknown_and_not_good() {
    let checks = [
        ("coalescing", NicSetting::AdaptiveReceive),
        ("offloads", NicSetting::LargeReceiveOffload),
        ("energy-efficient Ethernet", NicSetting::EnergyEfficient),
    ];
    for code in [libc::EPERM, libc::EIO, libc::EINVAL] {
        for (check, setting) in checks {
            let made_up = fit();
            let mut nic = fit_nic(&made_up);
            nic.settings.retain(|(known, _)| *known != setting);
            let interface = nic.name.clone();
            nic.refused.push((setting, EthtoolError::Refused { interface, setting, code }));
            let finding = find(&examine(&made_up.machine(), Some(&nic)), check);
            assert_eq!(finding.verdict, Verdict::Unknown, "{check}: {}", finding.found);
            assert!(finding.found.contains("eth1"), "{}", finding.found);
        }
    }
    // What is known to be wrong outweighs what isn't known.
    let made_up = fit();
    let mut nic = fit_nic(&made_up);
    nic.settings[0].1 = 50;
    let (interface, setting) = (nic.name.clone(), NicSetting::SendDelay);
    nic.refused.push((setting, EthtoolError::Refused { interface, setting, code: libc::EIO }));
    assert_eq!(find(&examine(&made_up.machine(), Some(&nic)), "coalescing").verdict, Verdict::Degraded);
}

#[test]
fn an_interface_that_says_nothing_is_not_called_good() {
    let nic = Nic::ask("nope0");
    assert!(nic.settings.is_empty());
    assert_eq!(nic.refused.len(), 7, "{:?}", nic.refused);
}

#[test]
fn drivers_are_known_by_name_and_place() {
    let verdict = |driver: &str, device: &str| {
        let made_up = fit();
        let nic = fit_nic(&made_up);
        fs::remove_file(made_up.root.join("sys/class/net/eth1/device")).unwrap();
        made_up.link("/sys/class/net/eth1/device", device);
        made_up.link(&format!("{device}/driver"), &format!("/sys/bus/x/drivers/{driver}"));
        find(&examine(&made_up.machine(), Some(&nic)), "network driver").verdict
    };
    assert_eq!(verdict("igc", "/sys/devices/a"), Verdict::Good);
    assert_eq!(verdict("r8169", "/sys/devices/b"), Verdict::Degraded);
    assert_eq!(verdict("veth", "/sys/devices/c"), Verdict::Degraded);
    assert_eq!(verdict("r8152", "/sys/devices/pci0/usb2/2-1"), Verdict::Bad);
    assert_eq!(verdict("brand_new", "/sys/devices/d"), Verdict::Unknown);
}

#[test]
fn a_missing_interface_is_one_bad_finding_that_names_those_that_exist() {
    let made_up = fit();
    let nic = Nic { link: LinkState::Missing, ..fit_nic(&made_up) };
    let findings = examine(&made_up.machine(), Some(&nic));
    let wrong: Vec<_> = findings.iter().filter(|finding| finding.verdict != Verdict::Good).collect();
    assert_eq!(wrong.len(), 1, "{wrong:#?}");
    assert!(wrong[0].found.starts_with("no network interface `eth1`; there are: "), "{}", wrong[0].found);
}

#[test]
fn changes_are_made_read_back_and_undone() {
    let made_up = fit();
    let path = "/sys/kernel/mm/transparent_hugepage/enabled";
    let governor = "/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor";
    made_up.put(governor, "powersave\n");
    made_up.put(path, "[always] madvise never\n");
    let machine = made_up.machine();
    let before = examine(&machine, None);
    let mends = before.iter().filter_map(|finding| match &finding.remedy.as_ref()?.how {
        How::Now(mends) => Some(mends.clone()),
        _ => None,
    });
    let changes: Vec<Change> = mends.flatten().map(|mend| mend.apply(&machine).unwrap()).collect();
    assert_eq!(changes.len(), 2, "{changes:#?}");
    assert_eq!(worst(&examine_without_choices(&made_up)), Verdict::Good);
    let undo: Vec<String> = changes.iter().map(|change| change.undo.to_string()).collect();
    assert_eq!(
        undo,
        [format!("echo always | sudo tee {path}"), format!("echo powersave | sudo tee {governor}")]
    );
    for change in &changes {
        change.undo.apply(&machine).unwrap();
    }
    assert_eq!(fs::read_to_string(made_up.root.join(&governor[1..])).unwrap(), "powersave");
}

/// A made-up file doesn't keep its list of choices when written; the kernel does.
fn examine_without_choices(made_up: &MadeUp) -> Vec<Finding> {
    let path = "/sys/kernel/mm/transparent_hugepage/enabled";
    assert_eq!(fs::read_to_string(made_up.root.join(&path[1..])).unwrap(), "madvise");
    examine(&made_up.machine(), None)
}

#[test]
fn a_change_that_can_not_be_undone_or_made_is_refused() {
    let made_up = fit();
    let write = |path: &str| Mend::Write { path: path.to_owned(), value: "1".to_owned() };
    let missing = write("/proc/sys/none").apply(&made_up.machine());
    assert!(matches!(missing, Err(MendError::Unreadable(_))), "{missing:?}");
    assert!(!made_up.root.join("proc/sys/none").exists(), "nothing is made where nothing was");
    let nic = Mend::Nic { interface: "nope0".to_owned(), setting: NicSetting::ReceiveDelay, value: 0 };
    assert!(matches!(nic.apply(&made_up.machine()), Err(MendError::Ethtool(_))));
    assert_eq!(nic.to_string(), "sudo ethtool -C nope0 rx-usecs 0");
}

#[test]
fn lists_of_cpus_are_read_as_the_kernel_writes_them() {
    assert_eq!(machine::cpu_list("0,2-4"), [0, 2, 3, 4]);
    assert!(machine::cpu_list("").is_empty() && machine::cpu_list("x,-").is_empty());
    assert!(machine::cpu_list("0-18446744073709551615").len() <= 8192);
}

#[test]
fn this_machine_can_be_examined() {
    let findings = examine(&Machine::at(Path::new("/")), None);
    assert_eq!(findings.len(), 13, "{findings:#?}");
}
