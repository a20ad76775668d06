//! Any messages into a simulated servo's mailbox: afterwards it still answers an honest request.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat_sim::{Segment, SegmentFile};
use omnibase_ethercat_wire::frame::{Datagrams, FrameBuilder};
use omnibase_ethercat_wire::sii::Image;
use omnibase_ethercat_wire::{Address, Command, HostTime, register};
use std::path::Path;

/// A segment of one servo and the time in it.
struct Servo {
    segment: Segment,
    now: u64,
    write: (u16, usize),
    read: (u16, usize),
}

impl Servo {
    fn new() -> Self {
        let file = SegmentFile::parse("[[subdevice]]\nkind = \"servo\"").expect("a servo");
        let segment = file.build(Path::new(".")).expect("a servo");
        let (image, _) = Image::parse(&segment.sub_devices()[0].esc().sii_image()).expect("an image");
        let area = image.header.mailbox;
        let mut servo = Servo {
            segment,
            now: 0,
            write: (area.receive_offset, usize::from(area.receive_size)),
            read: (area.send_offset, usize::from(area.send_size)),
        };
        for ((start, length), (number, control)) in
            [servo.write, servo.read].into_iter().zip([(0, 0x26), (1, 0x22)])
        {
            let ([s0, s1], [l0, l1]) = (start.to_le_bytes(), (length as u16).to_le_bytes());
            servo.access(Command::Apwr, register::SM + 8 * number, &mut [s0, s1, l0, l1, control, 0, 1, 0]);
        }
        servo.access(Command::Apwr, register::AL_CONTROL, &mut [2, 0]);
        servo.wait(100_000_000);
        let mut status = [0; 2];
        servo.access(Command::Aprd, register::AL_STATUS, &mut status);
        assert_eq!(status, [2, 0], "PRE-OP");
        servo
    }

    fn wait(&mut self, ns: u64) {
        self.now += ns;
        self.segment.advance(HostTime(self.now));
    }

    /// One datagram; its working counter.
    fn access(&mut self, command: Command, register: u16, data: &mut [u8]) -> u16 {
        let mut frame = FrameBuilder::new();
        frame.push(command, 0, Address::position(0, register), data).expect("a mailbox fits into a frame");
        self.wait(1_000_000);
        self.segment.process(frame.bytes_mut(), HostTime(self.now)).expect("nothing is lost here");
        self.wait(1_000_000);
        let answer = Datagrams::new(frame.bytes()).unwrap().next().unwrap().unwrap();
        data.copy_from_slice(answer.data);
        answer.working_counter
    }

    /// Writes a message; what the mailbox then gives, as long as it gives something.
    fn tell(&mut self, message: &[u8]) -> Vec<Vec<u8>> {
        let (write, length) = self.write;
        let mut area = vec![0; length];
        let used = message.len().min(length);
        area[..used].copy_from_slice(&message[..used]);
        self.access(Command::Apwr, write, &mut area);
        let mut answers = Vec::new();
        loop {
            let (read, length) = self.read;
            let mut area = vec![0; length];
            if self.access(Command::Aprd, read, &mut area) == 0 {
                return answers;
            }
            answers.push(area);
            assert!(answers.len() < 1000, "it babbles");
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut servo = Servo::new();
    let mut rest = bytes;
    while let Some((&length, tail)) = rest.split_first() {
        let (body, next) = tail.split_at(tail.len().min(usize::from(length % 64)));
        // Half of the messages get an honest mailbox header for CoE in front.
        let mut message = Vec::new();
        if length & 0x80 != 0 {
            message.extend_from_slice(&[body.len() as u8, 0, 0, 0, 0, 0x03]);
        }
        message.extend_from_slice(body);
        servo.tell(&message);
        rest = next;
    }
    // SDO upload of the vendor, 1018:01.
    let answers = servo.tell(&[10, 0, 0, 0, 0, 0x03, 0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    assert!(
        answers.iter().any(|answer| answer[5] & 0x0F == 3 && answer[6..12] == [0, 0x30, 0x43, 0x18, 0x10, 1]),
        "no answer to an honest request: {answers:?}"
    );
});
