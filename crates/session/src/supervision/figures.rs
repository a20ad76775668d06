//! What supervision counts.

use serde::Serialize;

/// What was counted of the whole bus since the drives were brought to OP.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct BusFigures {
    /// Frames that weren't back at their deadline.
    pub frames_lost: u64,
    /// Frames that came after their deadline.
    pub frames_late: u64,
    /// Frames that came back shorter than they were sent.
    pub frames_short: u64,
    /// Frames that came twice.
    pub frames_duplicate: u64,
    /// Frames that nobody here sent, or that came back damaged or unprocessed.
    pub frames_foreign: u64,
    /// Cycles in which a working counter of process data wasn't the expected one.
    pub working_counter_errors: u64,
    /// SubDevices that aren't operational now.
    pub not_operational: u64,
    /// All AL statuses (0x0130) ORed, as the last frame brought them; 8 where everybody is in OP.
    pub al_status: u64,
    /// How far the cycle's frame is from its phase in the distributed clock's time, ns.
    pub dc_phase_ns: i64,
    /// SubDevices that were lost so far.
    pub losses: u64,
    /// Of them, those that came back to OP.
    pub recoveries: u64,
    /// Emergencies that drives sent.
    pub emergencies: u64,
    /// Faults that drives showed in their status word.
    pub drive_faults: u64,
    /// Frames with a wrong checksum, all ports of all SubDevices together.
    pub crc_errors: u64,
    /// Links that were lost, likewise.
    pub link_losses: u64,
    /// Times at which another reference clock was elected.
    pub reference_changes: u64,
    /// Breaks of a ring.
    pub ring_breaks: u64,
    /// Times at which nothing came back from the segment for several cycles.
    pub silences: u64,
    /// SubDevices that answer beyond those that were set up, now.
    pub surplus: u64,
    /// Times at which a clock was too far from the reference in OP.
    pub clock_strays: u64,
}

impl BusFigures {
    /// Names of the channels, in the order of [`BusFigures::values`].
    pub const CHANNELS: [&'static str; 20] = [
        "frames_lost",
        "frames_late",
        "frames_short",
        "frames_duplicate",
        "frames_foreign",
        "working_counter_errors",
        "not_operational",
        "al_status",
        "dc_phase_ns",
        "losses",
        "recoveries",
        "emergencies",
        "drive_faults",
        "crc_errors",
        "link_losses",
        "reference_changes",
        "ring_breaks",
        "silences",
        "surplus",
        "clock_strays",
    ];

    /// The figures as numbers.
    pub fn values(&self) -> [f64; 20] {
        [
            self.frames_lost as f64,
            self.frames_late as f64,
            self.frames_short as f64,
            self.frames_duplicate as f64,
            self.frames_foreign as f64,
            self.working_counter_errors as f64,
            self.not_operational as f64,
            self.al_status as f64,
            self.dc_phase_ns as f64,
            self.losses as f64,
            self.recoveries as f64,
            self.emergencies as f64,
            self.drive_faults as f64,
            self.crc_errors as f64,
            self.link_losses as f64,
            self.reference_changes as f64,
            self.ring_breaks as f64,
            self.silences as f64,
            self.surplus as f64,
            self.clock_strays as f64,
        ]
    }
}

/// What was counted of one SubDevice.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SubDeviceFigures {
    /// Its name and position.
    pub name: String,
    /// Times at which it was lost: silent, or not in OP.
    pub losses: u64,
    /// Times at which it came back to OP.
    pub recoveries: u64,
    /// Emergencies that it sent.
    pub emergencies: u64,
    /// Faults that it showed in its status word.
    pub faults: u64,
    /// Frames with a wrong checksum at ports 0 to 3 (0x0300).
    pub crc_errors: [u64; 4],
    /// Symbols that were none at ports 0 to 3 (0x0301).
    pub receive_errors: [u64; 4],
    /// Damaged frames that another had marked as such (0x0308).
    pub forwarded_errors: [u64; 4],
    /// Times at which the link at ports 0 to 3 was lost (0x0310).
    pub link_losses: [u64; 4],
    /// How far its clock was from the reference at the last look (0x092C), ns.
    pub clock_ns: i64,
    /// The farthest of all looks in OP, ns.
    pub worst_clock_ns: u64,
    /// Times at which its clock was too far from the reference.
    pub clock_strays: u64,
}

/// A datagram of process data, and how often its working counter was wrong.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DatagramFigures {
    /// Which: frame, datagram in it, command.
    pub name: String,
    /// Working counter that it should have.
    pub expected: u16,
    /// Exchanges in which it had another.
    pub short_counts: u64,
}
