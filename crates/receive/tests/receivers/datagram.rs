//! Plain datagrams: each wrong byte is refused, each good one counts once.

use std::net::{IpAddr, Ipv4Addr};

use omnibase_receive::datagram::*;
use omnibase_robot::config::DatagramPlan;
use proptest::prelude::*;

const MS: u64 = 1_000_000;
const PEER: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 168, 1, 20));

fn hearing() -> DatagramHearing {
    DatagramHearing::new(&DatagramPlan { address: "192.168.1.10:8500".parse().unwrap(), peer: PEER })
}

fn sent(sequence: u32) -> PoseDatagram {
    PoseDatagram {
        sequence,
        instant_ns: 1000 * MS + u64::from(sequence) * 10 * MS,
        sent_ns: 1004 * MS + u64::from(sequence) * 10 * MS,
        pose: [1.5, -0.25, 0.5],
        covariance: Some([1e-6, 0.0, 0.0, 4e-6, 0.0, 1e-5]),
        echo: None,
        answer: Answer::Unwanted,
    }
}

/// When that comes by our clock: 70 s ahead of the sender's, and 2 ms on its way.
fn arrives_ns(sent: &PoseDatagram) -> u64 {
    sent.sent_ns + 70_002 * MS
}

/// The bytes as the guide writes them, made by Python's `struct.pack("<4sBBHIIQQddd", b"OBPS", 1, 0, 56, 7, 0, 10**9,
/// 10**9 + 5 * 10**6, 1.5, -0.25, 0.5)`.
const GOLDEN: [u8; 56] = [
    0x4F, 0x42, 0x50, 0x53, 0x01, 0x00, 0x38, 0x00, 0x07, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0xCA, 0x9A, 0x3B, 0x00, 0x00, 0x00, 0x00, 0x40, 0x15, 0xE7, 0x3B, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0xF8, 0x3F, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xD0, 0xBF, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0xE0, 0x3F,
];

#[test]
fn the_bytes_are_those_of_the_guide() {
    let plain = PoseDatagram::from_bytes(&GOLDEN).unwrap();
    assert_eq!((plain.sequence, plain.instant_ns, plain.sent_ns), (7, 1000 * MS, 1005 * MS));
    assert_eq!((plain.pose, plain.covariance, plain.echo), ([1.5, -0.25, 0.5], None, None));
    assert_eq!(plain.to_bytes(), GOLDEN);
    let whole =
        PoseDatagram { echo: Some(Echo { told_ns: 3, held_ns: 4 }), answer: Answer::Wanted, ..sent(9) };
    let bytes = whole.to_bytes();
    assert_eq!((bytes.len(), bytes[5]), (BYTES[1], 7));
    assert_eq!(PoseDatagram::from_bytes(&bytes).unwrap(), whole);
}

#[test]
fn what_is_wrong_is_refused_by_name() {
    let change = |at: usize, to: &[u8]| {
        let mut bytes = sent(1).to_bytes();
        bytes[at..at + to.len()].copy_from_slice(to);
        PoseDatagram::from_bytes(&bytes).unwrap_err().to_string()
    };
    for (at, to, words) in [
        (0, &b"OBPX"[..], "don't begin with OBPS"),
        (4, &[2], "version 2"),
        (5, &[0x81], "flags 0x81"),
        (6, &[0, 1], "256 as it says itself"),
        (16, &u64::MAX.to_le_bytes(), "its instant is"),
        (32, &f64::NAN.to_le_bytes(), "x is NaN"),
        (40, &f64::INFINITY.to_le_bytes(), "y is inf"),
        (48, &1e308_f64.to_le_bytes(), "heading is 1000"),
        (56, &(-1e-6_f64).to_le_bytes(), "a variance is -0.000001"),
        (64, &1.0_f64.to_le_bytes(), "beside its variances"),
        (96, &f64::NAN.to_le_bytes(), "covariance is NaN"),
    ] {
        let told = change(at, to);
        assert!(told.contains(words), "{at}: {told}");
    }
    let bytes = sent(1).to_bytes();
    for length in 0..bytes.len() {
        assert!(PoseDatagram::from_bytes(&bytes[..length]).is_err(), "{length} bytes");
    }
    assert!(PoseDatagram::from_bytes(&[&bytes[..], &[0]].concat()).is_err(), "one more");
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..200), flags in 0_u8..8) {
        let _ = PoseDatagram::from_bytes(&bytes);
        let mut likely = bytes;
        likely.resize(104, 0);
        likely[..8].copy_from_slice(&[b'O', b'B', b'P', b'S', 1, flags, 104, 0]);
        let mut hearing = hearing();
        let _ = hearing.take(&likely, PEER, u64::MAX);
    }
}

