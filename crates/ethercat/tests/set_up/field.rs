//! EEPROMs written and files exchanged, with every datagram spoiled in turn, and with a segment that dies at each.

use std::time::Duration;

use omnibase_ethercat::eeprom::with_checksum;
use omnibase_ethercat::mailbox::{FileAccess, MailboxRequest};
use omnibase_ethercat::wire::{AlState, Clock, HostTime, Link, LinkError, sii};
use omnibase_ethercat::{Bus, BusOptions, SetUpError, SubDeviceConfig};
use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::generic::{FIRMWARE, Generic};
use omnibase_ethercat_sim::fault_link::{FaultAction, FaultCounts, FaultLink, Injection, Target};
use omnibase_ethercat_sim::firmware::FileStore;
use omnibase_ethercat_sim::{Fault, Segment, SimLink, VirtualClock, in_process};

use crate::segment::{sii_of, with_mailbox};

const ACTIONS: [FaultAction; 4] = [
    FaultAction::DropRequest,
    FaultAction::DropAnswer,
    FaultAction::NotProcessed,
    FaultAction::WorkingCounter(0),
];

/// An image with a mailbox for files in BOOT.
fn image(serial: u32) -> Vec<u8> {
    let identity = sii::Identity { vendor_id: 5, product_code: 6, revision: 7, serial };
    let mut sii = with_mailbox(sii_of(identity, 3));
    for (word, value) in [(0x14, 0x1000u16), (0x15, 64), (0x16, 0x1080), (0x17, 64), (0x1C, 12)] {
        sii[2 * word..2 * word + 2].copy_from_slice(&value.to_le_bytes());
    }
    sii
}

fn segment() -> (Segment, FileStore) {
    let generic = Generic::from_sii(&image(1), &Piece::default()).unwrap();
    (Segment::line(vec![generic.sub_device]).unwrap(), generic.files.unwrap())
}

/// A cable that breaks behind so many frames; the last of them still arrives, but its answer doesn't come back.
struct Cable {
    inner: FaultLink<SimLink>,
    breaks_behind: u64,
}

impl Link for Cable {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let sent = self.inner.counts().frames;
        if sent > self.breaks_behind {
            return Ok(());
        }
        if sent == self.breaks_behind {
            self.inner.inject(Injection { target: Target::Frame(sent), action: FaultAction::DropAnswer });
        }
        self.inner.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.inner.receive(buffer, deadline)
    }
}

type FieldBus = Bus<Cable, VirtualClock>;

/// A bus over a cable on which `injections` happen.
fn bus_of(segment: Segment, injections: impl IntoIterator<Item = Injection>) -> FieldBus {
    let (link, clock) = in_process(segment);
    let mut inner = FaultLink::new(link, 0);
    injections.into_iter().for_each(|injection| inner.inject(injection));
    Bus::new(Cable { inner, breaks_behind: u64::MAX }, clock, BusOptions::default())
}

fn counts(bus: &mut FieldBus) -> FaultCounts {
    bus.transactor().link.inner.counts()
}

/// The cable is whole again, and the device was without power for a while.
fn mend(bus: &mut FieldBus) {
    let link = &mut bus.transactor().link;
    link.breaks_behind = u64::MAX;
    for fault in [Fault::PowerOff, Fault::PowerOn] {
        link.inner.inner_mut().segment_mut().inject(0, fault).unwrap();
    }
}

fn write_eeprom(bus: &mut FieldBus, after: &[u8]) -> Result<usize, SetUpError> {
    bus.scan()?;
    let before = bus.read_sii(0)?;
    bus.write_sii(0, &before, after)
}

/// Other content behind the fixed part alone: nothing that the checksum is of.
fn wanted_behind(before: &[u8]) -> Vec<u8> {
    let mut after = before.to_vec();
    after[200..220].fill(0x5A);
    after
}

/// Another alias, serial number and content behind the fixed part.
fn wanted(before: &[u8]) -> Vec<u8> {
    let mut after = before.to_vec();
    after[8] = 0x42;
    after[12] = 0x11;
    after[28] = 9;
    after[200..206].fill(0x5A);
    with_checksum(after)
}

