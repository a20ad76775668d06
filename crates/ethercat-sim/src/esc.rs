//! One ESC: the chip between the frames and the firmware.
//!
//! Registers that only hold a value live in [`Esc`]'s memory as bytes; units that act ([`sync_manager`],
//! [`fmmu`], [`sii`], [`watchdog`], [`clock`], [`sync`]) hold their state decoded and take register writes over.
//! [`registers`](self) are reached from both sides through the same access map; what differs per side stands there.

mod access;
pub mod clock;
mod config;
mod datagram;
mod dc;
pub mod fmmu;
mod memory;
mod pdi_port;
mod registers;
pub mod sii;
pub mod sync;
pub mod sync_manager;
pub mod watchdog;

pub use config::{DcRegisters, EscConfig};
pub use datagram::Telegram;
pub use pdi_port::PdiPort;

use access::AccessMap;
use dc::DcUnit;
use fmmu::Fmmu;
use omnibase_ethercat_wire::bytes::{put_u16, put_u32, u16_at};
use omnibase_ethercat_wire::register::{self as reg, al_event};
use omnibase_ethercat_wire::{DcTime, HostTime};
use sii::{SiiTiming, SiiUnit};
use sync_manager::SyncManager;
use watchdog::Watchdog;
pub use watchdog::WatchdogExpiry;

/// Size of the register space; process-data memory follows.
pub(crate) const REGISTERS: usize = 0x1000;
/// From here on SyncManagers can guard addresses: the digital outputs (0x0F00), and all memory.
pub(crate) const GUARDED: usize = 0x0F00;
/// ECAT event request bit 2: DL status changed.
const ECAT_EVENT_DL_STATUS: u16 = 1 << 2;
/// DL status: the PDI watchdog runs.
const DL_STATUS_PDI_WATCHDOG: u16 = 1 << 1;
/// ECAT event request bit 3: AL status changed.
const ECAT_EVENT_AL_STATUS: u16 = 1 << 3;

/// What a port sees of the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortState {
    /// A powered partner is at the other end of a whole cable.
    pub link: bool,
    /// Frames turn back inside the chip instead of leaving here.
    pub closed: bool,
}

/// One ESC with its registers, memory and units.
#[derive(Debug)]
pub struct Esc {
    config: EscConfig,
    access: AccessMap,
    memory: Vec<u8>,
    sync_managers: Vec<SyncManager>,
    /// Those that are on, in the order of their registers.
    fmmus: Vec<Fmmu>,
    /// The logical bytes between which any FMMU is active.
    logical: core::ops::Range<u64>,
    sii: SiiUnit,
    watchdog: Watchdog,
    /// Counts down from the firmware's last access.
    pdi_watchdog: Watchdog,
    dc: Option<DcUnit>,
    ports: [PortState; 4],
    /// When the present frame reaches each port, ns from its arrival at the processing unit.
    port_arrivals: [Option<i64>; 4],
    station: u16,
    alias: Option<u16>,
    al_event: u32,
    /// AL events that run the firmware, as their register says.
    al_event_mask: u32,
    ecat_event: u16,
    /// ECAT events that the mask lets through, to be ORed into datagrams.
    irq: u16,
    /// The firmware has something new to look at.
    raised: bool,
    /// The loop control changed: frames go another way.
    loops_changed: bool,
    /// Ports that auto-close mode keeps closed until the MainDevice opens them.
    kept_closed: [bool; 4],
    device_emulation: bool,
}