#[test]
fn a_pose_comes_out_at_its_instant_with_its_covariance() {
    let mut hearing = hearing();
    let first = sent(1);
    let taken = hearing.take(&first.to_bytes(), PEER, arrives_ns(&first)).unwrap();
    // Measured 4 ms before it was sent; what it was on its way can't be known from one side.
    assert_eq!(taken.heard.instant_ns, arrives_ns(&first) - 4 * MS);
    assert_eq!(taken.heard.values[..9], [1.5, -0.25, 0.5, 1e-6, 0.0, 0.0, 4e-6, 0.0, 1e-5]);
    assert!(taken.heard.values[9].is_nan() && taken.mapped.bound_ns.is_none() && taken.answer.is_none());
}

#[test]
fn who_answers_is_told_how_well_it_is_known() {
    let mut hearing = hearing();
    let asks = PoseDatagram { answer: Answer::Wanted, ..sent(1) };
    let now_ns = arrives_ns(&asks);
    let answer = hearing.take(&asks.to_bytes(), PEER, now_ns).unwrap().answer.unwrap();
    assert_eq!((&answer[..8], &answer[8..12]), (&b"OBCK\x01\0\0\0"[..], &[1, 0, 0, 0][..]));
    let told_ns = u64::from_le_bytes(answer[12..].try_into().unwrap());
    assert_eq!(told_ns, now_ns);
    // It was 2 ms on its way back, and 6 ms later the next is sent, which is 2 ms on its way.
    let next = PoseDatagram { echo: Some(Echo { told_ns, held_ns: 6 * MS }), ..sent(2) };
    let taken = hearing.take(&next.to_bytes(), PEER, arrives_ns(&next)).unwrap();
    let true_ns = next.instant_ns + 70_000 * MS;
    let bound_ns = taken.mapped.bound_ns.unwrap();
    assert!(taken.heard.instant_ns.abs_diff(true_ns) <= bound_ns && bound_ns < 3 * MS, "{taken:?}");
    assert!(taken.heard.instant_ns.abs_diff(true_ns) < MS, "nearer than from one side");
}

#[test]
fn an_instant_that_is_not_known_blurs_the_pose_of_who_moves() {
    let covariance = |speed_m_s: f64| {
        let mut hearing = hearing();
        let mut told_ns = None;
        let mut last = None;
        for sequence in 1..20 {
            let mut one = PoseDatagram {
                echo: told_ns.map(|told_ns| Echo { told_ns, held_ns: 6 * MS }),
                answer: Answer::Wanted,
                ..sent(sequence)
            };
            one.pose[1] += speed_m_s * f64::from(sequence) * 0.01;
            let taken = hearing.take(&one.to_bytes(), PEER, arrives_ns(&one)).unwrap();
            told_ns = taken.answer.map(|answer| u64::from_le_bytes(answer[12..].try_into().unwrap()));
            last = Some(taken);
        }
        let taken = last.unwrap();
        (taken.heard.values[3..9].to_vec(), taken.mapped.bound_ns.unwrap() as f64 * 1e-9)
    };
    let told = [1e-6, 0.0, 0.0, 4e-6, 0.0, 1e-5];
    assert_eq!(covariance(0.0).0, told, "who rests");
    let (blurred, bound_s) = covariance(2.0);
    let expected_m2 = 4e-6 + (2.0 * bound_s).powi(2) / 3.0;
    assert!((blurred[3] / expected_m2 - 1.0).abs() < 1e-6 && blurred[3] > 5e-6, "{blurred:?}, {bound_s} s");
    assert_eq!((blurred[0], blurred[5]), (told[0], told[5]), "along its way alone");
}