fn eeprom(bus: &mut FieldBus) -> Vec<u8> {
    bus.transactor().link.inner.inner().segment().sub_devices()[0].esc().sii_image().to_vec()
}

fn is_valid(image: &[u8]) -> bool {
    image[14] == sii::checksum(image.first_chunk().unwrap())
}

#[test]
fn an_eeprom_is_written_whole_whatever_single_datagram_is_spoiled() {
    let right = wanted(&image(1));
    let mut bus = bus_of(segment().0, []);
    // The marked checksum, six words, and the checksum.
    assert_eq!(write_eeprom(&mut bus, &right), Ok(8));
    assert_eq!(eeprom(&mut bus), right);
    let datagrams = counts(&mut bus).datagrams;
    for action in ACTIONS {
        for number in 0..datagrams {
            let injection = Injection { target: Target::Datagram(number), action };
            let mut bus = bus_of(segment().0, [injection]);
            assert_eq!(write_eeprom(&mut bus, &right), Ok(8), "{injection:?}");
            assert_eq!(eeprom(&mut bus), right, "{injection:?}");
            let at = bus.transactor().clock.now();
            assert!(at < HostTime(5_000_000_000), "{injection:?}: {at:?}");
        }
    }
    println!("{datagrams} datagrams of an EEPROM write, each spoiled in {} ways", ACTIONS.len());
}

/// The cable breaks at each frame in turn: what is in the EEPROM is the old, the new, or says itself that it is neither;
/// and the same command makes the new one of it, also behind a power cycle.
#[test]
fn a_half_written_eeprom_is_never_called_good_and_can_be_written_again() {
    let old = image(1);
    for right in [wanted(&old), wanted_behind(&old)] {
        let mut bus = bus_of(segment().0, []);
        write_eeprom(&mut bus, &right).unwrap();
        let (frames, mut halves) = (counts(&mut bus).frames, 0);
        for frame in 0..frames {
            let mut bus = bus_of(segment().0, []);
            bus.transactor().link.breaks_behind = frame;
            let result = write_eeprom(&mut bus, &right);
            let found = eeprom(&mut bus);
            let is_whole = found == old || found == right;
            assert_eq!(is_valid(&found), is_whole, "behind frame {frame}: {result:?}");
            if !is_whole {
                halves += 1;
                let words = result.unwrap_err().to_string();
                assert!(words.contains("run the same command again"), "{words}");
            }
            mend(&mut bus);
            bus.scan().unwrap();
            assert_eq!(bus.subdevices()[0].broken.is_some(), !is_whole, "behind frame {frame}");
            let before = bus.read_sii(0).unwrap();
            bus.write_sii(0, &before, &right).unwrap();
            assert_eq!(eeprom(&mut bus), right);
        }
        assert!(halves > 10, "{halves} halves of {frames} frames");
    }
}

