//! Faults hit what they are aimed at, and only that.

use super::*;
use omnibase_ethercat_wire::Address;
use omnibase_ethercat_wire::frame::FrameBuilder;

/// A cable with its far end in its near one: answers everything at once, counting one per datagram but for NOPs.
#[derive(Debug, Default)]
struct Echo {
    frames: VecDeque<Vec<u8>>,
}

impl Link for Echo {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let mut answer = frame.to_vec();
        for (offset, counter) in datagrams(frame) {
            let counted = u16::from(frame[offset] != Command::Nop.code()) * 2;
            put_u16(&mut answer, counter, counted);
        }
        self.frames.push_back(answer);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let Some(frame) = self.frames.pop_front() else { return Ok(None) };
        buffer[..frame.len()].copy_from_slice(&frame);
        Ok(Some(frame.len()))
    }
}

/// A frame with two datagrams of index `index`.
fn frame(index: u8) -> Vec<u8> {
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Brd, index, Address::broadcast(0), 2).unwrap();
    frame.push_zeros(Command::Lrd, index, Address::Logical(0), 4).unwrap();
    frame.bytes().to_vec()
}

/// Indices and working counters of the next answer.
fn answer(link: &mut FaultLink<Echo>) -> Option<(u8, Vec<u16>)> {
    let mut buffer = [0; MAX_FRAME];
    let length = link.receive(&mut buffer, HostTime(0)).unwrap()?;
    let read: Vec<_> = Datagrams::new(&buffer[..length]).unwrap().map(Result::unwrap).collect();
    Some((read[0].header.index, read.iter().map(|datagram| datagram.working_counter).collect()))
}

fn with(target: Target, action: FaultAction) -> FaultLink<Echo> {
    let mut link = FaultLink::new(Echo::default(), 1);
    link.inject(Injection { target, action });
    link
}

#[test]
fn without_faults_everything_passes() {
    let mut link = FaultLink::new(Echo::default(), 1);
    link.send(&frame(7)).unwrap();
    assert_eq!(answer(&mut link), Some((7, vec![2, 2])));
    assert_eq!(link.counts(), FaultCounts { frames: 1, datagrams: 2, faults: 0 });
}

#[test]
fn exactly_the_named_frame_is_dropped() {
    for action in [FaultAction::DropRequest, FaultAction::DropAnswer] {
        let mut link = with(Target::Frame(1), action);
        for index in 0..3 {
            link.send(&frame(index)).unwrap();
        }
        let arrived: Vec<_> = core::iter::from_fn(|| answer(&mut link)).map(|(index, _)| index).collect();
        assert_eq!(arrived, [0, 2], "{action:?}");
        assert_eq!(link.inner().frames.len(), 0);
    }
}

#[test]
fn exactly_the_named_datagram_gets_another_counter() {
    let mut link = with(Target::Datagram(3), FaultAction::WorkingCounter(0));
    link.send(&frame(0)).unwrap();
    link.send(&frame(1)).unwrap();
    assert_eq!(answer(&mut link), Some((0, vec![2, 2])));
    assert_eq!(answer(&mut link), Some((1, vec![2, 0])));
}

#[test]
fn a_short_count_is_one_less() {
    let mut link = with(Target::Frame(0), FaultAction::ShortCount);
    link.send(&frame(0)).unwrap();
    assert_eq!(answer(&mut link), Some((0, vec![1, 1])));
}

#[test]
fn a_datagram_that_nobody_processed_looks_as_it_was_sent() {
    let mut link = with(Target::Datagram(0), FaultAction::NotProcessed);
    let sent = frame(9);
    link.send(&sent).unwrap();
    let mut buffer = [0; MAX_FRAME];
    let length = link.receive(&mut buffer, HostTime(0)).unwrap().unwrap();
    let mut expected = sent.clone();
    let counter = expected.len() - 2;
    put_u16(&mut expected, counter, 2);
    assert_eq!(buffer[..length], expected);
}

#[test]
fn a_delayed_answer_comes_when_other_frames_were_sent() {
    let mut link = with(Target::Frame(0), FaultAction::Delay { frames: 2 });
    link.send(&frame(0)).unwrap();
    assert_eq!(answer(&mut link), None);
    link.send(&frame(1)).unwrap();
    assert_eq!(answer(&mut link).unwrap().0, 1);
    assert_eq!(answer(&mut link), None);
    link.send(&frame(2)).unwrap();
    assert_eq!(answer(&mut link).unwrap().0, 0);
    assert_eq!(answer(&mut link).unwrap().0, 2);
}

#[test]
fn answers_are_doubled_and_swapped() {
    let mut link = with(Target::Frame(0), FaultAction::Duplicate);
    link.send(&frame(0)).unwrap();
    assert_eq!((answer(&mut link).unwrap().0, answer(&mut link).unwrap().0, answer(&mut link)), (0, 0, None));

    let mut link = with(Target::Frame(0), FaultAction::Reorder);
    link.send(&frame(0)).unwrap();
    assert_eq!(answer(&mut link), None);
    link.send(&frame(1)).unwrap();
    assert_eq!((answer(&mut link).unwrap().0, answer(&mut link).unwrap().0), (1, 0));
}

#[test]
fn a_bit_is_flipped_and_a_bit_behind_the_end_is_none() {
    let mut link = with(Target::Frame(0), FaultAction::FlipBit { bit: 26 * 8 + 1 });
    link.inject(Injection { target: Target::Frame(0), action: FaultAction::FlipBit { bit: 1 << 20 } });
    link.send(&frame(0)).unwrap();
    let mut buffer = [0; MAX_FRAME];
    link.receive(&mut buffer, HostTime(0)).unwrap().unwrap();
    assert_eq!(buffer[26], 2);
}

#[test]
fn the_same_seed_gives_the_same_faults_at_the_rates_asked_for() {
    let rates = FaultRates {
        drop_request_ppm: 10_000,
        drop_answer_ppm: 10_000,
        delay_ppm: 10_000,
        delay_frames: 3,
        duplicate_ppm: 10_000,
        reorder_ppm: 10_000,
        short_count_ppm: 10_000,
        ..FaultRates::default()
    };
    let run = |seed| {
        let mut link = FaultLink::new(Echo::default(), seed);
        link.set_rates(rates);
        let mut seen = Vec::new();
        for n in 0..20_000u32 {
            link.send(&frame(n as u8)).unwrap();
            while let Some(answer) = answer(&mut link) {
                seen.push(answer);
            }
        }
        (seen, link.counts().faults)
    };
    let (first, second, other) = (run(42), run(42), run(43));
    assert_eq!(first, second);
    assert_ne!(first.0, other.0);
    // 6 % of 20 000 are 1200; five standard deviations are 168.
    assert!((1032..=1368).contains(&first.1), "{}", first.1);
    // 2 % are lost, 1 % come twice.
    assert!((19_700..=19_900).contains(&first.0.len()), "{}", first.0.len());
}
