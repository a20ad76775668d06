//! The network interface: card, interrupts, and everything with which it saves work at the cost of time.

use super::machine::cpu_list;
use super::{Finding, How, Machine, Mend, NicSetting};
use crate::ethtool::{self, EthtoolError};
use crate::interface::{self, LinkState};

/// What a network interface says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nic {
    /// Its name.
    pub name: String,
    /// Whether it is there, switched on and connected.
    pub link: LinkState,
    /// Its driver; `None` where it doesn't say.
    pub driver: Option<String>,
    /// Its settings, as far as the driver has them.
    pub settings: Vec<(NicSetting, u32)>,
    /// Settings that couldn't be read although the driver may have them, each with the reason.
    pub refused: Vec<(NicSetting, EthtoolError)>,
}

impl Nic {
    /// Asks the interface `name`; needs no rights.
    pub fn ask(name: &str) -> Self {
        use NicSetting::{
            AdaptiveReceive, AdaptiveSend, EnergyEfficient, LargeReceiveOffload, ReceiveDelay,
            ReceiveOffload, SendDelay,
        };
        let all = [
            ReceiveDelay,
            SendDelay,
            AdaptiveReceive,
            AdaptiveSend,
            ReceiveOffload,
            LargeReceiveOffload,
            EnergyEfficient,
        ];
        let (mut settings, mut refused) = (Vec::new(), Vec::new());
        for setting in all {
            match ethtool::get(name, setting) {
                Ok(value) => settings.push((setting, value)),
                Err(EthtoolError::Unsupported { .. }) => {}
                Err(error) => refused.push((setting, error)),
            }
        }
        Nic {
            name: name.to_owned(),
            link: interface::link_state(name),
            driver: ethtool::driver(name),
            settings,
            refused,
        }
    }

    fn setting(&self, wanted: NicSetting) -> Option<u32> {
        self.settings.iter().find(|(setting, _)| *setting == wanted).map(|(_, value)| *value)
    }

    /// Of these settings those that aren't 0, as changes that make them so.
    fn zeroed(&self, settings: &[NicSetting]) -> Vec<Mend> {
        let on = settings.iter().filter(|setting| self.setting(**setting).is_some_and(|value| value != 0));
        on.map(|setting| Mend::Nic { interface: self.name.clone(), setting: *setting, value: 0 }).collect()
    }
}

/// All findings about the interface.
pub(super) fn examine(machine: &Machine, nic: &Nic) -> Vec<Finding> {
    let link = link(machine, nic);
    if nic.link == LinkState::Missing {
        return vec![link];
    }
    vec![
        link,
        driver(machine, nic),
        interrupts(machine, nic),
        coalescing(nic),
        offloads(nic),
        energy(nic),
        other_traffic(machine, nic),
    ]
}

fn folder(nic: &Nic) -> String {
    format!("/sys/class/net/{}", nic.name)
}

fn link(machine: &Machine, nic: &Nic) -> Finding {
    const CHECK: &str = "link";
    const WHY: &str = "EtherCAT is 100 Mbit/s full duplex on a cable that nobody else uses";
    let name = &nic.name;
    match nic.link {
        LinkState::Missing => {
            let there = interface::names().join(", ");
            return Finding::bad(CHECK, WHY, format!("no network interface `{name}`; there are: {there}"))
                .mended("ip link", How::ByHand("name one that exists"));
        }
        LinkState::Off => {
            return Finding::bad(CHECK, WHY, format!("`{name}` is switched off")).mended(
                format!("sudo ip link set {name} up"),
                How::ByHand("switching an interface on may connect this machine to a network"),
            );
        }
        LinkState::NoCarrier => {
            return Finding::bad(CHECK, WHY, format!("nothing answers at the other end of `{name}`'s cable"))
                .mended(
                    "plug the cable into the first SubDevice, and switch that on",
                    How::ByHand("it is a cable"),
                );
        }
        LinkState::Up => {}
    }
    let speed = machine.number(&format!("{}/speed", folder(nic))).filter(|speed| *speed > 0);
    let duplex = machine.text(&format!("{}/duplex", folder(nic))).unwrap_or_default();
    match (speed, duplex.as_str()) {
        (Some(100), "full") => Finding::good(CHECK, WHY, "up, 100 Mbit/s, full duplex"),
        (Some(speed), "full") => Finding::degraded(CHECK, WHY, format!("up, but at {speed} Mbit/s")).mended(
            "is that a switch or another computer? SubDevices speak 100 Mbit/s",
            How::ByHand("it is a cable"),
        ),
        (Some(speed), duplex) => Finding::bad(CHECK, WHY, format!("up, at {speed} Mbit/s, {duplex} duplex"))
            .mended(
                format!("sudo ethtool -s {name} speed 100 duplex full autoneg on"),
                How::ByHand("a cable or a plug may be broken"),
            ),
        (None, _) => Finding::unknown(CHECK, WHY, "up; the interface tells no speed (a virtual one)"),
    }
}

