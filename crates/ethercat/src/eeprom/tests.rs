//! Reading against EEPROM interfaces with every habit that chips have.

use super::*;
use crate::wire::Command;

const TARGET: Target = Target { position: 2, station: 0x1003 };

/// An EEPROM interface: registers 0x0502 to 0x050F over an image.
struct Chip {
    image: Vec<u8>,
    /// Bytes of one read: 4 or 8.
    width: usize,
    /// Looks that it stays busy after each order.
    busy_looks: u32,
    busy: u32,
    /// Orders that it does not acknowledge, from the first on.
    nacks: u32,
    /// Orders that it counts but does not see, from the first on.
    deaf: u32,
    address: u32,
    orders: Vec<u32>,
    status: u16,
}

impl Chip {
    fn new(image: Vec<u8>, width: usize) -> Self {
        let (orders, status) = (Vec::new(), 0);
        Chip { image, width, busy_looks: 0, busy: 0, nacks: 0, deaf: 0, address: 0xFFFF, orders, status }
    }

    fn order(&mut self, data: &[u8]) {
        assert_eq!(u16_at(data, 0), COMMAND_READ);
        let address = u32_at(data, 2);
        self.orders.push(address);
        if self.deaf > 0 {
            self.deaf -= 1;
            return;
        }
        self.address = address;
        self.busy = self.busy_looks;
        self.status = 0;
        if self.nacks > 0 {
            self.nacks -= 1;
            self.status = NOT_ACKNOWLEDGED;
        }
    }

    fn look(&mut self, data: &mut [u8]) {
        let mut status = self.status | if self.width == 8 { READS_EIGHT_BYTES } else { 0 };
        if self.busy > 0 {
            self.busy -= 1;
            status |= BUSY;
        }
        put_u16(data, 0, status);
        if data.len() == 14 {
            put_u32(data, 2, self.address);
            let at = self.address as usize * 2;
            for (n, byte) in data[6..6 + self.width].iter_mut().enumerate() {
                *byte = self.image.get(at + n).copied().unwrap_or(0xFF);
            }
        }
    }
}

/// Runs a reader to its end; gives the result and the time that it took.
fn read(chip: &mut Chip, extent: SiiExtent) -> (Result<Vec<u8>, EepromError>, HostTime) {
    let mut reader = SiiReader::new(TARGET, extent);
    let mut now = HostTime(0);
    for _ in 0..1_000_000 {
        match reader.next(now) {
            Next::Done(result) => return (result.map(|()| reader.into_image()), now),
            Next::WaitUntil(instant) => now = now.max(instant),
            Next::Send(request) => {
                let mut data = vec![0; request.length];
                reader.fill(&mut data);
                match request.command {
                    Command::Fpwr => chip.order(&data),
                    _ => chip.look(&mut data),
                }
                now = now + Duration::from_micros(10);
                reader.answer(Answer::Returned { working_counter: 1, data: &data }, now);
            }
        }
    }
    panic!("hung");
}

/// A header, strings, a category that nobody needs, SyncManagers, the end; 0xFF up to 1 KiB.
fn image() -> Vec<u8> {
    let mut image: Vec<u8> = (0..128).collect();
    put_u16(&mut image, SIZE_AT, 7);
    let mut category = |kind: u16, bytes: &[u8]| {
        image.extend(kind.to_le_bytes());
        image.extend(((bytes.len() / 2) as u16).to_le_bytes());
        image.extend(bytes);
    };
    category(sii::CATEGORY_STRINGS, b"\x01\x04lamp");
    category(0x0800, &[0xEE; 300]);
    category(sii::CATEGORY_SYNC_MANAGERS, &[1, 2, 3, 4, 5, 6, 7, 8]);
    category(sii::CATEGORY_END, &[]);
    image.resize(1024, 0xFF);
    image
}

/// What is kept of it: everything but the category that nobody needs.
fn needed() -> Vec<u8> {
    let mut kept = image();
    kept.drain(128 + 10..128 + 10 + 304);
    kept.truncate(128 + 10 + 12 + 2);
    kept
}

#[test]
fn both_widths_give_the_same_and_nobody_reads_what_is_not_needed() {
    for width in [4, 8] {
        let mut chip = Chip::new(image(), width);
        assert_eq!(read(&mut chip, SiiExtent::Needed).0.unwrap(), needed(), "{width} bytes at once");
        let skipped = chip.orders.iter().filter(|word| (0x4A..0xDC).contains(*word)).count();
        assert_eq!(skipped, 0, "{width} bytes at once: {:x?}", chip.orders);
        assert_eq!(read(&mut chip, SiiExtent::Whole).0.unwrap(), image(), "{width} bytes at once");
    }
}

#[test]
fn busy_silent_and_deaf_moments_are_overcome() {
    let mut chip = Chip { busy_looks: 3, nacks: 5, deaf: 2, ..Chip::new(image(), 8) };
    assert_eq!(read(&mut chip, SiiExtent::Needed).0.unwrap(), needed());
}

#[test]
fn what_stood_there_before_is_not_taken_for_the_answer() {
    // An order that was counted but not seen leaves the data of another word.
    let mut chip = Chip::new(image(), 8);
    chip.address = 0x20;
    chip.deaf = 1;
    assert_eq!(read(&mut chip, SiiExtent::Needed).0.unwrap(), needed());
    assert_eq!(chip.orders[..2], [0, 0], "ordered again");
}

#[test]
fn a_dead_eeprom_and_a_stuck_interface_are_named_in_time() {
    let mut dead = Chip { nacks: u32::MAX, ..Chip::new(image(), 8) };
    let (result, at) = read(&mut dead, SiiExtent::Needed);
    let cause = EepromFailure::NotAcknowledged { status: NOT_ACKNOWLEDGED | READS_EIGHT_BYTES };
    assert_eq!(result, Err(EepromError { position: 2, word: 0, cause }));
    assert!(at < HostTime(200_000_000), "{at:?}");
    let mut stuck = Chip { busy_looks: u32::MAX, busy: u32::MAX, ..Chip::new(image(), 8) };
    let (result, at) = read(&mut stuck, SiiExtent::Needed);
    assert_eq!(result.unwrap_err().cause, EepromFailure::Busy(BUSY_LIMIT));
    assert!(at < HostTime(1_100_000_000), "{at:?}");
}

#[test]
fn no_image_makes_it_read_without_end() {
    // Categories of length 0 up to the end, one that is longer than anything, and nothing at all.
    let zeros = vec![0; 128 * 1024];
    let mut long = image();
    put_u16(&mut long, 130, 0xFFFF);
    put_u16(&mut long, SIZE_AT, 0xFFFF);
    for image in [zeros, long, Vec::new()] {
        let kept = read(&mut Chip::new(image, 4), SiiExtent::Needed).0.unwrap();
        assert!(kept.len() <= MAX_BYTES + 6, "{}", kept.len());
    }
    let mut huge = image();
    put_u16(&mut huge, SIZE_AT, 0xFFFF);
    assert_eq!(read(&mut Chip::new(huge, 8), SiiExtent::Whole).0.unwrap().len(), MAX_BYTES);
}
