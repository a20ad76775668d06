//! The ESC register map (ETG.1000.4, section "Registers"; Beckhoff ESC datasheet section II).

/// ESC type.
pub const TYPE: u16 = 0x0000;
/// ESC revision.
pub const REVISION: u16 = 0x0001;
/// ESC build (16 bits).
pub const BUILD: u16 = 0x0002;
/// Number of FMMUs.
pub const FMMU_COUNT: u16 = 0x0004;
/// Number of SyncManagers.
pub const SM_COUNT: u16 = 0x0005;
/// Size of the process-data memory in KiB.
pub const RAM_SIZE: u16 = 0x0006;
/// Two bits per port: 0 not there, 1 not configured, 2 EBUS, 3 MII.
pub const PORT_DESCRIPTOR: u16 = 0x0007;
/// Features (16 bits).
pub const FEATURES: u16 = 0x0008;
/// Feature bit: FMMU works bit-wise only when 0 (set: byte-wise only).
pub const FEATURE_FMMU_BYTEWISE: u16 = 1 << 0;
/// Feature bit: distributed clocks are there.
pub const FEATURE_DC: u16 = 1 << 2;
/// Feature bit: distributed clocks are 64 bits wide.
pub const FEATURE_DC_64: u16 = 1 << 3;
/// Feature bit: enhanced link detection MII.
pub const FEATURE_SEPARATE_FCS: u16 = 1 << 7;
/// Feature bit: LRW isn't supported.
pub const FEATURE_NO_LRW: u16 = 1 << 9;
/// Feature bit: BRW, APRW and FPRW aren't supported.
pub const FEATURE_NO_READ_WRITE: u16 = 1 << 10;
/// Feature bit: FMMU and SyncManager set-up is fixed.
pub const FEATURE_FIXED_MAPPING: u16 = 1 << 11;
/// Configured station address.
pub const STATION_ADDRESS: u16 = 0x0010;
/// Station alias, loaded from the SII.
pub const STATION_ALIAS: u16 = 0x0012;
/// DL control (32 bits): bit 24 enables the alias; 0x0101 holds two loop bits per port.
pub const DL_CONTROL: u16 = 0x0100;
/// Loop control of ports 0 to 3, two bits each: 0 auto, 1 auto close, 2 open, 3 closed.
pub const DL_CONTROL_PORTS: u16 = 0x0101;
/// DL control, alias enable in bit 0.
pub const DL_CONTROL_ALIAS: u16 = 0x0103;
/// DL status (16 bits): bit 0 PDI operational, bit 1 PDI watchdog runs, bit 4+n link at port n, bits 8+2n loop closed, 9+2n communication.
pub const DL_STATUS: u16 = 0x0110;
/// DL status: the PDI watchdog runs.
pub const PDI_WATCHDOG_RUNS: u16 = 1 << 1;
/// AL control (16 bits).
pub const AL_CONTROL: u16 = 0x0120;
/// AL status (16 bits), followed by 0x0134.
pub const AL_STATUS: u16 = 0x0130;
/// AL status code (16 bits).
pub const AL_STATUS_CODE: u16 = 0x0134;
/// PDI control.
pub const PDI_CONTROL: u16 = 0x0140;
/// ESC configuration.
pub const ESC_CONFIGURATION: u16 = 0x0141;
/// ECAT event mask (16 bits).
pub const ECAT_EVENT_MASK: u16 = 0x0200;
/// AL event mask, PDI side (32 bits).
pub const AL_EVENT_MASK: u16 = 0x0204;
/// ECAT event request (16 bits).
pub const ECAT_EVENT: u16 = 0x0210;
/// AL event request (32 bits).
pub const AL_EVENT: u16 = 0x0220;
/// Rx error counters: invalid frame and rx error, a byte each per port (8 bytes).
pub const RX_ERROR_COUNTERS: u16 = 0x0300;
/// Forwarded rx error counters, a byte per port.
pub const FORWARDED_ERROR_COUNTERS: u16 = 0x0308;
/// Processing unit error counter.
pub const PROCESSING_ERROR_COUNTER: u16 = 0x030C;
/// PDI error counter.
pub const PDI_ERROR_COUNTER: u16 = 0x030D;
/// Lost link counters, a byte per port.
pub const LOST_LINK_COUNTERS: u16 = 0x0310;
/// Watchdog divider (16 bits), units of 40 ns, plus 2.
pub const WATCHDOG_DIVIDER: u16 = 0x0400;
/// PDI watchdog time (16 bits).
pub const WATCHDOG_PDI: u16 = 0x0410;
/// Process-data watchdog time (16 bits), multiples of the divided clock.
pub const WATCHDOG_PROCESS_DATA: u16 = 0x0420;
/// Process-data watchdog status: bit 0 set means that it runs and hasn't expired.
pub const WATCHDOG_STATUS: u16 = 0x0440;
/// How often the process-data watchdog expired; behind it, 8 bits too, how often the PDI watchdog did. Writing clears both.
pub const WATCHDOG_COUNTER: u16 = 0x0442;
/// SII configuration: 2 forces the EEPROM back from the PDI; bit 0 gives it to the PDI.
pub const SII_CONFIG: u16 = 0x0500;
/// SII PDI access state.
pub const SII_PDI_ACCESS: u16 = 0x0501;
/// SII control and status (16 bits): bit 6 reads 8 bytes, bits 8..10 command, 11..14 errors, 15 busy.
pub const SII_CONTROL: u16 = 0x0502;
/// SII word address (32 bits).
pub const SII_ADDRESS: u16 = 0x0504;
/// SII data (4 or 8 bytes).
pub const SII_DATA: u16 = 0x0508;
/// First FMMU; 16 bytes each.
pub const FMMU: u16 = 0x0600;
/// Bytes of an FMMU's registers.
pub const FMMU_SIZE: u16 = 16;
/// First SyncManager; 8 bytes each.
pub const SM: u16 = 0x0800;
/// Bytes of a SyncManager's registers.
pub const SM_SIZE: u16 = 8;
/// Receive times of ports 0 to 3 (32 bits each); a write latches all of them.
pub const DC_RECEIVE_TIMES: u16 = 0x0900;
/// System time, local copy (64 bits).
pub const DC_SYSTEM_TIME: u16 = 0x0910;
/// Local time at which the processing unit received the latching frame (64 bits).
pub const DC_RECEIVE_TIME_UNIT: u16 = 0x0918;
/// Offset of system time to local time (64 bits).
pub const DC_SYSTEM_TIME_OFFSET: u16 = 0x0920;
/// Propagation delay from the reference clock (32 bits), ns.
pub const DC_SYSTEM_TIME_DELAY: u16 = 0x0928;
/// System time difference (32 bits): bit 31 is the sign (set: local time is smaller than received), the rest the mean value in ns.
pub const DC_SYSTEM_TIME_DIFFERENCE: u16 = 0x092C;
/// Speed counter start (16 bits); a write resets the drift control loop.
pub const DC_SPEED_COUNTER_START: u16 = 0x0930;
/// Speed counter difference (16 bits).
pub const DC_SPEED_COUNTER_DIFFERENCE: u16 = 0x0932;
/// Filter depths (two bytes: system time difference, speed counter).
pub const DC_FILTER_DEPTHS: u16 = 0x0934;
/// Cyclic unit control: bit 0 gives it to the PDI.
pub const DC_CYCLIC_CONTROL: u16 = 0x0980;
/// Activation: bit 0 cyclic operation, bit 1 SYNC0, bit 2 SYNC1.
pub const DC_ACTIVATION: u16 = 0x0981;
/// SYNC pulse length (16 bits), units of 10 ns.
pub const DC_PULSE_LENGTH: u16 = 0x0982;
/// Activation status.
pub const DC_ACTIVATION_STATUS: u16 = 0x0984;
/// SYNC0 status; reading acknowledges.
pub const DC_SYNC0_STATUS: u16 = 0x098E;
/// SYNC1 status; reading acknowledges.
pub const DC_SYNC1_STATUS: u16 = 0x098F;
/// Start time of cyclic operation (64 bits); reads as the time of the next SYNC0.
pub const DC_START_TIME: u16 = 0x0990;
/// Time of the next SYNC1 (64 bits).
pub const DC_NEXT_SYNC1: u16 = 0x0998;
/// SYNC0 cycle time (32 bits), ns.
pub const DC_SYNC0_CYCLE: u16 = 0x09A0;
/// SYNC1 cycle time (32 bits), ns.
pub const DC_SYNC1_CYCLE: u16 = 0x09A4;
/// First byte of the process-data memory.
pub const PROCESS_DATA: u16 = 0x1000;

