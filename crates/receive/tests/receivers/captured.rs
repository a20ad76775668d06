//! Frames that a Motive really sent, where somebody keeps them: `OMNIBASE_NATNET_CAPTURES` is a folder with the test data
//! of the public `python_natnet` (M. Edwards). Its own tests say what is in them.

use std::net::Ipv4Addr;

use omnibase_receive::natnet::{Frame, NatNet, Outcome, Version, body_names};
use omnibase_robot::config::{BodyChoice, NatNetPlan, UpAxis};

#[test]
fn a_frame_of_motive_is_read_as_its_own_client_reads_it() {
    let Some(folder) = std::env::var_os("OMNIBASE_NATNET_CAPTURES") else {
        return println!("SKIPPED: OMNIBASE_NATNET_CAPTURES names no folder with frames of Motive's");
    };
    let read = |name: &str| std::fs::read(std::path::Path::new(&folder).join(name)).expect(name);
    let bytes = read("mocapframe_packet_v3.bin");
    let frame = Frame::from_bytes(&bytes[4..], Version { major: 3, minor: 0 }).expect("it is a frame");
    assert_eq!((frame.number, frame.bodies.len()), (162_734, 1));
    assert_eq!((frame.exposed_ticks, frame.sent_ticks), (1_416_497_730_518, 1_416_497_748_722));
    let body = &frame.bodies[0];
    assert_eq!((body.id, body.is_tracked), (2, true));
    for (found, expected) in body.position.iter().zip([0.174_446_6, 1.447_131_4, -0.734_304_0]) {
        assert!((found - expected).abs() < 1e-6, "{:?}", body.position);
    }
    let server = Ipv4Addr::LOCALHOST;
    let mut talk = NatNet::new(&NatNetPlan {
        server,
        local: server,
        multicast: None,
        command_port: 1510,
        data_port: 1511,
        body: BodyChoice::Id(2),
        up_axis: UpAxis::Y,
        unit_m: 1.0,
    });
    let said = talk.take(&read("serverinfo_packet_v3.bin"), server, 1_000_000_000).unwrap();
    assert_eq!(said, Outcome::Server("Motive".into(), Version { major: 3, minor: 0 }));
    let said = talk.take(&bytes, server, 2_000_000_000).unwrap();
    let Outcome::Pose(heard, _) = said else { panic!("{said:?}") };
    // Both clocks began anywhere: the shutters were half open (18,204 ticks of 3,312,787 a second) 5.5 ms before it was sent.
    assert!((2_000_000_000 - heard.instant_ns).abs_diff(5_495_000) < 1000, "{}", heard.instant_ns);
    assert!((heard.values[0] - 0.174_446_6).abs() < 1e-6 && (heard.values[1] - 0.734_304_0).abs() < 1e-6);
    let names = body_names(&read("modeldef_packet_v3.bin")[4..], Version { major: 3, minor: 0 });
    assert_eq!(names, Some([("RaceQuad".to_owned(), 2)].into()));
}
