//! `cmd_vel`: what of it may move the robot.
//!
//! DDS here hands over whatever comes on a topic of this name, of any type. So nothing counts but what one publisher of the
//! right type says, of the right length, in finite numbers, stamped now.

use std::time::{Duration, Instant};

use omnibase_client::Frame;
use ros2_client::Subscription;
use rustdds::{DomainParticipant, GUID};
use serde::de::{DeserializeOwned, Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use crate::arguments::{Arguments, CommandType};
use crate::messages::{Defined, Header, Twist, TwistStamped};
use crate::node::{Ros, newest};

/// The topic.
pub const TOPIC: &str = "cmd_vel";
/// By so much a stamp may be ahead of this computer's clock.
const AHEAD_NS: i64 = 50_000_000;
/// Faster is no wish, m/s and rad/s: the robot refuses it too.
const FASTEST: f64 = 100.0;
/// The graph is looked at so often, and for every stranger.
const LOOK: Duration = Duration::from_millis(50);

/// A message with nothing behind it.
pub struct Whole<T>(pub T);

impl<'de, T: DeserializeOwned> Deserialize<'de> for Whole<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct All<T>(std::marker::PhantomData<T>);
        impl<'de, T: DeserializeOwned> Visitor<'de> for All<T> {
            type Value = Whole<T>;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("one message, and nothing behind it")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Whole<T>, A::Error> {
                let message = sequence.next_element()?.ok_or_else(|| A::Error::custom("nothing"))?;
                // A byte more can be read where it is longer than its type.
                match sequence.next_element::<u8>() {
                    Err(_) | Ok(None) => Ok(Whole(message)),
                    Ok(Some(_)) => Err(A::Error::custom("it is longer than its type")),
                }
            }
        }
        deserializer.deserialize_tuple(2, All(std::marker::PhantomData))
    }
}

/// Why a command doesn't count.
#[derive(Clone, Debug, PartialEq)]
pub enum Refusal {
    /// Who publishes it says that it is of another type.
    Type(String),
    /// More than one publishes.
    Crowd(Vec<String>),
    /// Nobody in the graph publishes it.
    Stranger,
    /// It can't be read.
    Unreadable(String),
    /// A number isn't finite.
    NotFinite,
    /// It is faster than anything is.
    TooFast(f64),
    /// It has no stamp.
    NoStamp,
    /// Its stamp is too old, ms.
    Old(f64),
    /// Its stamp is ahead of the clock, ms.
    Ahead(f64),
    /// It waited while this program didn't run.
    Waited,
}

impl Refusal {
    /// A word by which it is told again and again.
    pub fn kind(&self) -> &'static str {
        match self {
            Refusal::Type(_) => "type",
            Refusal::Crowd(_) => "crowd",
            Refusal::Stranger => "stranger",
            Refusal::Unreadable(_) => "unreadable",
            Refusal::NotFinite => "not finite",
            Refusal::TooFast(_) => "too fast",
            Refusal::NoStamp => "no stamp",
            Refusal::Old(_) => "old",
            Refusal::Ahead(_) => "ahead",
            Refusal::Waited => "waited",
        }
    }

    /// What to tell a person, where commands are expected to be of a type.
    pub fn words(&self, expected: &str) -> String {
        let why = match self {
            Refusal::Type(found) => format!(
                "expected {expected}, found a publisher of {found}: change it, or start the bridge with --cmd-vel {}",
                if expected == Twist::NAME { "stamped" } else { "twist" }
            ),
            Refusal::Crowd(types) => format!(
                "{} publish it ({}): one may, so let a twist_mux choose; who was killed counts for 20 s more",
                types.len(),
                types.join(", ")
            ),
            Refusal::Stranger => "nobody in the graph says that he publishes it".to_owned(),
            Refusal::Unreadable(error) => format!("it is no {expected}: {error}"),
            Refusal::NotFinite => "a number of it is not finite".to_owned(),
            Refusal::TooFast(speed) => format!("a speed of {speed:e}, above {FASTEST} m/s or rad/s"),
            Refusal::NoStamp => {
                "its header.stamp is 0: set it (`ros2 topic pub` does for `{header: auto, ...}`)".to_owned()
            }
            Refusal::Old(ms) => {
                format!("its stamp is {ms:.0} ms old: too slow a line, or clocks that differ")
            }
            Refusal::Ahead(ms) => {
                format!("its stamp is {ms:.0} ms ahead: clocks differ, or one is of a simulation")
            }
            Refusal::Waited => "it waited while the bridge didn't run".to_owned(),
        };
        format!("{TOPIC} is refused: {why}")
    }
}

/// A wish that counts until its time is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// vx m/s, vy m/s, turn rad/s.
    pub twist: [f64; 3],
    /// In which frame.
    pub frame: Frame,
    /// From then on it doesn't count.
    pub until: Instant,
}

enum Reader {
    Stamped(Subscription<Whole<TwistStamped>>),
    Plain(Subscription<Whole<Twist>>),
}

/// Who publishes the topic, with the type that he says.
type Publishers = Vec<(GUID, String)>;

