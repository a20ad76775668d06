//! Firmware in another process, over a Unix socket; the protocol is described in `docs/pdi-socket.md`.

use crate::pdi::{AlEvent, Application, ApplicationFault, Pdi};
use core::time::Duration;
use omnibase_ethercat_wire::HostTime;
use omnibase_ethercat_wire::bytes::{put_u16, put_u32, u16_at, u64_at};
use omnibase_ethercat_wire::register as reg;
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Bytes of a message's header.
const HEADER: usize = 8;
/// Bytes of the AL event word that follows the header in messages to the firmware.
const EVENT_WORD: usize = 4;
/// Bytes that one read or write may have at most.
const MAX_LENGTH: usize = 4096;
const READ: u8 = 0x01;
const WRITE: u8 = 0x02;
const YIELD: u8 = 0x03;
const READ_ANSWER: u8 = 0x81;
const WRITE_ANSWER: u8 = 0x82;
const EVENT: u8 = 0x83;
const POWER_ON: u8 = 0x84;
/// Simulated time between looks at the socket while the firmware runs freely.
const FREE_POLL: Duration = Duration::from_micros(50);
/// Simulated time between looks for a firmware that isn't connected, or that hangs.
const IDLE_POLL: Duration = Duration::from_millis(1);
/// Real time after which firmware that doesn't yield counts as hung, and one that doesn't read as gone.
const HUNG_AFTER: Duration = Duration::from_secs(10);
/// Real time for which the next access of a burst is waited for: what a program takes between two accesses.
const BURST_GAP: Duration = Duration::from_micros(30);
/// Real time that one turn of a free-running firmware may take: several share the segment's time.
const TURN_LIMIT: Duration = Duration::from_micros(200);

/// Segment time that passes for each part of real time that a free-running firmware took: what it takes is then at most such a
/// share, also where the segment has to catch up, and several leave time to go on.
const TURNS_APART: u32 = 4;

/// Turns of a connected firmware between two looks for others that want to connect: that costs a system call.
const TURNS_ALONE: u32 = 200;

/// How the firmware's time goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// In real time, on its own.
    Free,
    /// Only while simulated time stands still: until it yields.
    Lockstep,
}

/// The application side of a SubDevice whose firmware connects to a Unix socket.
#[derive(Debug)]
pub struct SocketApplication {
    listener: UnixListener,
    path: PathBuf,
    pace: Pace,
    firmware: Option<Firmware>,
    /// Turns since somebody else was looked for.
    turns: u32,
}

/// A connected firmware.
#[derive(Debug)]
struct Firmware {
    stream: UnixStream,
    /// Bytes received that aren't a whole message yet.
    received: Vec<u8>,
    /// It must be told that power came.
    announce: bool,
    /// It yielded and waits for an event.
    waiting: bool,
    /// It said something since somebody asked whether it is there.
    heard: bool,
    /// It didn't yield in time: nobody waits for it.
    hung: bool,
    /// Real time after which it is.
    hung_after: Duration,
    /// When it wants to run again.
    wake: Option<HostTime>,
    /// The AL events that it knows of.
    known: u32,
    /// Looks at its socket while it runs freely.
    looks: u64,
}

/// What a look at the socket gave.
enum Look {
    Message,
    Nothing,
}

