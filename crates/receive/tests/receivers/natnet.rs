//! The talk with Motive: versions, axes, bodies that are lost, bytes that are cut off.

use std::net::Ipv4Addr;

use omnibase_receive::natnet::{NatNet, Outcome, Refused};
use omnibase_robot::config::{BodyChoice, NatNetPlan, UpAxis};
use proptest::prelude::*;

use crate::motive::{self, Sent};

const MS: u64 = 1_000_000;
const SERVER: Ipv4Addr = Ipv4Addr::new(192, 168, 1, 20);
/// Its clock ticks ten times a microsecond, and began 3 s after ours.
const TICKS_PER_S: u64 = 10_000_000;
const VERSIONS: [[u8; 2]; 5] = [[3, 0], [3, 1], [4, 0], [4, 1], [4, 2]];

fn ticks(ours_ns: u64) -> u64 {
    (ours_ns - 3000 * MS) / 100
}

fn plan(body: BodyChoice) -> NatNetPlan {
    NatNetPlan {
        server: SERVER,
        local: Ipv4Addr::UNSPECIFIED,
        multicast: None,
        command_port: 1510,
        data_port: 1511,
        body,
        up_axis: UpAxis::Y,
        unit_m: 1.0,
    }
}

/// A quarter turn to the left about y up, at 1 m along x and 2 m along -z.
fn standing() -> Sent {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    Sent { id: 7, position: [1.0, 0.3, -2.0], rotation: [0.0, half, 0.0, half], error: 0.001, flags: 1 }
}

fn met(version: [u8; 2], plan: &NatNetPlan) -> NatNet {
    let mut talk = NatNet::new(plan);
    let said = talk.take(&motive::server_info(version, TICKS_PER_S), SERVER, 4000 * MS).unwrap();
    assert!(matches!(said, Outcome::Server(name, _) if name == "Motive"));
    talk
}

fn frame(version: [u8; 2], number: u32, bodies: &[Sent], now_ns: u64) -> Vec<u8> {
    motive::frame(version, number, bodies, [ticks(now_ns - 8 * MS), ticks(now_ns - MS)])
}

fn near(found: &[f64], expected: [f64; 3]) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-6, "{found} and {expected}");
    }
}

#[test]
fn each_version_is_read_and_its_instant_is_that_of_the_shutters() {
    for version in VERSIONS {
        let mut talk = met(version, &plan(BodyChoice::Id(7)));
        let now_ns = 5000 * MS;
        let other = Sent { id: 3, ..standing() };
        let bytes = frame(version, 1, &[other, standing()], now_ns);
        let Ok(Outcome::Pose(heard, mapped)) = talk.take(&bytes, SERVER, now_ns) else {
            panic!("{version:?}")
        };
        near(&heard.values, [1.0, 2.0, std::f64::consts::FRAC_PI_2]);
        assert!((heard.values[3] - 1e-6).abs() < 1e-12, "the markers' error");
        // It was 1 ms on its way, which one side doesn't tell.
        assert_eq!((heard.instant_ns, mapped.bound_ns), (now_ns - 7 * MS, None));
        assert_eq!(talk.take(&bytes, SERVER, now_ns), Err(Refused::Again(1)));
        let next = frame(version, 2, &[standing()], now_ns + 10 * MS);
        talk.take(&next, SERVER, now_ns + 10 * MS).unwrap();
        assert_eq!(
            talk.take(&bytes, SERVER, now_ns + 11 * MS),
            Err(Refused::Again(1)),
            "behind the next, too"
        );
    }
}

#[test]
fn answers_with_its_clock_bound_the_instant() {
    let mut talk = met([4, 1], &plan(BodyChoice::Id(7)));
    let requests = talk.requests(4000 * MS);
    let sorts: Vec<u16> = requests.iter().map(|bytes| u16::from_le_bytes([bytes[0], bytes[1]])).collect();
    assert_eq!(sorts, [10, 12], "a sign of life, and a question for its clock");
    let asked_ns = u64::from_le_bytes(requests[1][4..].try_into().unwrap());
    assert_eq!(asked_ns, 4000 * MS);
    // A millisecond there, two back.
    talk.take(&motive::echo(asked_ns, ticks(4001 * MS)), SERVER, 4003 * MS).unwrap();
    let now_ns = 4100 * MS;
    let Ok(Outcome::Pose(heard, mapped)) =
        talk.take(&frame([4, 1], 1, &[standing()], now_ns), SERVER, now_ns)
    else {
        panic!()
    };
    let off_ns = heard.instant_ns.abs_diff(now_ns - 8 * MS);
    assert!(off_ns <= MS && mapped.bound_ns.is_some_and(|bound_ns| off_ns <= bound_ns && bound_ns < 2 * MS));
}

#[test]
fn axes_and_units_are_as_the_file_says() {
    let mut mm = plan(BodyChoice::Id(7));
    (mm.up_axis, mm.unit_m) = (UpAxis::Z, 0.001);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let body = Sent {
        position: [1000.0, -2000.0, 5.0],
        rotation: [0.0, 0.0, -half, half],
        error: 0.5,
        ..standing()
    };
    let now_ns = 5000 * MS;
    let Ok(Outcome::Pose(heard, _)) =
        met([3, 1], &mm).take(&frame([3, 1], 1, &[body], now_ns), SERVER, now_ns)
    else {
        panic!()
    };
    near(&heard.values, [1.0, -2.0, -std::f64::consts::FRAC_PI_2]);
    // The other axis up: the body lies on its side.
    let told = met([3, 1], &mm).take(&frame([3, 1], 1, &[standing()], now_ns), SERVER, now_ns).unwrap_err();
    assert!(
        told.to_string().contains("tilt in degrees is 90") && told.to_string().contains("up_axis"),
        "{told}"
    );
}