/// The topic's only reader.
pub struct Commands {
    reader: Reader,
    expected: &'static str,
    dds_name: String,
    dds_type: String,
    odom_frame: String,
    hold: Duration,
    participant: DomainParticipant,
    publishers: Publishers,
    looked: Instant,
}

impl Commands {
    /// Reads the one type that was chosen.
    pub fn new(ros: &mut Ros, arguments: &Arguments) -> anyhow::Result<Commands> {
        let (reader, expected) = match arguments.cmd_vel {
            CommandType::TwistStamped => {
                (Reader::Stamped(ros.subscription::<TwistStamped, _>(TOPIC, newest())?), TwistStamped::NAME)
            }
            CommandType::Twist => {
                (Reader::Plain(ros.subscription::<Twist, _>(TOPIC, newest())?), Twist::NAME)
            }
        };
        Ok(Commands {
            reader,
            expected,
            dds_name: ros.dds_name(TOPIC)?,
            dds_type: expected.replace("/msg/", "::msg::dds_::") + "_",
            odom_frame: arguments.odom_frame(),
            hold: arguments.hold_ms,
            participant: ros.participant().clone(),
            publishers: Vec::new(),
            looked: Instant::now(),
        })
    }

    /// What waits for news of the topic.
    pub fn source(&mut self) -> &mut dyn rustdds::mio1::event::Source {
        match &mut self.reader {
            Reader::Stamped(reader) => reader,
            Reader::Plain(reader) => reader,
        }
    }

    /// The type that counts.
    pub fn expected(&self) -> &'static str {
        self.expected
    }

    /// How many publish the topic.
    pub fn publishers(&self) -> usize {
        self.publishers.len()
    }

    fn look(&mut self, now: Instant) {
        let all = self.participant.discovered_writers().into_iter();
        let ours = all.filter(|writer| writer.publication_topic_data.topic_name == self.dds_name);
        self.publishers = ours
            .map(|writer| (writer.publication_topic_data.key, writer.publication_topic_data.type_name))
            .collect();
        self.looked = now;
    }

    /// What stands against whatever is published now.
    pub fn objection(&mut self, now: Instant) -> Option<Refusal> {
        if now.saturating_duration_since(self.looked) >= LOOK {
            self.look(now);
        }
        self.objection_to_all()
    }

    fn objection_to_all(&self) -> Option<Refusal> {
        match &self.publishers[..] {
            [] => None,
            [(_, found)] => (*found != self.dds_type).then(|| Refusal::Type(ros_type(found))),
            all => Some(Refusal::Crowd(all.iter().map(|(_, found)| ros_type(found)).collect())),
        }
    }

    /// The newest command that counts, and why others don't. `waited` is said after a time in which this program didn't run.
    pub fn newest(
        &mut self,
        clock_ns: Option<i64>,
        now: Instant,
        waited: bool,
    ) -> (Option<Wish>, Vec<Refusal>) {
        let (mut wish, mut refusals) = (None, Vec::new());
        loop {
            // What can't be read is behind us too.
            let heard = match &self.reader {
                Reader::Stamped(reader) => reader.take().map(|taken| {
                    taken.map(|(Whole(TwistStamped { header, twist }), info)| (Some(header), twist, info))
                }),
                Reader::Plain(reader) => {
                    reader.take().map(|taken| taken.map(|(Whole(twist), info)| (None, twist, info)))
                }
            };
            let judged = match heard {
                Ok(None) => return (wish, refusals),
                Err(error) => Err(Refusal::Unreadable(format!("{error:?}"))),
                Ok(Some((header, twist, info))) => {
                    let from = GUID::from(info.publisher_gid());
                    if !self.publishers.iter().any(|(known, _)| *known == from) {
                        self.look(now);
                    }
                    let objection = self.objection_to_all();
                    let is_known = self.publishers.iter().any(|(known, _)| *known == from);
                    let stranger = (!is_known).then_some(Refusal::Stranger);
                    match objection.or(stranger) {
                        Some(refusal) => Err(refusal),
                        None if waited && header.is_none() => Err(Refusal::Waited),
                        None => judge(header.as_ref(), &twist, clock_ns, self.hold).map(|age| Wish {
                            twist: [twist.linear.x, twist.linear.y, twist.angular.z],
                            frame: self.frame(header.as_ref()),
                            until: now + self.hold.saturating_sub(age),
                        }),
                    }
                }
            };
            match judged {
                Ok(judged) => wish = Some(judged),
                Err(refusal) => {
                    // What came before something that is wrong isn't trusted either.
                    wish = None;
                    refusals.push(refusal);
                }
            }
        }
    }

    fn frame(&self, header: Option<&Header>) -> Frame {
        if header.is_some_and(|header| header.frame_id == self.odom_frame) {
            Frame::Odom
        } else {
            Frame::Body
        }
    }
}

/// A type's name as ROS 2 says it.
fn ros_type(dds_type: &str) -> String {
    dds_type.replace("::msg::dds_::", "/msg/").trim_end_matches('_').to_owned()
}