impl SocketApplication {
    /// Listens at `path`, which is removed in the end. What stands there is left alone, but a socket at which nobody listens any
    /// more, as a killed simulator leaves it.
    pub fn bind(path: impl AsRef<Path>, pace: Pace) -> io::Result<Self> {
        let path = path.as_ref().to_path_buf();
        let is_left = || {
            let is_socket = std::fs::symlink_metadata(&path).is_ok_and(|found| found.file_type().is_socket());
            let refused = |error: &io::Error| error.kind() == ErrorKind::ConnectionRefused;
            is_socket && UnixStream::connect(&path).is_err_and(|error| refused(&error))
        };
        // Whoever sees the socket is heard there: it has its name once it listens.
        let mut unnamed = path.clone().into_os_string();
        unnamed.push(format!(".{}", std::process::id()));
        let listener = UnixListener::bind(&unnamed)?;
        let named = match std::fs::hard_link(&unnamed, &path) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists && is_left() => {
                std::fs::remove_file(&path)?;
                std::fs::hard_link(&unnamed, &path)
            }
            named => named,
        };
        std::fs::remove_file(&unnamed)?;
        named.map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => ErrorKind::AddrInUse.into(),
            _ => error,
        })?;
        listener.set_nonblocking(true)?;
        Ok(SocketApplication { listener, path, pace, firmware: None, turns: 0 })
    }

    /// Waits until a firmware has connected, at most for `timeout` of real time.
    pub fn wait_for_firmware(&mut self, timeout: Duration) -> io::Result<()> {
        let begin = Instant::now();
        loop {
            self.accept();
            if self.firmware.is_some() {
                return Ok(());
            }
            if begin.elapsed() > timeout {
                return Err(io::Error::new(ErrorKind::TimedOut, "no firmware connected"));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Ends the connection of whoever comes beside the firmware that is connected.
    fn send_others_away(&mut self) {
        self.turns += 1;
        if self.turns >= TURNS_ALONE {
            self.turns = 0;
            drop(self.listener.accept());
        }
    }

    /// Takes a firmware that wants to connect.
    fn accept(&mut self) {
        if self.firmware.is_some() {
            return;
        }
        // Whatever goes wrong here goes wrong for the firmware: it sees its connection end.
        let Ok((stream, _)) = self.listener.accept() else { return };
        let prepared = stream
            .set_nonblocking(self.pace == Pace::Free)
            .and_then(|()| stream.set_read_timeout(Some(HUNG_AFTER)))
            .and_then(|()| stream.set_write_timeout(Some(HUNG_AFTER)));
        if prepared.is_ok() {
            self.firmware = Some(Firmware {
                stream,
                received: Vec::new(),
                announce: true,
                waiting: true,
                heard: true,
                hung: false,
                hung_after: HUNG_AFTER,
                wake: None,
                known: 0,
                looks: 0,
            });
        }
    }
}

impl Drop for SocketApplication {
    fn drop(&mut self) {
        // Nothing depends on it: a leftover socket only makes the next bind fail with a clear error.
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Application for SocketApplication {
    fn power_on(&mut self, _pdi: &mut dyn Pdi, _now: HostTime) {
        if let Some(firmware) = &mut self.firmware {
            firmware.announce = true;
            firmware.wake = None;
        }
    }

    fn run(&mut self, pdi: &mut dyn Pdi, event: AlEvent, now: HostTime) -> Option<HostTime> {
        self.accept();
        let Some(firmware) = &mut self.firmware else { return Some(now + IDLE_POLL) };
        let turn = match self.pace {
            Pace::Free => firmware.run_free(pdi, event, now),
            Pace::Lockstep => firmware.run_lockstep(pdi, event, now),
        };
        match turn {
            Ok(wake) => {
                self.send_others_away();
                wake
            }
            Err(_) => {
                self.firmware = None;
                Some(now + IDLE_POLL)
            }
        }
    }

    /// It said something, or has nothing to say before its next event.
    fn was_there(&mut self) -> bool {
        let heard = |firmware: &mut Firmware| core::mem::take(&mut firmware.heard) || firmware.waiting;
        self.firmware.as_mut().is_some_and(heard)
    }

    fn awaited_at(&self) -> Option<&Path> {
        self.firmware.is_none().then_some(&*self.path)
    }

    fn inject(&mut self, _fault: &ApplicationFault, _now: HostTime) -> bool {
        false
    }
}

impl Firmware {
    fn run_free(&mut self, pdi: &mut dyn Pdi, event: AlEvent, now: HostTime) -> io::Result<Option<HostTime>> {
        let mask = event_mask(pdi);
        let timed = self.waiting && self.wake.is_some_and(|wake| wake <= now);
        if self.announce || timed || event.0 & mask & !self.known != 0 {
            self.tell(event, now)?;
        }
        self.known = event.0;
        // One look where nothing comes; whoever has begun is waited for a little, for the next access follows.
        let mut taken = Duration::ZERO;
        if let Look::Message = self.counted_look(pdi, now)? {
            let began = Instant::now();
            let mut last = began;
            loop {
                let heard = self.counted_look(pdi, now)?;
                let present = Instant::now();
                match heard {
                    Look::Message => last = present,
                    Look::Nothing if present - last > BURST_GAP || self.waiting => break,
                    Look::Nothing => std::thread::yield_now(),
                }
                taken = present - began;
                if taken > TURN_LIMIT {
                    break;
                }
            }
        }
        Ok(Some(next_turn(now, taken)))
    }

    fn counted_look(&mut self, pdi: &mut dyn Pdi, now: HostTime) -> io::Result<Look> {
        self.looks += 1;
        self.look(pdi, now)
    }

    fn run_lockstep(
        &mut self,
        pdi: &mut dyn Pdi,
        event: AlEvent,
        now: HostTime,
    ) -> io::Result<Option<HostTime>> {
        if self.waiting || self.announce {
            self.tell(event, now)?;
        }
        // One that was hung is only looked at until it yields again.
        let patience = if self.hung { Duration::ZERO } else { self.hung_after };
        let begun = Instant::now();
        while !self.waiting {
            let looked = self.look(pdi, now)?;
            if matches!(looked, Look::Nothing) || !self.waiting && begun.elapsed() > patience {
                self.set_hung(true)?;
                return Ok(Some(now + IDLE_POLL));
            }
        }
        self.set_hung(false)?;
        Ok(self.wake)
    }

    fn set_hung(&mut self, hung: bool) -> io::Result<()> {
        if self.hung != hung {
            self.stream.set_nonblocking(hung)?;
            self.hung = hung;
        }
        Ok(())
    }

    /// Sends an event, or that power came.
    fn tell(&mut self, event: AlEvent, now: HostTime) -> io::Result<()> {
        let kind = if core::mem::take(&mut self.announce) { POWER_ON } else { EVENT };
        self.waiting = false;
        self.wake = None;
        self.send(kind, 0, event, &now.0.to_le_bytes())
    }

    fn send(&mut self, kind: u8, address: u16, event: AlEvent, data: &[u8]) -> io::Result<()> {
        let mut message = [0; HEADER + EVENT_WORD + MAX_LENGTH];
        message[0] = kind;
        put_u16(&mut message, 2, address);
        put_u16(&mut message, 4, data.len() as u16);
        put_u32(&mut message, HEADER, event.0);
        let start = HEADER + EVENT_WORD;
        message[start..start + data.len()].copy_from_slice(data);
        self.stream.write_all(&message[..start + data.len()])
    }

    /// Answers one message, if one is there or comes within the stream's timeout.
    fn look(&mut self, pdi: &mut dyn Pdi, now: HostTime) -> io::Result<Look> {
        loop {
            if let Some(length) = self.message_length()? {
                let message: Vec<u8> = self.received.drain(..length).collect();
                self.heard = true;
                self.answer(&message, pdi, now)?;
                return Ok(Look::Message);
            }
            let mut buffer = [0; HEADER + MAX_LENGTH];
            match self.stream.read(&mut buffer) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(length) => self.received.extend_from_slice(&buffer[..length]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    return Ok(Look::Nothing);
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// The length of the message that is received first, if it is there as a whole.
    fn message_length(&self) -> io::Result<Option<usize>> {
        if self.received.len() < HEADER {
            return Ok(None);
        }
        let length = usize::from(u16_at(&self.received, 4));
        let whole = match self.received[0] {
            READ if length <= MAX_LENGTH => HEADER,
            WRITE if length <= MAX_LENGTH => HEADER + length,
            YIELD if length == 8 => HEADER + length,
            _ => return Err(ErrorKind::InvalidData.into()),
        };
        Ok((self.received.len() >= whole).then_some(whole))
    }

    fn answer(&mut self, message: &[u8], pdi: &mut dyn Pdi, now: HostTime) -> io::Result<()> {
        let (address, length) = (u16_at(message, 2), usize::from(u16_at(message, 4)));
        match message[0] {
            READ => {
                let mut data = [0; MAX_LENGTH];
                let event = pdi.read(address, &mut data[..length]);
                self.known &= event.0;
                self.send(READ_ANSWER, address, event, &data[..length])
            }
            WRITE => {
                let event = pdi.write(address, &message[HEADER..]);
                self.known &= event.0;
                self.send(WRITE_ANSWER, address, event, &[])
            }
            _ => {
                let wait = u64_at(message, HEADER);
                self.waiting = true;
                // Time doesn't stand still for one that always wants to run at once.
                let wait_of = |ns| if ns == 0 { FREE_POLL } else { Duration::from_nanos(ns) };
                self.wake = (wait != u64::MAX).then(|| now + wait_of(wait));
                Ok(())
            }
        }
    }
}

/// When a free-running firmware is looked at again, whose turn took so much real time.
fn next_turn(now: HostTime, taken: Duration) -> HostTime {
    // What a pause of the host adds to a turn doesn't count.
    now + FREE_POLL.max(taken.min(TURN_LIMIT) * TURNS_APART)
}

fn event_mask(pdi: &mut dyn Pdi) -> u32 {
    let mut mask = [0; 4];
    pdi.read(reg::AL_EVENT_MASK, &mut mask);
    u32::from_le_bytes(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_that_a_killed_simulator_left_is_taken_over_and_nothing_else_is() {
        let path = std::env::temp_dir().join(format!("omnibase-{}-left.pdi", std::process::id()));
        drop(UnixListener::bind(&path).unwrap());
        let listening = SocketApplication::bind(&path, Pace::Free).unwrap();
        let refused = |path: &Path| SocketApplication::bind(path, Pace::Free).err().map(|error| error.kind());
        assert_eq!(refused(&path), Some(ErrorKind::AddrInUse), "somebody listens there");
        drop(listening);
        std::fs::write(&path, "no socket").unwrap();
        assert_eq!(refused(&path), Some(ErrorKind::AddrInUse));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "no socket");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn whoever_sees_the_socket_is_heard_there() {
        let path = std::env::temp_dir().join(format!("omnibase-{}-seen.pdi", std::process::id()));
        for _ in 0..2000 {
            let seen = path.clone();
            let firmware = std::thread::spawn(move || {
                while !seen.exists() {
                    std::hint::spin_loop();
                }
                UnixStream::connect(&seen).map(drop)
            });
            let listening = SocketApplication::bind(&path, Pace::Free).unwrap();
            firmware.join().unwrap().unwrap();
            drop(listening);
        }
    }

    /// A chip whose AL request is acknowledged by any read.
    struct Chip {
        event: u32,
    }

    impl Pdi for Chip {
        fn read(&mut self, address: u16, data: &mut [u8]) -> AlEvent {
            data.fill(0xFF);
            if address == reg::AL_CONTROL {
                self.event = 0;
            }
            AlEvent(self.event)
        }

        fn write(&mut self, _address: u16, _data: &[u8]) -> AlEvent {
            AlEvent(self.event)
        }
    }

    fn connected() -> (Firmware, UnixStream) {
        let (ours, theirs) = UnixStream::pair().unwrap();
        ours.set_nonblocking(true).unwrap();
        theirs.set_nonblocking(true).unwrap();
        let firmware = Firmware {
            stream: ours,
            received: Vec::new(),
            announce: false,
            waiting: false,
            heard: true,
            hung: false,
            hung_after: HUNG_AFTER,
            wake: None,
            known: 0,
            looks: 0,
        };
        (firmware, theirs)
    }

    /// The kinds of the messages that the firmware received.
    fn kinds(stream: &mut UnixStream) -> Vec<u8> {
        let mut bytes = Vec::new();
        let end = stream.read_to_end(&mut bytes).unwrap_err();
        assert_eq!(end.kind(), ErrorKind::WouldBlock);
        let (mut at, mut kinds) = (0, Vec::new());
        while at < bytes.len() {
            kinds.push(bytes[at]);
            at += HEADER + EVENT_WORD + usize::from(u16_at(&bytes, at + 4));
        }
        kinds
    }

    #[test]
    fn a_free_firmware_is_told_of_an_event_once_and_again_when_it_had_acknowledged() {
        let (mut firmware, mut theirs) = connected();
        let mut chip = Chip { event: 1 };
        let mut run = |firmware: &mut Firmware, event| {
            chip.event = event;
            firmware.run_free(&mut chip, AlEvent(event), HostTime(0)).unwrap()
        };
        assert_eq!(run(&mut firmware, 1), Some(HostTime(50_000)));
        assert_eq!(kinds(&mut theirs), [EVENT]);
        run(&mut firmware, 1);
        assert_eq!(kinds(&mut theirs), []);
        theirs.write_all(&[READ, 0, 0x20, 0x01, 2, 0, 0, 0]).unwrap();
        run(&mut firmware, 1);
        assert_eq!(kinds(&mut theirs), [READ_ANSWER]);
        run(&mut firmware, 1);
        assert_eq!(kinds(&mut theirs), [EVENT]);
        // A yield with a time is answered when it is over.
        theirs.write_all(&[YIELD, 0, 0, 0, 8, 0, 0, 0, 100, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        run(&mut firmware, 1);
        assert_eq!(kinds(&mut theirs), []);
        firmware.run_free(&mut Chip { event: 1 }, AlEvent(1), HostTime(100)).unwrap();
        assert_eq!(kinds(&mut theirs), [EVENT]);
    }

    /// An idle firmware costs one look each 50 us, however many there are: time goes on beside them.
    #[test]
    fn an_idle_firmware_costs_one_look() {
        let (mut firmware, _theirs) = connected();
        let mut chip = Chip { event: 0 };
        for turn in 0..100 {
            firmware.run_free(&mut chip, AlEvent(0), HostTime(turn * 50_000)).unwrap();
        }
        assert_eq!(firmware.looks, 100);
    }

    /// Two that never pause take half of the time at most: the segment's goes on, and catches up where it was held up.
    #[test]
    fn a_firmware_that_never_yields_is_looked_at_less_often() {
        let spent = |turn: Duration| {
            let (mut now, mut taken) = (HostTime(0), Duration::ZERO);
            while now < HostTime(1_000_000_000) {
                taken += turn;
                now = next_turn(now, turn);
            }
            taken
        };
        for turn in [1, 12, 50, 200].map(Duration::from_micros) {
            assert!(2 * spent(turn) <= Duration::from_millis(501), "{turn:?}: {:?}", spent(turn));
        }
        assert_eq!(next_turn(HostTime(0), Duration::ZERO), HostTime(0) + FREE_POLL);
        assert_eq!(next_turn(HostTime(0), Duration::from_secs(1)), HostTime(800_000));
    }

    #[test]
    fn who_is_missing_is_known_and_a_second_firmware_is_sent_away() {
        let path = std::env::temp_dir().join(format!("omnibase-{}-second.pdi", std::process::id()));
        let mut application = SocketApplication::bind(&path, Pace::Free).unwrap();
        assert_eq!(application.awaited_at(), Some(&*path));
        let connect = || {
            let stream = UnixStream::connect(&path).unwrap();
            stream.set_nonblocking(true).unwrap();
            stream
        };
        let mut first = connect();
        let mut second = connect();
        for turn in 0..=TURNS_ALONE {
            application.run(&mut Chip { event: 0 }, AlEvent(0), HostTime(u64::from(turn) * 50_000));
        }
        assert_eq!(application.awaited_at(), None);
        assert_eq!(kinds(&mut first), [POWER_ON]);
        assert_eq!(second.read(&mut [0; 8]).unwrap(), 0, "its connection is ended");
        drop(first);
        application.run(&mut Chip { event: 0 }, AlEvent(0), HostTime(1_000_000_000));
        assert_eq!(application.awaited_at(), Some(&*path), "the next one may come");
    }

    #[test]
    fn a_firmware_that_went_away_ends_its_turn() {
        let (mut firmware, theirs) = connected();
        drop(theirs);
        assert!(firmware.run_free(&mut Chip { event: 0 }, AlEvent(0), HostTime(0)).is_err());
    }

    /// Firmware that asks for ever without yielding is hung as one that is silent is: looked at once a turn, and time goes on.
    #[test]
    fn firmware_that_never_yields_doesnt_keep_time_from_going_on() {
        let (mut firmware, mut theirs) = connected();
        firmware.hung_after = Duration::ZERO;
        let mut chip = Chip { event: 0 };
        for _ in 0..5 {
            theirs.write_all(&[READ, 0, 0x20, 0x01, 2, 0, 0, 0]).unwrap();
        }
        for turn in 0..3 {
            let wake = firmware.run_lockstep(&mut chip, AlEvent(0), HostTime(turn)).unwrap();
            assert_eq!((wake, firmware.hung), (Some(HostTime(turn) + IDLE_POLL), true));
            assert_eq!(kinds(&mut theirs), [READ_ANSWER]);
        }
        // It yields behind its last two, and is waited for again.
        theirs.write_all(&[YIELD, 0, 0, 0, 8, 0, 0, 0, 100, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        for _ in 0..2 {
            firmware.run_lockstep(&mut chip, AlEvent(0), HostTime(5)).unwrap();
            assert!(firmware.hung);
        }
        let wake = firmware.run_lockstep(&mut chip, AlEvent(0), HostTime(5)).unwrap();
        assert_eq!((wake, firmware.hung), (Some(HostTime(105)), false));
    }

    /// Whoever yields for no time gets its next turn a little later all the same.
    #[test]
    fn a_yield_for_no_time_takes_some() {
        let (mut firmware, mut theirs) = connected();
        theirs.write_all(&[YIELD, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        let wake = firmware.run_lockstep(&mut Chip { event: 0 }, AlEvent(0), HostTime(7)).unwrap();
        assert_eq!(wake, Some(HostTime(7) + FREE_POLL));
    }
}