impl Esc {
    /// A chip without power.
    pub fn new(mut config: EscConfig) -> Self {
        config.fmmu_count = config.fmmu_count.min(16);
        config.sm_count = config.sm_count.min(16);
        config.ram_kib = config.ram_kib.min(60);
        let timing = SiiTiming { read_ns: config.sii_read_ns, write_ns: config.sii_write_ns };
        let sii = SiiUnit::new(core::mem::take(&mut config.sii), timing);
        let mut esc = Esc {
            access: AccessMap::new(&config),
            memory: vec![0; REGISTERS + usize::from(config.ram_kib) * 1024],
            sync_managers: Vec::new(),
            fmmus: Vec::with_capacity(usize::from(config.fmmu_count)),
            logical: 0..0,
            sii,
            watchdog: Watchdog::default(),
            pdi_watchdog: Watchdog::default(),
            dc: None,
            ports: [PortState::default(); 4],
            port_arrivals: [None; 4],
            station: 0,
            alias: None,
            al_event: 0,
            al_event_mask: u32::MAX,
            ecat_event: 0,
            irq: 0,
            raised: false,
            loops_changed: false,
            kept_closed: [false; 4],
            device_emulation: false,
            config,
        };
        esc.power_on(HostTime(0));
        esc
    }

    /// What kind of chip it is; `sii` is empty there, [`Esc::sii_image`] has it.
    pub fn config(&self) -> &EscConfig {
        &self.config
    }

    /// The EEPROM's present content.
    pub fn sii_image(&self) -> &[u8] {
        self.sii.image()
    }

    /// Power comes: every register at its reset value, the configuration area loaded from the EEPROM.
    pub fn power_on(&mut self, now: HostTime) {
        let config = &self.config;
        self.memory.fill(0);
        self.memory[usize::from(reg::TYPE)] = config.esc_type;
        self.memory[usize::from(reg::REVISION)] = config.revision;
        put_u16(&mut self.memory, usize::from(reg::BUILD), config.build);
        self.memory[usize::from(reg::FMMU_COUNT)] = config.fmmu_count;
        self.memory[usize::from(reg::SM_COUNT)] = config.sm_count;
        self.memory[usize::from(reg::RAM_SIZE)] = config.ram_kib;
        self.memory[usize::from(reg::PORT_DESCRIPTOR)] = config.port_descriptor;
        put_u16(&mut self.memory, usize::from(reg::FEATURES), config.features);
        // Non-EtherCAT frames are destroyed, receive FIFO at its largest.
        put_u32(&mut self.memory, usize::from(reg::DL_CONTROL), 0x0007_0001);
        put_u16(&mut self.memory, usize::from(reg::AL_CONTROL), 1);
        put_u16(&mut self.memory, usize::from(reg::AL_STATUS), 1);
        put_u32(&mut self.memory, usize::from(reg::AL_EVENT_MASK), u32::MAX);
        self.al_event_mask = u32::MAX;
        put_u16(&mut self.memory, usize::from(reg::WATCHDOG_DIVIDER), watchdog::DIVIDER_DEFAULT);
        put_u16(&mut self.memory, usize::from(reg::WATCHDOG_PDI), watchdog::TIME_DEFAULT);
        put_u16(&mut self.memory, usize::from(reg::WATCHDOG_PROCESS_DATA), watchdog::TIME_DEFAULT);
        self.sync_managers.clear();
        self.sync_managers.extend((0..config.sm_count).map(SyncManager::new));
        self.fmmus.clear();
        self.logical = 0..0;
        self.watchdog = Watchdog::default();
        self.pdi_watchdog = Watchdog::default();
        self.dc = config.has(reg::FEATURE_DC).then(|| DcUnit::new(config, now.0));
        (self.station, self.alias) = (0, None);
        (self.al_event, self.ecat_event, self.irq) = (0, 0, 0);
        (self.raised, self.loops_changed) = (false, false);
        self.kept_closed = [false; 4];
        self.ports = [PortState::default(); 4];
        self.device_emulation = false;
        if let Some(area) = self.sii.power_on() {
            put_u16(&mut self.memory, usize::from(reg::STATION_ALIAS), u16_at(&area, 8));
            self.take_configuration(&area);
        }
        self.show_dc_registers();
    }

