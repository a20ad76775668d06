//! One receiver with its socket or device.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::path::PathBuf;
use std::time::Duration;

use omnibase_robot::config::{DatagramPlan, NatNetPlan, ReceiverPlan};
use omnibase_robot::signals::Heard;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::net::{AddressFamily, SocketType, bind, socket, sockopt};
use rustix::time::Timespec;

use crate::datagram::{BYTES, DatagramHearing};
use crate::mouse::{Happened, Mouse, MouseAt};
use crate::natnet::{NatNet, Outcome};

/// No datagram is longer.
const LONGEST: usize = 65_536;
/// A mouse is looked at so often: its counts are to be young when they are read.
const MOUSE_TURN: Duration = Duration::from_millis(2);

/// What a receiver tells in a turn.
pub trait Teller {
    /// Our clock, ns.
    fn now_ns(&self) -> u64;
    /// What was heard of the source.
    fn hear(&mut self, heard: &Heard);
    /// What a person should know; the same is said again and again.
    fn say(&mut self, words: &str);
}

/// One receiver.
pub trait Receiver: Send {
    /// Waits a little, tells what came, and says what didn't fit.
    ///
    /// # Errors
    /// Its socket broke.
    fn turn(&mut self, teller: &mut dyn Teller) -> io::Result<()>;
}

/// Opens the receiver of a plan; `None` where a program sends by the robot's API.
///
/// # Errors
/// Its socket can't be had.
pub fn open(plan: &ReceiverPlan) -> io::Result<Option<Box<dyn Receiver>>> {
    Ok(match plan {
        ReceiverPlan::Program => None,
        ReceiverPlan::Datagram(plan) => Some(Box::new(DatagramReceiver::open(plan)?)),
        ReceiverPlan::NatNet(plan) => Some(Box::new(NatNetReceiver::open(plan)?)),
        ReceiverPlan::Mouse { device } => {
            Some(Box::new(MouseReceiver(Mouse::new(MouseAt(PathBuf::from(device))))))
        }
    })
}

/// Datagrams of a socket in a turn: a flood of them doesn't keep a receiver from its end.
const AT_ONCE: usize = 64;
/// The longest wait of a turn.
const WAIT: Duration = Duration::from_millis(20);