/// Drivers of wired cards that hand each frame over at once when told to.
const FIT: [&str; 11] =
    ["igb", "igc", "e1000e", "e1000", "ice", "i40e", "ixgbe", "stmmac", "macb", "fec", "bcmgenet"];
/// Drivers that work, with more or less of a delay of their own.
const USABLE: [&str; 7] = ["r8169", "r8168", "r8125", "tg3", "bnx2", "atlantic", "mvneta"];
/// Drivers of interfaces that aren't hardware.
const VIRTUAL: [&str; 9] =
    ["veth", "virtio_net", "vmxnet3", "hv_netvsc", "xen-netfront", "tun", "bridge", "ifb", "dummy"];

fn driver(machine: &Machine, nic: &Nic) -> Finding {
    const CHECK: &str = "network driver";
    const WHY: &str = "each frame passes the driver twice a cycle; adapters on USB add a quarter of a millisecond \
                       that varies, wireless and virtual ones have no bound at all";
    let by_hand = || How::ByHand("it is a matter of hardware");
    let card = "a PCI Express card with Intel I210, I225 or I226";
    let device = machine.resolved(&format!("{}/device", folder(nic))).unwrap_or_default();
    let name = machine.link_name(&format!("{}/device/driver", folder(nic))).or_else(|| nic.driver.clone());
    let name = name.as_deref().unwrap_or("none");
    let wireless =
        ["wireless", "phy80211"].iter().any(|part| machine.has(&format!("{}/{part}", folder(nic))));
    if wireless {
        return Finding::bad(CHECK, WHY, format!("`{name}`: wireless")).mended(card, by_hand());
    }
    if device.contains("/usb") {
        return Finding::bad(CHECK, WHY, format!("`{name}`: on USB")).mended(card, by_hand());
    }
    if FIT.contains(&name) {
        return Finding::good(CHECK, WHY, format!("`{name}`"));
    }
    if VIRTUAL.contains(&name) {
        return Finding::degraded(CHECK, WHY, format!("`{name}`: virtual, for tests and simulation"))
            .mended(card, by_hand());
    }
    if USABLE.contains(&name) {
        return Finding::degraded(CHECK, WHY, format!("`{name}`: works, with a delay of its own"))
            .mended(card, by_hand());
    }
    Finding::unknown(
        CHECK,
        WHY,
        format!("`{name}`: nothing is known of it here; measure with `omnibase exchange`"),
    )
}

/// The interrupts that belong to the interface, by its device's list or by their names.
fn interrupt_numbers(machine: &Machine, nic: &Nic) -> Vec<u32> {
    let listed = machine.names(&format!("{}/device/msi_irqs", folder(nic)));
    let listed: Vec<u32> = listed.iter().filter_map(|name| name.parse().ok()).collect();
    if !listed.is_empty() {
        return listed;
    }
    let device = machine.link_name(&format!("{}/device", folder(nic)));
    let table = machine.text("/proc/interrupts").unwrap_or_default();
    let ours = |word: &str| {
        let belongs =
            |name: &str| word.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('-'));
        belongs(&nic.name) || device.as_deref().is_some_and(belongs)
    };
    let lines = table.lines().filter_map(|line| line.split_once(':'));
    let number = |(number, rest): (&str, &str)| {
        let is_ours = rest.split([' ', ',']).any(ours) && !rest.trim_end().ends_with("-config");
        number.trim().parse().ok().filter(|_| is_ours)
    };
    lines.filter_map(number).collect()
}

