//! The kernel's events: `struct input_event` of linux/input.h on 64-bit machines.

/// Bytes of one event.
pub const EVENT_BYTES: usize = 24;

/// `EV_SYN`: separates events.
pub const EV_SYN: u16 = 0;
/// `EV_KEY`: a button.
pub const EV_KEY: u16 = 1;
/// `EV_REL`: how far something was moved.
pub const EV_REL: u16 = 2;
/// `REL_X`: to the right.
pub const REL_X: u16 = 0;
/// `REL_Y`: downwards.
pub const REL_Y: u16 = 1;
/// `EV_ABS`: an axis.
pub const EV_ABS: u16 = 3;
/// `SYN_REPORT`: what came since the last one belongs together.
pub const SYN_REPORT: u16 = 0;
/// `SYN_DROPPED`: the kernel's buffer ran over, events are missing.
pub const SYN_DROPPED: u16 = 3;

/// One event as the kernel gives it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawEvent {
    /// When, us on the device's clock; 0 where the kernel gave less.
    pub time_us: u64,
    /// Its type: [`EV_SYN`], [`EV_KEY`], [`EV_ABS`], or one that means nothing here.
    pub kind: u16,
    /// The axis, button or sort of separation.
    pub code: u16,
    /// The new value.
    pub value: i32,
}

impl RawEvent {
    /// The end of a report.
    pub fn report(time_us: u64) -> Self {
        RawEvent { time_us, kind: EV_SYN, code: SYN_REPORT, value: 0 }
    }

    /// An axis at a value.
    pub fn axis(time_us: u64, code: u16, value: i32) -> Self {
        RawEvent { time_us, kind: EV_ABS, code, value }
    }

    /// A move by so many counts.
    pub fn moved(time_us: u64, code: u16, value: i32) -> Self {
        RawEvent { time_us, kind: EV_REL, code, value }
    }

    /// A button, pressed (1) or not (0).
    pub fn button(time_us: u64, code: u16, value: i32) -> Self {
        RawEvent { time_us, kind: EV_KEY, code, value }
    }

    /// An event from its bytes, little endian: seconds, microseconds (64 bits each), type, code (16), value (32).
    pub fn from_bytes(bytes: &[u8; EVENT_BYTES]) -> Self {
        let [s @ .., _, _, _, _, _, _, _, _, _, _, _, _, _, _, _, _] = *bytes;
        let [_, _, _, _, _, _, _, _, us @ .., _, _, _, _, _, _, _, _] = *bytes;
        let [.., k0, k1, c0, c1, v0, v1, v2, v3] = *bytes;
        // A clock before 1970 or beyond the range of u64 in us is no clock: its ends stand for it.
        let part = |bytes| u64::try_from(i64::from_le_bytes(bytes)).unwrap_or(0);
        RawEvent {
            time_us: part(s).saturating_mul(1_000_000).saturating_add(part(us)),
            kind: u16::from_le_bytes([k0, k1]),
            code: u16::from_le_bytes([c0, c1]),
            value: i32::from_le_bytes([v0, v1, v2, v3]),
        }
    }

    /// Its bytes, as [`RawEvent::from_bytes`] reads them.
    pub fn to_bytes(self) -> [u8; EVENT_BYTES] {
        let mut bytes = [0; EVENT_BYTES];
        bytes[..8].copy_from_slice(&(self.time_us / 1_000_000).to_le_bytes());
        bytes[8..16].copy_from_slice(&(self.time_us % 1_000_000).to_le_bytes());
        bytes[16..18].copy_from_slice(&self.kind.to_le_bytes());
        bytes[18..20].copy_from_slice(&self.code.to_le_bytes());
        bytes[20..].copy_from_slice(&self.value.to_le_bytes());
        bytes
    }
}

/// All whole events of a stream, and how many bytes were left at its end.
pub fn events_in(bytes: &[u8]) -> (Vec<RawEvent>, usize) {
    let (whole, rest) = bytes.as_chunks::<EVENT_BYTES>();
    (whole.iter().map(RawEvent::from_bytes).collect(), rest.len())
}