/// Until then its chip serves nobody, whatever stands in the EEPROM by now.
#[test]
fn an_eeprom_that_was_made_right_counts_from_the_next_power_on() {
    let right = image(1);
    let mut half = right.clone();
    half[14] ^= 0xFF;
    let generic = Generic::from_sii(&half, &Piece::default()).unwrap();
    let mut bus = bus_of(Segment::line(vec![generic.sub_device]).unwrap(), []);
    let told = |bus: &mut FieldBus| {
        bus.scan().unwrap();
        let broken = bus.subdevices()[0].broken.clone().unwrap_or_default();
        let trouble: Vec<String> = bus.look_for_trouble().unwrap().iter().map(ToString::to_string).collect();
        (broken, trouble.join("\n"))
    };
    let refused = |bus: &mut FieldBus| {
        let [alone, configured] =
            [&[][..], &[SubDeviceConfig::default()]].map(|configs| bus.configure(configs));
        [alone, configured, bus.enter_boot(0)].map(|refused| refused.unwrap_err().to_string())
    };
    let (broken, trouble) = told(&mut bus);
    assert!(broken.contains("the checksum of its EEPROM is wrong"), "{broken}");
    assert!(refused(&mut bus).iter().all(|words| words.ends_with(&broken)), "{:?}", refused(&mut bus));
    assert!(trouble.contains("write its EEPROM (`omnibase eeprom write`)"), "{trouble}");
    assert_eq!(write_eeprom(&mut bus, &right), Ok(1));
    let (broken, trouble) = told(&mut bus);
    assert!(broken.contains("its chip didn't load it: power it off and on"), "{broken}");
    assert!(trouble.contains("power it off and on") && !trouble.contains("eeprom write"), "{trouble}");
    assert!(refused(&mut bus).iter().all(|words| words.ends_with(&broken)), "{:?}", refused(&mut bus));
    mend(&mut bus);
    assert_eq!(told(&mut bus), (String::new(), String::new()));
    assert_eq!(bus.configure(&[]), Ok(()));
}

/// What is left in an EEPROM that was taken for another one than it is, or that keeps what it was before.
#[test]
fn an_eeprom_that_differs_in_the_end_has_its_checksum_spoiled() {
    let right = wanted(&image(1));
    let mut bus = bus_of(segment().0, []);
    bus.scan().unwrap();
    // Word 100 is believed to be right already, so it isn't written.
    let mut believed = image(1);
    believed[200..202].copy_from_slice(&right[200..202]);
    let differs = bus.write_sii(0, &believed, &right).unwrap_err();
    let (expected, found) = (0x5A5A, u16::from_le_bytes([image(1)[200], image(1)[201]]));
    assert_eq!(differs, SetUpError::EepromDiffers { position: 0, word: 100, expected, found });
    assert!(!is_valid(&eeprom(&mut bus)));
    let before = bus.read_sii(0).unwrap();
    bus.write_sii(0, &before, &right).unwrap();
    assert_eq!(eeprom(&mut bus), right);
}

fn file(name: &str) -> FileAccess {
    FileAccess { name: name.to_owned(), password: 0 }
}

/// Firmware of several packets of 52 bytes.
fn firmware(length: usize) -> Vec<u8> {
    (0..length).map(|n| (n * 7 % 251) as u8).collect()
}

fn update(bus: &mut FieldBus, content: &[u8]) -> Result<Vec<u8>, SetUpError> {
    bus.scan()?;
    bus.enter_boot(0)?;
    let timeout = Duration::from_secs(1);
    let write = MailboxRequest::write_file(file(FIRMWARE), content.to_vec());
    bus.transfer_file(0, write.with_timeout(timeout), &mut |_| {})?;
    let read = MailboxRequest::read_file(file(FIRMWARE), Vec::with_capacity(4096));
    let found = bus.transfer_file(0, read.with_timeout(timeout), &mut |_| {})?;
    bus.leave_boot(0)?;
    bus.request_state(&[0], AlState::Init)?;
    Ok(found)
}

#[test]
fn files_of_every_length_round_the_packets_are_written_and_read_back() {
    for length in [0, 1, 51, 52, 53, 103, 104, 105, 1000] {
        let (segment, files) = segment();
        files.lock().busy_times = 2;
        assert_eq!(update(&mut bus_of(segment, []), &firmware(length)), Ok(firmware(length)), "{length}");
        assert_eq!(files.lock().files[FIRMWARE], firmware(length));
    }
}

#[test]
fn a_file_arrives_whole_whatever_single_datagram_is_spoiled() {
    let content = firmware(130);
    let mut bus = bus_of(segment().0, []);
    assert_eq!(update(&mut bus, &content).as_ref(), Ok(&content));
    let datagrams = counts(&mut bus).datagrams;
    for action in ACTIONS {
        for number in 0..datagrams {
            let injection = Injection { target: Target::Datagram(number), action };
            let (segment, files) = segment();
            let found = update(&mut bus_of(segment, [injection]), &content);
            assert_eq!(found.as_ref(), Ok(&content), "{injection:?}");
            assert_eq!(files.lock().files[FIRMWARE], content, "{injection:?}");
        }
    }
    println!("{datagrams} datagrams of a firmware, each spoiled in {} ways", ACTIONS.len());
}

