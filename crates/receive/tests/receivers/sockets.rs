//! Receivers with sockets of this machine; nothing here counts on time but that something comes at all.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::mpsc::{Receiver as Inbox, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use omnibase_receive::datagram::{Answer, PoseDatagram};
use omnibase_receive::{Receivers, Seat};
use omnibase_robot::config::*;
use omnibase_robot::signals::{Carries, Heard};

use crate::motive::{self, Sent};

/// A robot whose clock began at 100 s, and what it hears.
struct Listening {
    began: Instant,
    to: Mutex<Sender<(usize, Heard)>>,
    said: Arc<Mutex<Vec<String>>>,
}

impl Seat for Listening {
    fn clock_ns(&self) -> u64 {
        100_000_000_000 + self.began.elapsed().as_nanos() as u64
    }

    fn hear(&self, source: usize, heard: &Heard) {
        let _ = self.to.lock().unwrap().send((source, *heard));
    }

    fn say(&self, source: &str, words: &str) {
        self.said.lock().unwrap().push(format!("{source}: {words}"));
    }
}

/// What was said, line by line.
type Lines = Arc<Mutex<Vec<String>>>;

fn started(receiver: ReceiverPlan) -> (Receivers, Inbox<(usize, Heard)>, Lines) {
    let (to, inbox) = channel();
    let said = Arc::default();
    let seat: Arc<dyn Seat> =
        Arc::new(Listening { began: Instant::now(), to: Mutex::new(to), said: Arc::clone(&said) });
    let (carries, input) = (Carries::Pose, Vec::new());
    let source =
        SourcePlan { name: "mocap".into(), carries, input, max_age_ns: 0, any_order: true, receiver };
    let program = SourcePlan { receiver: ReceiverPlan::Program, ..source.clone() };
    (Receivers::start(&[program, source], |_| true, &seat).expect("sockets"), inbox, said)
}

/// A port that was free a moment ago.
fn free() -> SocketAddr {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap()
}

const LONG: Duration = Duration::from_secs(60);

#[test]
fn a_datagram_comes_in_and_is_answered() {
    let address = free();
    let plan = DatagramPlan { address, peer: address.ip() };
    let (receivers, inbox, said) = started(ReceiverPlan::Datagram(plan));
    assert!(!receivers.is_empty());
    let sender = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    sender.set_read_timeout(Some(LONG)).unwrap();
    sender.send_to(b"nonsense", address).unwrap();
    let sent = PoseDatagram {
        sequence: 1,
        instant_ns: 5,
        sent_ns: 5,
        pose: [1.0, 2.0, 3.0],
        covariance: None,
        echo: None,
        answer: Answer::Wanted,
    };
    sender.send_to(&sent.to_bytes(), address).unwrap();
    let (source, heard) = inbox.recv_timeout(LONG).unwrap();
    assert_eq!((source, &heard.values[..3]), (1, &[1.0, 2.0, 3.0][..]));
    assert!(heard.instant_ns >= 100_000_000_000, "on the robot's clock");
    let mut answer = [0; 64];
    assert_eq!(sender.recv(&mut answer).unwrap(), 20);
    assert_eq!(answer[..4], *b"OBCK");
    drop(receivers);
    assert!(said.lock().unwrap()[0].contains("8 bytes that don't begin with OBPS"), "{said:?}");
    assert!(UdpSocket::bind(address).is_ok(), "its socket is closed with it");
}

#[test]
fn a_server_is_asked_and_its_frames_come_in() {
    let server = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    server.set_read_timeout(Some(LONG)).unwrap();
    let plan = NatNetPlan {
        server: Ipv4Addr::LOCALHOST,
        local: Ipv4Addr::LOCALHOST,
        multicast: None,
        command_port: server.local_addr().unwrap().port(),
        data_port: free().port(),
        body: BodyChoice::Name("robot".into()),
        up_axis: UpAxis::Y,
        unit_m: 1.0,
    };
    let data = SocketAddr::from((Ipv4Addr::LOCALHOST, plan.data_port));
    let (receivers, inbox, said) = started(ReceiverPlan::NatNet(plan));
    let body =
        Sent { id: 4, position: [0.5, 0.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0], error: 0.0, flags: 1 };
    let version = [4, 1];
    let mut heard = Vec::new();
    let mut number = 0;
    // To where it was asked from, and to its port for data, as servers of either sort do.
    while heard.len() < 2 {
        let mut request = [0; 64];
        let (_, from) = server.recv_from(&mut request).unwrap();
        number += 1;
        let (answer, to) = match request[0] {
            0 => (motive::server_info(version, 1_000_000_000), from),
            4 => (motive::descriptions(version, &[("robot", 4)]), from),
            12 => (
                motive::frame(version, number, &[body], [1000 + u64::from(number); 2]),
                if number % 2 == 0 { from } else { data },
            ),
            _ => continue,
        };
        server.send_to(&answer, to).unwrap();
        heard.extend(inbox.try_recv());
    }
    assert!(heard.iter().all(|(source, heard)| *source == 1 && heard.values[0] == 0.5));
    drop(receivers);
    assert_eq!(said.lock().unwrap()[0], "mocap: Motive speaks NatNet 4.1");
}