#[test]
fn strangers_and_repeats_are_refused_and_who_begins_anew_is_heard() {
    let mut hearing = hearing();
    let mut take = |sequence: u32, from: IpAddr| {
        let mut one = sent(0);
        one.sequence = sequence;
        hearing.take(&one.to_bytes(), from, arrives_ns(&one)).map(drop)
    };
    let other = IpAddr::V4(Ipv4Addr::new(192, 168, 1, 21));
    assert_eq!(take(1, other), Err(Refused::Stranger { found: other, expected: PEER }));
    for sequence in [100, 103, 101, 102, 90] {
        assert_eq!(take(sequence, PEER), Ok(()), "{sequence}, in any order");
    }
    for sequence in [100, 101, 103, 90] {
        assert_eq!(take(sequence, PEER), Err(Refused::Again { sequence }));
    }
    assert_eq!(take(1, PEER), Ok(()), "it began anew");
    assert_eq!(take(u32::MAX, PEER), Ok(()), "just before");
}

#[test]
fn what_a_sender_says_of_our_future_counts_for_nothing() {
    let mut hearing = hearing();
    let lies = PoseDatagram { echo: Some(Echo { told_ns: u64::MAX, held_ns: u64::MAX }), ..sent(1) };
    let taken = hearing.take(&lies.to_bytes(), PEER, arrives_ns(&lies)).unwrap();
    assert_eq!(taken.mapped.bound_ns, None);
    assert!(taken.heard.instant_ns <= arrives_ns(&lies));
}

/// A sender that heard no answer yet, or remembers that of another run: what it sends besides is taken in as if it had said nothing.
#[test]
fn an_echo_of_what_was_never_told_counts_for_nothing() {
    for (told_ns, held_ns) in [(0, 0), (1, 60_000 * MS), (3, u64::MAX)] {
        let mut hearing = hearing();
        let first = PoseDatagram { echo: Some(Echo { told_ns, held_ns }), answer: Answer::Wanted, ..sent(1) };
        let taken = hearing.take(&first.to_bytes(), PEER, arrives_ns(&first)).unwrap();
        assert_eq!(taken.mapped.bound_ns, None, "{told_ns}");
        // It hears the answer, and from then on says what was told.
        let told_ns = u64::from_le_bytes(taken.answer.unwrap()[12..].try_into().unwrap());
        let next = PoseDatagram { echo: Some(Echo { told_ns, held_ns: 6 * MS }), ..sent(2) };
        let taken = hearing.take(&next.to_bytes(), PEER, arrives_ns(&next)).unwrap();
        assert!(taken.mapped.bound_ns.unwrap() < 3 * MS, "{taken:?}");
    }
}

/// It heard the answer a second later than it says, or was held up on the way: the middle would be half a second off.
#[test]
fn an_echo_that_bounds_hardly_anything_leaves_the_instant_where_the_other_side_has_it() {
    let mut hearing = hearing();
    let asks = PoseDatagram { answer: Answer::Wanted, ..sent(1) };
    let answer = hearing.take(&asks.to_bytes(), PEER, arrives_ns(&asks)).unwrap().answer.unwrap();
    let told_ns = u64::from_le_bytes(answer[12..].try_into().unwrap());
    let late = PoseDatagram { echo: Some(Echo { told_ns, held_ns: 0 }), ..sent(101) };
    let taken = hearing.take(&late.to_bytes(), PEER, arrives_ns(&late)).unwrap();
    assert_eq!(taken.heard.instant_ns, arrives_ns(&late) - 4 * MS);
    assert!(taken.mapped.bound_ns.unwrap() > 900 * MS, "{taken:?}");
}

#[test]
fn a_covariance_whose_pairs_contradict_each_other_is_none() {
    let read = |all: [f64; 6]| {
        PoseDatagram::from_bytes(&PoseDatagram { covariance: Some(all), ..sent(1) }.to_bytes())
    };
    let told = read([1.0, 0.9, 0.9, 1.0, -0.9, 1.0]).unwrap_err().to_string();
    assert!(told.contains("determinant is -2.88"), "{told}");
    assert!(read([1e200, 0.0, 0.0, 1.0, 0.0, 1.0]).unwrap_err().to_string().contains("a variance"));
    assert!(read([1.0, 2.0, 4.0, 4.0, 8.0, 16.0]).is_ok(), "known but for one direction");
}