/// A firmware that was broken off leaves a device that refuses PRE-OP, and that takes the whole once it is asked again.
#[test]
fn a_broken_off_firmware_is_never_called_good_and_can_be_written_again() {
    let content = firmware(130);
    let mut bus = bus_of(segment().0, []);
    update(&mut bus, &content).unwrap();
    let mut halves = 0;
    for frame in 0..counts(&mut bus).frames {
        let (segment, files) = segment();
        let mut bus = bus_of(segment, []);
        bus.transactor().link.breaks_behind = frame;
        let result = update(&mut bus, &content);
        let is_incomplete = files.lock().incomplete;
        assert!(!is_incomplete || result.is_err(), "behind frame {frame}");
        mend(&mut bus);
        if is_incomplete {
            halves += 1;
            bus.scan().unwrap();
            let words = bus.configure(&[]).unwrap_err().to_string();
            assert!(words.contains("0x0014 no valid firmware"), "{words}");
        }
        assert_eq!(update(&mut bus, &content).as_ref(), Ok(&content), "behind frame {frame}");
        bus.configure(&[]).unwrap();
    }
    assert!(halves > 3, "{halves}");
}

/// FoE has one message for a name: 34 bytes of mailbox leave room for 22 of it, and no cut name is ever asked for.
#[test]
fn a_name_that_the_mailbox_cant_carry_is_refused_before_anything_is_sent() {
    let write = |name: &str, mailbox: u8| {
        let mut sii = image(1);
        [0x15, 0x17].into_iter().for_each(|word| sii[2 * word] = mailbox);
        let generic = Generic::from_sii(&sii, &Piece::default()).unwrap();
        let files = generic.files.unwrap();
        let mut bus = bus_of(Segment::line(vec![generic.sub_device]).unwrap(), []);
        bus.scan().unwrap();
        bus.enter_boot(0).unwrap();
        let request = MailboxRequest::write_file(file(name), firmware(60));
        let done = bus.transfer_file(0, request, &mut |_| {});
        let names: Vec<String> = files.lock().files.keys().cloned().collect();
        (done.map(drop), names)
    };
    let (done, names) = write(&"n".repeat(22), 34);
    assert!(done.is_ok() && names.contains(&"n".repeat(22)), "{done:?} {names:?}");
    let (done, names) = write(&"n".repeat(23), 34);
    let words = done.unwrap_err().to_string();
    assert!(
        words.contains("the file's name has 23 bytes, this SubDevice's mailbox has room for 22"),
        "{words}"
    );
    assert!(names.iter().all(|name| !name.starts_with('n')), "{names:?}");
    // As long as the mailbox has room for.
    let (done, names) = write(&"n".repeat(52), 64);
    assert!(done.is_ok() && names.contains(&"n".repeat(52)), "{done:?} {names:?}");
}

#[test]
fn refusals_say_what_to_do() {
    let (locked, files) = segment();
    files.lock().password = 0x1234;
    let words = update(&mut bus_of(locked, []), &firmware(60)).unwrap_err().to_string();
    assert!(words.contains("FoE error 0x8002 access denied") && words.contains("--password"), "{words}");
    // Nothing was erased.
    assert!(!files.lock().incomplete);

    let plain = sii_of(sii::Identity { vendor_id: 5, product_code: 6, revision: 7, serial: 1 }, 3);
    let generic = Generic::from_sii(&plain, &Piece::default()).unwrap();
    let mut bus = bus_of(Segment::line(vec![generic.sub_device]).unwrap(), []);
    let words = update(&mut bus, &firmware(60)).unwrap_err().to_string();
    assert!(words.contains("SubDevice 0 takes no files in BOOT: its SII names no FoE"), "{words}");
}