fn interrupts(machine: &Machine, nic: &Nic) -> Finding {
    const CHECK: &str = "interrupts of the card";
    const WHY: &str = "a frame is there when its interrupt has been served: by a CPU that is busy, asleep or \
                       changing from moment to moment that varies";
    let numbers = interrupt_numbers(machine, nic);
    if numbers.is_empty() {
        return Finding::unknown(CHECK, WHY, "the interface has no interrupts of its own (a virtual one)");
    }
    let isolated = cpu_list(&machine.text("/sys/devices/system/cpu/isolated").unwrap_or_default());
    let mut wandering = Vec::new();
    let mut serving = Vec::new();
    for number in &numbers {
        let of = |file: &str| machine.text(&format!("/proc/irq/{number}/{file}"));
        let allowed = cpu_list(&of("smp_affinity_list").unwrap_or_default());
        let effective = of("effective_affinity_list").map_or_else(|| allowed.clone(), |text| cpu_list(&text));
        serving.extend(effective.first().copied());
        if allowed.len() > 1 {
            let cpu = isolated.first().or(effective.first()).copied().unwrap_or(0);
            wandering.push(Mend::Write {
                path: format!("/proc/irq/{number}/smp_affinity_list"),
                value: cpu.to_string(),
            });
        }
    }
    serving.sort_unstable();
    serving.dedup();
    let words = |numbers: &[u32]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let served = serving.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let numbers = words(&numbers);
    let is_process = |name: &String| name.bytes().all(|byte| byte.is_ascii_digit());
    let mut processes = machine.names("/proc").into_iter().filter(is_process);
    let balanced = processes
        .any(|process| machine.text(&format!("/proc/{process}/comm")).as_deref() == Some("irqbalance"));
    if balanced {
        return Finding::degraded(
            CHECK,
            WHY,
            format!("{numbers} on CPU {served}, moved about by irqbalance"),
        )
        .mended(
            "sudo systemctl disable --now irqbalance, then ask again",
            How::ByHand("it serves other devices of this machine too"),
        );
    }
    if wandering.is_empty() {
        return Finding::good(CHECK, WHY, format!("{numbers}, each bound to one CPU: {served}"));
    }
    let commands: Vec<String> = wandering.iter().map(Mend::to_string).collect();
    Finding::degraded(CHECK, WHY, format!("{numbers} on CPU {served}, not bound to it"))
        .mended(commands.join("; "), How::Now(wandering))
}

/// A finding about settings that should be 0.
fn zero_settings(nic: &Nic, check: &'static str, why: &'static str, settings: &[NicSetting]) -> Finding {
    let known: Vec<String> = settings
        .iter()
        .filter_map(|setting| Some(format!("{} {}", setting.name(), setting.value(nic.setting(*setting)?))))
        .collect();
    let mends = nic.zeroed(settings);
    let refused = nic.refused.iter().filter(|(setting, _)| settings.contains(setting));
    let refused: Vec<String> = refused.map(|(_, error)| error.to_string()).collect();
    if mends.is_empty() && !refused.is_empty() {
        let how =
            How::ByHand("a right may be missing, or the driver fails: its manual says whether it has this");
        let command = format!("sudo omnibase doctor {}", nic.name);
        return Finding::unknown(check, why, refused.join(", ")).mended(command, how);
    }
    if known.is_empty() {
        return Finding::good(check, why, "the driver has no such thing");
    }
    if mends.is_empty() {
        return Finding::good(check, why, known.join(", "));
    }
    let commands: Vec<String> = mends.iter().map(Mend::to_string).collect();
    Finding::degraded(check, why, known.join(", ")).mended(commands.join("; "), How::Now(mends))
}

fn coalescing(nic: &Nic) -> Finding {
    const WHY: &str =
        "the card holds received frames back to save interrupts; each cycle waits that long for its own";
    let settings = [
        NicSetting::AdaptiveReceive,
        NicSetting::AdaptiveSend,
        NicSetting::ReceiveDelay,
        NicSetting::SendDelay,
    ];
    zero_settings(nic, "coalescing", WHY, &settings)
}

fn offloads(nic: &Nic) -> Finding {
    const WHY: &str = "the kernel or the card waits whether more frames come that could be joined to one; a cycle \
                       has but one";
    zero_settings(nic, "offloads", WHY, &[NicSetting::ReceiveOffload, NicSetting::LargeReceiveOffload])
}

fn energy(nic: &Nic) -> Finding {
    const WHY: &str = "Energy-Efficient Ethernet puts the line to sleep between two cycles; waking takes up to 30 us, \
                       and some SubDevices lose the link over it";
    zero_settings(nic, "energy-efficient Ethernet", WHY, &[NicSetting::EnergyEfficient])
}

fn other_traffic(machine: &Machine, nic: &Nic) -> Finding {
    const CHECK: &str = "other traffic";
    const WHY: &str = "every other frame on the cable delays the cycle's, and SubDevices pass it through all of them: \
                       IPv6 and network managers send some of their own accord";
    let path = format!("/proc/sys/net/ipv6/conf/{}/disable_ipv6", nic.name);
    let routes = machine.text("/proc/net/route").unwrap_or_default();
    let routed = routes.lines().any(|line| line.split_whitespace().next() == Some(nic.name.as_str()));
    if routed {
        return Finding::bad(CHECK, WHY, format!("`{}` carries a route: it is used as a network", nic.name))
            .mended(
                format!("sudo ip address flush dev {0}; sudo nmcli device set {0} managed no", nic.name),
                How::ByHand("this machine may be reached over it"),
            );
    }
    match machine.number(&path) {
        Some(0) => Finding::degraded(CHECK, WHY, "IPv6 is on: it sends frames of its own")
            .mended(format!("echo 1 | sudo tee {path}"), How::ByHand("this machine may be reached over it")),
        _ => Finding::good(CHECK, WHY, "none: no IPv6, no route"),
    }
}