/// Waits until one of the sockets has something.
fn wait(sockets: &[&UdpSocket]) -> io::Result<()> {
    let mut fds: Vec<PollFd<'_>> = sockets.iter().map(|socket| PollFd::new(socket, PollFlags::IN)).collect();
    let longest = Timespec { tv_sec: 0, tv_nsec: WAIT.subsec_nanos().into() };
    match poll(&mut fds, Some(&longest)) {
        Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// A datagram that is there; errors that an earlier one left (nobody listens there) are none of this one's.
fn received(socket: &UdpSocket, buffer: &mut [u8]) -> io::Result<Option<(usize, SocketAddr)>> {
    match socket.recv_from(buffer) {
        Ok(received) => Ok(Some(received)),
        Err(error)
            if matches!(
                error.kind(),
                io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted | io::ErrorKind::ConnectionRefused
            ) =>
        {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// Poses in plain datagrams.
pub struct DatagramReceiver {
    socket: UdpSocket,
    hearing: DatagramHearing,
}

impl DatagramReceiver {
    /// At the address of a plan.
    ///
    /// # Errors
    /// It is taken, or no address of this machine.
    pub fn open(plan: &DatagramPlan) -> io::Result<Self> {
        let socket = UdpSocket::bind(plan.address)?;
        socket.set_nonblocking(true)?;
        Ok(DatagramReceiver { socket, hearing: DatagramHearing::new(plan) })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// The socket broke.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }
}

impl Receiver for DatagramReceiver {
    fn turn(&mut self, teller: &mut dyn Teller) -> io::Result<()> {
        wait(&[&self.socket])?;
        // One byte more than the longest: what is longer is seen to be.
        let mut buffer = [0; BYTES[1] + 1];
        for _ in 0..AT_ONCE {
            let Some((length, from)) = received(&self.socket, &mut buffer)? else { break };
            match self.hearing.take(&buffer[..length], from.ip(), teller.now_ns()) {
                Err(why) => teller.say(&format!("{from}: {why}")),
                Ok(taken) => {
                    teller.hear(&taken.heard);
                    if let Some(answer) = taken.answer {
                        // A sender that doesn't hear it asks again.
                        let _ = self.socket.send_to(&answer, from);
                    }
                }
            }
        }
        Ok(())
    }
}

/// A rigid body of Motive's.
pub struct NatNetReceiver {
    commands: UdpSocket,
    /// Where frames come in that don't come to the socket of commands.
    data: Option<UdpSocket>,
    to: SocketAddrV4,
    talk: NatNet,
    buffer: Vec<u8>,
}

impl NatNetReceiver {
    /// As a plan says.
    ///
    /// # Errors
    /// No socket can be had, or the group can't be joined.
    pub fn open(plan: &NatNetPlan) -> io::Result<Self> {
        let commands = UdpSocket::bind((plan.local, 0))?;
        commands.set_nonblocking(true)?;
        let data = match plan.multicast {
            Some(group) => {
                let data = shared(SocketAddrV4::new(group, plan.data_port))?;
                data.join_multicast_v4(&group, &plan.local)?;
                Some(data)
            }
            // Most servers send to where they were asked from, some to their port for data: where that is taken here, it
            // is no server's.
            None => shared(SocketAddrV4::new(plan.local, plan.data_port)).ok(),
        };
        Ok(NatNetReceiver {
            commands,
            data,
            to: SocketAddrV4::new(plan.server, plan.command_port),
            talk: NatNet::new(plan),
            buffer: vec![0; LONGEST],
        })
    }
}

/// A socket at an address that others on this machine may listen at as well.
fn shared(address: SocketAddrV4) -> io::Result<UdpSocket> {
    let own = socket(AddressFamily::INET, SocketType::DGRAM, None)?;
    sockopt::set_socket_reuseaddr(&own, true)?;
    bind(&own, &address)?;
    let own = UdpSocket::from(own);
    own.set_nonblocking(true)?;
    Ok(own)
}

impl Receiver for NatNetReceiver {
    fn turn(&mut self, teller: &mut dyn Teller) -> io::Result<()> {
        for request in self.talk.requests(teller.now_ns()) {
            // A cable that is out is told by silence.
            let _ = self.commands.send_to(&request, self.to);
        }
        let sockets: Vec<&UdpSocket> = [&self.commands].into_iter().chain(&self.data).collect();
        wait(&sockets)?;
        for socket in sockets {
            for _ in 0..AT_ONCE {
                let Some((length, from)) = received(socket, &mut self.buffer)? else { break };
                let IpAddr::V4(from) = from.ip() else { continue };
                take(&mut self.talk, &self.buffer[..length], from, teller);
            }
        }
        Ok(())
    }
}

fn take(talk: &mut NatNet, bytes: &[u8], from: Ipv4Addr, teller: &mut dyn Teller) {
    match talk.take(bytes, from, teller.now_ns()) {
        Ok(Outcome::Nothing) => {}
        Ok(Outcome::Server(name, version)) => {
            teller.say(&format!("{name} speaks NatNet {}.{}", version.major, version.minor));
        }
        Ok(Outcome::Pose(heard, _)) => teller.hear(&heard),
        Err(why) => teller.say(&why.to_string()),
    }
}

/// A mouse.
struct MouseReceiver(Mouse<MouseAt>);

impl Receiver for MouseReceiver {
    fn turn(&mut self, teller: &mut dyn Teller) -> io::Result<()> {
        std::thread::sleep(MOUSE_TURN);
        let (heard, happened) = self.0.turn(teller.now_ns());
        match happened {
            Happened::Nothing => {}
            Happened::Plugged(name) => teller.say(&format!("{name} is there")),
            Happened::Unplugged => teller.say("the mouse is gone"),
            Happened::Refused(error) => teller.say(&format!("no mouse: {error}")),
        }
        if let Some(heard) = heard {
            teller.hear(&heard);
        }
        Ok(())
    }
}