/// How old a command is, where it counts at all.
fn judge(
    header: Option<&Header>,
    twist: &Twist,
    clock_ns: Option<i64>,
    hold: Duration,
) -> Result<Duration, Refusal> {
    let Twist { linear, angular } = twist;
    let numbers = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err(Refusal::NotFinite);
    }
    if let Some(speed) = numbers.into_iter().find(|number| number.abs() > FASTEST) {
        return Err(Refusal::TooFast(speed));
    }
    let Some(header) = header else { return Ok(Duration::ZERO) };
    let (stamp_ns, Some(clock_ns)) = (header.stamp.ns(), clock_ns) else { return Err(Refusal::NoStamp) };
    if stamp_ns == 0 {
        return Err(Refusal::NoStamp);
    }
    let age_ns = clock_ns - stamp_ns;
    if age_ns < -AHEAD_NS {
        return Err(Refusal::Ahead(-age_ns as f64 * 1e-6));
    }
    let age = Duration::from_nanos(age_ns.max(0) as u64);
    if age < hold { Ok(age) } else { Err(Refusal::Old(age_ns as f64 * 1e-6)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::Time;

    const NOW_NS: i64 = 1_800_000_000_000_000_000;
    const HOLD: Duration = Duration::from_millis(200);

    fn stamped(ago_ns: i64) -> Header {
        Header { stamp: Time::of_ns(NOW_NS - ago_ns), frame_id: String::new() }
    }

    #[test]
    fn a_stamp_counts_while_it_is_young() {
        let judged = |ago_ns| judge(Some(&stamped(ago_ns)), &Twist::default(), Some(NOW_NS), HOLD);
        assert_eq!(judged(0), Ok(Duration::ZERO));
        assert_eq!(judged(150_000_000), Ok(Duration::from_millis(150)));
        assert_eq!(judged(200_000_000), Err(Refusal::Old(200.0)));
        assert_eq!(judged(NOW_NS - 1_000_000_000), Err(Refusal::Old((NOW_NS - 1_000_000_000) as f64 * 1e-6)));
        // Clocks of two computers are never the same, and a stamp of tomorrow is none.
        assert_eq!(judged(-50_000_000), Ok(Duration::ZERO));
        assert_eq!(judged(-60_000_000), Err(Refusal::Ahead(60.0)));
        assert_eq!(judged(NOW_NS), Err(Refusal::NoStamp));
        assert_eq!(judge(Some(&stamped(0)), &Twist::default(), None, HOLD), Err(Refusal::NoStamp));
        assert_eq!(judge(None, &Twist::default(), Some(NOW_NS), HOLD), Ok(Duration::ZERO));
    }

    #[test]
    fn what_is_no_speed_is_refused_in_every_number() {
        for at in 0..6 {
            let with = |number: f64| {
                let mut numbers = [0.1; 6];
                numbers[at] = number;
                let [x, y, z, roll, pitch, yaw] = numbers;
                let linear = crate::messages::Vector3 { x, y, z };
                let angular = crate::messages::Vector3 { x: roll, y: pitch, z: yaw };
                judge(Some(&stamped(0)), &Twist { linear, angular }, Some(NOW_NS), HOLD)
            };
            assert_eq!(with(0.1), Ok(Duration::ZERO));
            for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert_eq!(with(number), Err(Refusal::NotFinite));
            }
            for number in [1e308, -1e308, 5e180, 100.1] {
                assert_eq!(with(number), Err(Refusal::TooFast(number)));
            }
        }
    }

    /// As DDS here reads a message: little-endian, behind the four bytes of its header.
    fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
        let read = rustdds::serialization::deserialize_from_cdr_with_rep_id(
            bytes,
            rustdds::RepresentationIdentifier::CDR_LE,
        );
        read.map(|(message, _)| message).map_err(|error| format!("{error:?}"))
    }

    #[test]
    fn a_message_of_another_length_is_none() {
        let twist = [0.25, 0.0, 0.0, 0.0, 0.0, 0.1].map(f64::to_le_bytes).concat();
        let Whole(plain) = read::<Whole<Twist>>(&twist).unwrap();
        assert_eq!((plain.linear.x, plain.angular.z), (0.25, 0.1));
        // A TwistStamped without a frame: stamp, an empty text with its end, padding, twist.
        let stamped = [&[0; 8][..], &[1, 0, 0, 0, 0, 0, 0, 0], &twist].concat();
        let Whole(read_stamped) = read::<Whole<TwistStamped>>(&stamped).unwrap();
        assert_eq!(read_stamped.twist, plain);
        // The one read as the other, and either cut or longer.
        assert!(read::<Whole<Twist>>(&stamped).is_err());
        assert!(read::<Whole<TwistStamped>>(&twist).is_err());
        for length in 0..twist.len() {
            assert!(read::<Whole<Twist>>(&twist[..length]).is_err(), "{length}");
        }
        for more in 1..16 {
            assert!(read::<Whole<Twist>>(&[&twist[..], &vec![0; more]].concat()).is_err(), "{more}");
            assert!(read::<Whole<TwistStamped>>(&[&stamped[..], &vec![0; more]].concat()).is_err(), "{more}");
        }
    }
}