#[test]
fn a_body_is_found_by_its_name_in_each_version() {
    for version in VERSIONS {
        let mut talk = met(version, &plan(BodyChoice::Name("robot".into())));
        let requests = talk.requests(4000 * MS);
        assert_eq!(requests[0][..2], [4, 0], "who is there");
        let now_ns = 5000 * MS;
        let told = talk.take(&frame(version, 1, &[standing()], now_ns), SERVER, now_ns).unwrap_err();
        assert_eq!(told.to_string(), "the frame has no rigid body \"robot\"; it has 7");
        let names = motive::descriptions(version, &[("cart", 3), ("robot", 7)]);
        talk.take(&names, SERVER, 4900 * MS).unwrap();
        let said = talk.take(&frame(version, 2, &[standing()], now_ns), SERVER, now_ns);
        assert!(matches!(said, Ok(Outcome::Pose(..))), "{version:?}: {said:?}");
        for length in 4..names.len() {
            let cut = motive::message(5, &names[4..length]);
            let _ = talk.take(&cut, SERVER, now_ns);
        }
    }
}

#[test]
fn who_isnt_seen_or_cant_be_is_no_pose() {
    let mut talk = met([4, 2], &plan(BodyChoice::Id(7)));
    let mut number = 0;
    let mut told = |body: Sent| {
        number += 1;
        let now_ns = 5000 * MS + u64::from(number) * 10 * MS;
        let refused = talk.take(&frame([4, 2], number, &[body], now_ns), SERVER, now_ns).unwrap_err();
        refused.to_string()
    };
    assert_eq!(told(Sent { flags: 0, ..standing() }), "the rigid body isn't tracked");
    assert!(told(Sent { id: 8, ..standing() }).contains("no rigid body 7; it has 8"));
    assert!(told(Sent { position: [f32::NAN, 0.0, 0.0], ..standing() }).contains("NaN"));
    assert!(told(Sent { rotation: [0.0; 4], ..standing() }).contains("length of the quaternion is 0"));
    assert!(told(Sent { position: [1e9, 0.0, 0.0], ..standing() }).contains("x is 1000000000"));
}

#[test]
fn strangers_other_versions_and_cut_frames_are_refused() {
    let mut talk = NatNet::new(&plan(BodyChoice::Id(7)));
    let now_ns = 5000 * MS;
    let whole = frame([4, 1], 1, &[standing()], now_ns);
    assert_eq!(talk.take(&whole, SERVER, now_ns), Err(Refused::Unknown));
    let other = Ipv4Addr::new(192, 168, 1, 21);
    let info = motive::server_info([4, 1], TICKS_PER_S);
    assert_eq!(talk.take(&info, other, now_ns), Err(Refused::Stranger { found: other, expected: SERVER }));
    for version in [[2, 9], [5, 0]] {
        let told = talk.take(&motive::server_info(version, TICKS_PER_S), SERVER, now_ns);
        assert!(matches!(told, Err(Refused::Version(_))), "{told:?}");
    }
    let mut talk = met([4, 1], &plan(BodyChoice::Id(7)));
    // Its last 14 bytes (a finer time, flags, an end) are nothing that is read.
    for length in 0..whole.len() - 14 {
        let cut = if length < 4 { whole[..length].to_vec() } else { motive::message(7, &whole[4..length]) };
        assert!(talk.take(&cut, SERVER, now_ns).is_err(), "{length} bytes");
    }
    let mut lies = whole.clone();
    lies[2] += 1;
    assert!(matches!(talk.take(&lies, SERVER, now_ns), Err(Refused::Length { .. })));
    // Read by another version it is no frame.
    let told = met([3, 1], &plan(BodyChoice::Id(7))).take(&whole, SERVER, now_ns).unwrap_err();
    assert!(
        matches!(told, Refused::Short { .. } | Refused::NoBody { .. } | Refused::Value { .. }),
        "{told:?}"
    );
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(
        sort in prop_oneof![Just(1_u16), Just(5), Just(7), Just(13), any::<u16>()],
        body in prop::collection::vec(any::<u8>(), 0..400),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        version in 0_usize..5,
    ) {
        let version = VERSIONS[version];
        let mut talk = met(version, &plan(BodyChoice::Name("robot".into())));
        let _ = talk.take(&motive::message(sort, &body), SERVER, 5000 * MS);
        let _ = talk.take(&motive::descriptions(version, &[("robot", 7)]), SERVER, 5000 * MS);
        let mut likely = frame(version, 1, &[standing()], 5000 * MS);
        for (at, to) in changes {
            let at = 4 + at.index(likely.len() - 4);
            likely[at] = to;
        }
        let _ = talk.take(&likely, SERVER, 5000 * MS);
    }
}

#[test]
fn a_server_that_was_gone_is_asked_anew() {
    let mut talk = NatNet::new(&plan(BodyChoice::Id(7)));
    let sort = |requests: Vec<Vec<u8>>| requests.iter().map(|bytes| bytes[0]).collect::<Vec<_>>();
    assert_eq!(sort(talk.requests(0)), [0]);
    assert_eq!(sort(talk.requests(500 * MS)), Vec::<u8>::new());
    assert_eq!(sort(talk.requests(1000 * MS)), [0]);
    talk.take(&motive::server_info([3, 1], TICKS_PER_S), SERVER, 4000 * MS).unwrap();
    assert_eq!(sort(talk.requests(4100 * MS)), [10, 12]);
    assert_eq!(sort(talk.requests(7101 * MS)), [0], "it said nothing for three seconds");
}
