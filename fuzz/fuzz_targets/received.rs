//! Any bytes as datagrams of motion capture: what comes out as a pose is finite, and of no later than now.
#![no_main]

use std::net::{IpAddr, Ipv4Addr};

use libfuzzer_sys::fuzz_target;
use omnibase_receive::datagram::DatagramHearing;
use omnibase_receive::natnet::{NatNet, Outcome};
use omnibase_robot::config::{BodyChoice, DatagramPlan, NatNetPlan, UpAxis};
use omnibase_robot::signals::Heard;

const SERVER: Ipv4Addr = Ipv4Addr::LOCALHOST;
const STEP_NS: u64 = 5_000_000;

fn is_sound(heard: &Heard, now_ns: u64) {
    assert!(heard.values[..9].iter().all(|value| value.is_finite()), "{heard:?}");
    assert!(heard.instant_ns <= now_ns, "{heard:?} at {now_ns}");
}

fuzz_target!(|bytes: &[u8]| {
    let Some((version, rest)) = bytes.split_at_checked(2) else { return };
    let mut talk = NatNet::new(&NatNetPlan {
        server: SERVER,
        local: SERVER,
        multicast: None,
        command_port: 1510,
        data_port: 1511,
        body: BodyChoice::Id(u32::from(version[0] >> 4)),
        up_axis: if version[0] & 1 == 0 { UpAxis::Y } else { UpAxis::Z },
        unit_m: 1.0,
    });
    let mut info = vec![1, 0, 23, 1];
    info.resize(4 + 260, 0);
    info.extend([3 + (version[0] >> 1 & 1), version[1] % 4, 0, 0]);
    info.extend(1_000_000_000_u64.to_le_bytes());
    info.extend([0; 7]);
    talk.take(&info, SERVER, 0).expect("a server");
    let mut hearing =
        DatagramHearing::new(&DatagramPlan { address: (SERVER, 8500).into(), peer: IpAddr::V4(SERVER) });
    let mut now_ns = 0;
    // Messages one after the other, each behind its length.
    let mut left = rest;
    while let Some(([low, high], behind)) = left.split_first_chunk::<2>() {
        let (message, after) =
            behind.split_at(behind.len().min(usize::from(u16::from_le_bytes([*low, *high]))));
        left = after;
        now_ns += STEP_NS;
        if let Ok(taken) = hearing.take(message, IpAddr::V4(SERVER), now_ns) {
            is_sound(&taken.heard, now_ns);
        }
        let headed = [
            message.get(..2).unwrap_or(&[7, 0]),
            &(message.len().saturating_sub(2) as u16).to_le_bytes(),
            message.get(2..).unwrap_or_default(),
        ];
        if let Ok(Outcome::Pose(heard, _)) = talk.take(&headed.concat(), SERVER, now_ns) {
            is_sound(&heard, now_ns);
        }
    }
});
