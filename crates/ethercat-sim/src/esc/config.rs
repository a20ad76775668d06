//! What kind of ESC a SubDevice has.

use omnibase_ethercat_wire::register;

/// Which registers a chip with distributed clocks shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DcRegisters {
    /// All of them.
    #[default]
    Full,
    /// Only the receive times of the ports (0x0900): the rest is switched off to save power, though the features
    /// still say that distributed clocks are there. Many digital terminals are made so.
    ReceiveTimesOnly,
}

/// The make of an ESC, the content of its EEPROM, and the quality of its quartz.
#[derive(Clone, Debug, PartialEq)]
pub struct EscConfig {
    /// ESC type (register 0x0000).
    pub esc_type: u8,
    /// Revision (0x0001).
    pub revision: u8,
    /// Build (0x0002).
    pub build: u16,
    /// FMMUs, at most 16.
    pub fmmu_count: u8,
    /// SyncManagers, at most 16.
    pub sm_count: u8,
    /// Process-data memory in KiB, at most 60.
    pub ram_kib: u8,
    /// Two bits per port (0x0007): 0 not there, 1 not configured, 2 EBUS, 3 MII.
    pub port_descriptor: u8,
    /// Features (0x0008): see `FEATURE_*` of the register map.
    pub features: u16,
    /// The EEPROM's content.
    pub sii: Vec<u8>,
    /// How much of its distributed clock it shows, if it has one.
    pub dc_registers: DcRegisters,
    /// Local clock at power-on, ns.
    pub dc_offset_ns: u64,
    /// How much faster than virtual time the quartz runs, parts per million; slower where negative.
    pub dc_drift_ppm: f64,
    /// Time that a frame needs from one port to the next, ns.
    pub forward_delay_ns: u32,
    /// How long the EEPROM interface is busy with a read, ns.
    pub sii_read_ns: u64,
    /// How long the EEPROM interface is busy with a write, ns.
    pub sii_write_ns: u64,
}

impl Default for EscConfig {
    /// An ET1100-like chip with 8 FMMUs, 8 SyncManagers, 8 KiB, four MII ports, a 64-bit distributed
    /// clock without offset or drift, and an empty EEPROM.
    fn default() -> Self {
        EscConfig {
            esc_type: 0x11,
            revision: 0,
            build: 2,
            fmmu_count: 8,
            sm_count: 8,
            ram_kib: 8,
            port_descriptor: 0xFF,
            features: register::FEATURE_DC | register::FEATURE_DC_64,
            sii: Vec::new(),
            dc_registers: DcRegisters::Full,
            dc_offset_ns: 0,
            dc_drift_ppm: 0.0,
            forward_delay_ns: 300,
            sii_read_ns: 50_000,
            sii_write_ns: 1_000_000,
        }
    }
}

impl EscConfig {
    /// Whether the chip has this port (0 to 3) and it is configured.
    pub fn has_port(&self, port: u8) -> bool {
        port < 4 && (self.port_descriptor >> (2 * port)) & 0b10 != 0
    }

    /// Whether it has a system time and SYNC pulses, not only receive times.
    pub fn has_system_time(&self) -> bool {
        self.has(register::FEATURE_DC) && self.dc_registers == DcRegisters::Full
    }

    /// Whether all bits of `feature` are set.
    pub fn has(&self, feature: u16) -> bool {
        self.features & feature == feature
    }
}