/// AL event bits (register 0x0220), as the application sees them.
pub mod al_event {
    /// AL control was written.
    pub const AL_CONTROL: u32 = 1 << 0;
    /// SYNC0 fired.
    pub const SYNC0: u32 = 1 << 2;
    /// SYNC1 fired.
    pub const SYNC1: u32 = 1 << 3;
    /// A SyncManager's activation register changed.
    pub const SM_CHANGED: u32 = 1 << 4;
    /// EEPROM emulation request.
    pub const EEPROM: u32 = 1 << 5;
    /// The process-data watchdog expired.
    pub const WATCHDOG: u32 = 1 << 6;
    /// SyncManager `n` has an event (bit 8 + n).
    pub const fn sync_manager(n: u8) -> u32 {
        1 << (8 + n)
    }
}

/// Register 0x092C: magnitude, and bit 31 as the sign (set: the local clock is behind).
pub fn signed_difference(value: u32) -> i32 {
    let magnitude = (value & 0x7FFF_FFFF) as i32;
    if value >> 31 != 0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bit_31_of_the_time_difference_is_its_sign() {
        assert_eq!(signed_difference(0x0000_0010), 16);
        assert_eq!(signed_difference(0x8000_0010), -16);
        assert_eq!(signed_difference(0x8000_0000), 0);
    }
}