    /// The EEPROM's configuration area goes to the registers that it sets.
    fn take_configuration(&mut self, area: &[u8; 14]) {
        self.memory[usize::from(reg::PDI_CONTROL)..][..2].copy_from_slice(&area[0..2]);
        self.memory[0x0150..0x0152].copy_from_slice(&area[2..4]);
        self.memory[0x0152..0x0154].copy_from_slice(&area[6..8]);
        self.device_emulation = area[1] & 1 != 0;
        if self.config.has_system_time() {
            self.memory[usize::from(reg::DC_PULSE_LENGTH)..][..2].copy_from_slice(&area[4..6]);
        }
    }

    /// The distributed clock's system time at `now`; `None` without such a unit.
    pub fn system_time(&self, now: HostTime) -> Option<DcTime> {
        self.dc.as_ref().filter(|_| self.config.has_system_time()).map(|dc| DcTime(dc.system_time(now.0)))
    }

    /// The bytes of registers and memory from `address` on as they lie in the chip, without any effect; values
    /// that are computed when they are read (times, SII and SyncManager status) may be old.
    pub fn peek(&self, address: u16, length: usize) -> Option<&[u8]> {
        self.memory.get(usize::from(address)..usize::from(address) + length)
    }

    /// The AL event request word.
    pub fn al_event(&self) -> u32 {
        self.al_event
    }

    /// How the ports look.
    pub fn ports(&self) -> [PortState; 4] {
        self.ports
    }

    /// Sets AL events; the firmware will be run if its mask lets one through.
    fn raise(&mut self, events: u32) {
        self.al_event |= events;
        self.raised |= events & self.al_event_mask != 0;
    }

    /// Whether an event came since the last call.
    pub(crate) fn take_raised(&mut self) -> bool {
        core::mem::take(&mut self.raised)
    }

    /// Whether the loop control changed since the last call.
    pub(crate) fn take_loops_changed(&mut self) -> bool {
        core::mem::take(&mut self.loops_changed)
    }

    fn set_ecat_event(&mut self, event: u16, on: bool) {
        let events = if on { self.ecat_event | event } else { self.ecat_event & !event };
        if events != self.ecat_event {
            self.ecat_event = events;
            self.mask_ecat_events();
        }
    }

    fn mask_ecat_events(&mut self) {
        self.irq = self.ecat_event & u16_at(&self.memory, usize::from(reg::ECAT_EVENT_MASK));
    }

    /// Whether the loop at `port` is closed, by control, port descriptor, and whether frames pass there.
    pub(crate) fn loop_closed(&mut self, port: usize, passed: bool) -> bool {
        if !self.config.has_port(port as u8) {
            return true;
        }
        match self.memory[usize::from(reg::DL_CONTROL_PORTS)] >> (2 * port) & 3 {
            0 => !passed,
            1 => {
                self.kept_closed[port] |= !passed;
                self.kept_closed[port]
            }
            2 => false,
            _ => true,
        }
    }

    /// The ports changed: DL status, lost link counters and events follow.
    pub(crate) fn set_ports(&mut self, ports: [PortState; 4]) {
        let mut status = u16::from(self.sii.loaded());
        if self.pdi_watchdog.running() {
            status |= DL_STATUS_PDI_WATCHDOG;
        }
        for (n, port) in ports.iter().enumerate() {
            if port.link {
                status |= 1 << (4 + n);
                if !port.closed {
                    status |= 1 << (9 + 2 * n);
                }
            } else if self.ports[n].link {
                let counter = &mut self.memory[usize::from(reg::LOST_LINK_COUNTERS) + n];
                *counter = counter.saturating_add(1);
            }
            if port.closed {
                status |= 1 << (8 + 2 * n);
            }
        }
        self.ports = ports;
        if u16_at(&self.memory, usize::from(reg::DL_STATUS)) != status {
            put_u16(&mut self.memory, usize::from(reg::DL_STATUS), status);
            self.set_ecat_event(ECAT_EVENT_DL_STATUS, true);
        }
    }

    /// When a frame reaches the ports, relative to the processing unit.
    pub(crate) fn set_port_arrivals(&mut self, arrivals: [Option<i64>; 4]) {
        self.port_arrivals = arrivals;
    }

    /// A damaged frame arrived at `port`: here first, or forwarded with the mark of damage.
    pub(crate) fn count_damaged(&mut self, port: usize, forwarded: bool) {
        let first =
            usize::from(if forwarded { reg::FORWARDED_ERROR_COUNTERS } else { reg::RX_ERROR_COUNTERS });
        let counters =
            if forwarded { first + port..first + port + 1 } else { first + 2 * port..first + 2 * port + 2 };
        for counter in &mut self.memory[counters] {
            *counter = counter.saturating_add(1);
        }
    }

    /// A frame whose datagrams don't add up reached the processing unit.
    pub(crate) fn count_malformed(&mut self) {
        let counter = &mut self.memory[usize::from(reg::PROCESSING_ERROR_COUNTER)];
        *counter = counter.saturating_add(1);
    }

    /// The last time since power-on that the process-data watchdog expired.
    pub fn watchdog_expiry(&self) -> Option<WatchdogExpiry> {
        self.watchdog.expiry()
    }

    /// When something happens in the chip by itself next, host ns; `u64::MAX` for never.
    pub(crate) fn next_event(&self) -> u64 {
        let at = |instant: Option<u64>| instant.unwrap_or(u64::MAX);
        let sync = at(self.dc.as_ref().and_then(DcUnit::next_pulse));
        sync.min(at(self.watchdog.expires_at())).min(at(self.pdi_watchdog.expires_at()))
    }

    /// The firmware has an access to the chip.
    pub(crate) fn touch_pdi(&mut self, now: u64) {
        let was_running = self.pdi_watchdog.running();
        self.pdi_watchdog.trigger(now);
        if !was_running {
            self.show_pdi_watchdog();
        }
    }

    /// Whether the firmware had its last access longer ago than its watchdog allows.
    pub(crate) fn misses_pdi(&self, now: u64) -> bool {
        self.pdi_watchdog.expires_at().is_some_and(|at| at <= now)
    }

    fn show_pdi_watchdog(&mut self) {
        let at = usize::from(reg::DL_STATUS);
        let bit = if self.pdi_watchdog.running() { DL_STATUS_PDI_WATCHDOG } else { 0 };
        let status = u16_at(&self.memory, at) & !DL_STATUS_PDI_WATCHDOG | bit;
        put_u16(&mut self.memory, at, status);
    }

    /// Lets happen what is due at `now`: SYNC pulses, the watchdogs.
    pub(crate) fn run_events(&mut self, now: u64) {
        if self.misses_pdi(now) {
            self.pdi_watchdog.expire();
            let counter = &mut self.memory[usize::from(reg::WATCHDOG_COUNTER) + 1];
            *counter = counter.saturating_add(1);
            self.show_pdi_watchdog();
        }
        if self.watchdog.expires_at().is_some_and(|at| at <= now) {
            self.watchdog.expire();
            let counter = &mut self.memory[usize::from(reg::WATCHDOG_COUNTER)];
            *counter = counter.saturating_add(1);
            self.show_watchdog();
            self.raise(al_event::WATCHDOG);
        }
        if self.dc.as_ref().and_then(DcUnit::next_pulse).is_some_and(|at| at <= now) {
            self.run_sync(now);
        }
    }

    fn show_watchdog(&mut self) {
        let alive = self.watchdog.running() || !self.watchdog.enabled();
        self.memory[usize::from(reg::WATCHDOG_STATUS)] = u8::from(alive);
    }

    /// Brings the events of SyncManager `n` up to its state; its AL event, and whether that is on.
    #[inline]
    fn show_sync_manager(&mut self, n: usize) -> (u32, bool) {
        let manager = &self.sync_managers[n];
        let (event, is_on) = manager.pdi_event();
        let (ecat_event, ecat_is_on) = manager.ecat_event();
        self.al_event = self.al_event & !event | if is_on { event } else { 0 };
        self.set_ecat_event(ecat_event, ecat_is_on);
        (event, is_on)
    }
}
