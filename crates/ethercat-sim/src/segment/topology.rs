//! Cables between SubDevices, and the way that a frame takes through them.

/// What a SubDevice's entry port is plugged into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parent {
    /// The MainDevice's network interface.
    MainDevice,
    /// Another SubDevice nearer to the MainDevice.
    SubDevice {
        /// Its position.
        position: usize,
        /// Its port, 0 to 3.
        port: u8,
    },
}

/// The cable through which a SubDevice is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// The end nearer to the MainDevice.
    pub parent: Parent,
    /// The SubDevice's own port; usually 0.
    pub entry_port: u8,
    /// What the cable delays a frame in one direction, ns (about 5 ns a metre).
    pub cable_delay_ns: u32,
}

/// Why SubDevices and cables don't make a segment.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopologyError {
    /// One attachment for each SubDevice is needed.
    #[error("{sub_devices} SubDevices, but {attachments} attachments")]
    Count {
        /// SubDevices given.
        sub_devices: usize,
        /// Attachments given.
        attachments: usize,
    },
    /// A parent that isn't there.
    #[error("the SubDevice at position {position} hangs on position {parent}, which is not there")]
    NoSuchParent {
        /// Position of the child.
        position: usize,
        /// Position named as its parent.
        parent: usize,
    },
    /// A port that the chip doesn't have.
    #[error("the SubDevice at position {position} has no port {port}")]
    NoSuchPort {
        /// Position of the SubDevice.
        position: usize,
        /// The port.
        port: u8,
    },
    /// Two cables in one port.
    #[error("port {port} of the SubDevice at position {position} has two cables")]
    PortTaken {
        /// Position of the SubDevice.
        position: usize,
        /// The port.
        port: u8,
    },
    /// One SubDevice hangs on the MainDevice.
    #[error("one SubDevice is attached to the MainDevice, found {found}")]
    MainDeviceCable {
        /// How many are.
        found: usize,
    },
    /// No frame gets there: its cables don't lead to the MainDevice.
    #[error("no cables lead from the MainDevice to the SubDevice at position {position}")]
    Unreachable {
        /// Position of the SubDevice.
        position: usize,
    },
    /// Frames pass the SubDevices in another order than they are listed.
    #[error(
        "a frame passes SubDevice {found} as number {position}: list the SubDevices in the order of the frame's way"
    )]
    Order {
        /// Position on the frame's way.
        position: usize,
        /// Index in the list.
        found: usize,
    },
}

/// One end of a cable: SubDevice and port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Plug {
    pub position: usize,
    pub port: u8,
}

/// Which of the MainDevice's two interfaces; a line has the first alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MainPort {
    /// The one that leads to position 0.
    Primary,
    /// The one at the other end of a ring.
    Redundant,
}

/// What a cable carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Carries {
    Frames,
    /// Its ends see a link, and no frame passes.
    Link,
    Nothing,
}

/// A cable; its upper end is the MainDevice where `upper` is `None`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cable {
    pub upper: Option<Plug>,
    pub lower: Plug,
    pub delay_ns: u32,
    pub carries: Carries,
}

/// All cables, and which one is in which port.
#[derive(Debug)]
pub(crate) struct Cables {
    pub cables: Vec<Cable>,
    /// Index of the cable in each port of each SubDevice.
    pub at: Vec<[Option<usize>; 4]>,
    /// The cable to the MainDevice's first interface.
    pub primary: usize,
    /// The cable that closes a ring.
    pub ring: Option<usize>,
}

impl Cables {
    /// Plugs everything together; `has_port` tells which ports a SubDevice has.
    pub fn new(
        attachments: &[Attachment],
        has_port: impl Fn(usize, u8) -> bool,
    ) -> Result<Self, TopologyError> {
        let found = attachments.iter().filter(|one| one.parent == Parent::MainDevice).count();
        if found != usize::from(!attachments.is_empty()) {
            return Err(TopologyError::MainDeviceCable { found });
        }
        let mut primary = 0;
        let mut at = vec![[None; 4]; attachments.len()];
        let mut cables = Vec::with_capacity(attachments.len());
        let mut plug_in = |plug: Plug, cable: usize| {
            let Plug { position, port } = plug;
            if !has_port(position, port) {
                return Err(TopologyError::NoSuchPort { position, port });
            }
            match at[position][usize::from(port)].replace(cable) {
                Some(_) => Err(TopologyError::PortTaken { position, port }),
                None => Ok(()),
            }
        };
        for (position, attachment) in attachments.iter().enumerate() {
            let upper = match attachment.parent {
                Parent::MainDevice => {
                    primary = cables.len();
                    None
                }
                Parent::SubDevice { position: parent, .. }
                    if parent >= attachments.len() || parent == position =>
                {
                    return Err(TopologyError::NoSuchParent { position, parent });
                }
                Parent::SubDevice { position: parent, port } => Some(Plug { position: parent, port }),
            };
            let lower = Plug { position, port: attachment.entry_port };
            plug_in(lower, cables.len())?;
            if let Some(upper) = upper {
                plug_in(upper, cables.len())?;
            }
            cables.push(Cable {
                upper,
                lower,
                delay_ns: attachment.cable_delay_ns,
                carries: Carries::Frames,
            });
        }
        Ok(Cables { cables, at, primary, ring: None })
    }
}

/// Ports that are open where a cable is plugged in, and cables that carry all.
struct Plugged<'a>(&'a Cables);

impl Ports for Plugged<'_> {
    fn closed(&self, plug: Plug) -> bool {
        self.0.at[plug.position][usize::from(plug.port)].is_none()
    }

    fn carries(&self, _cable: &Cable) -> bool {
        true
    }

    fn forward_delay_ns(&self, _position: usize) -> u64 {
        0
    }
}

/// SubDevices in the order in which a frame passes their processing units: one whose IN and OUT are swapped comes behind
/// all that hang on it.
pub(crate) fn frame_order(
    attachments: &[Attachment],
    has_port: impl Fn(usize, u8) -> bool,
) -> Result<Vec<usize>, TopologyError> {
    let cables = Cables::new(attachments, has_port)?;
    let path = FramePath::follow(&cables, &Plugged(&cables), MainPort::Primary);
    let mut order: Vec<usize> = Vec::with_capacity(attachments.len());
    for passage in path.passages {
        if !order.contains(&passage.position) {
            order.push(passage.position);
        }
    }
    Ok(order)
}

/// A frame's arrival at a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Arrival {
    pub position: usize,
    pub port: u8,
    /// From the moment at which the frame left the MainDevice, ns.
    pub at_ns: u64,
    /// Processing units passed before.
    pub passed: usize,
}

/// A frame's passage through a processing unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Passage {
    pub position: usize,
    /// From the moment at which the frame left the MainDevice, ns.
    pub at_ns: u64,
    /// Port 0 is closed by itself: a frame that comes here twice is caught.
    pub port_0_closed: bool,
}

/// The way of a frame through the segment.
#[derive(Debug, Default)]
pub(crate) struct FramePath {
    pub passages: Vec<Passage>,
    pub arrivals: Vec<Arrival>,
    /// When it is back at the MainDevice, and where; `None` where it never is.
    pub back: Option<(u64, MainPort)>,
}

/// What the way depends on beside the cables.
pub(crate) trait Ports {
    /// Whether frames turn back inside the chip at this port.
    fn closed(&self, plug: Plug) -> bool;
    /// Whether a frame can leave through this cable.
    fn carries(&self, cable: &Cable) -> bool;
    /// Delay from port to port inside this SubDevice, ns.
    fn forward_delay_ns(&self, position: usize) -> u64;
}

impl FramePath {
    /// Follows a frame from one interface of the MainDevice until it is back or lost.
    pub fn follow(cables: &Cables, ports: &impl Ports, from: MainPort) -> FramePath {
        let mut way = FramePath::default();
        let first = match from {
            MainPort::Primary => Some(cables.primary),
            MainPort::Redundant => cables.ring,
        };
        let first = first.and_then(|index| cables.cables.get(index));
        let Some(first) = first.filter(|cable| ports.carries(cable)) else { return way };
        let mut plug = first.lower;
        let mut at_ns = u64::from(first.delay_ns);
        // A tree is passed once in each direction; more means that control bits made a ring.
        for _ in 0..=2 * cables.cables.len() + 2 {
            // What arrives at a closed port is destroyed there.
            if ports.closed(plug) {
                return way;
            }
            let passed = way.passages.len();
            way.arrivals.push(Arrival { position: plug.position, port: plug.port, at_ns, passed });
            let leaving = way.cross(ports, plug, at_ns);
            at_ns += ports.forward_delay_ns(plug.position);
            let Some(index) = cables.at[leaving.position][usize::from(leaving.port)] else { return way };
            let cable = &cables.cables[index];
            if !ports.carries(cable) {
                return way;
            }
            at_ns += u64::from(cable.delay_ns);
            plug = match cable.upper {
                None => {
                    let is_ring = cables.ring == Some(index);
                    let port = if is_ring { MainPort::Redundant } else { MainPort::Primary };
                    way.back = Some((at_ns, port));
                    return way;
                }
                Some(upper) if cable.lower == leaving => upper,
                Some(_) => cable.lower,
            };
        }
        way
    }

    /// Crosses a chip in the order 0, processing unit, 3, 1, 2, 0; returns the port by which the frame leaves.
    fn cross(&mut self, ports: &impl Ports, entry: Plug, at_ns: u64) -> Plug {
        let position = entry.position;
        let mut port = entry.port;
        if port == 0 {
            self.passages.push(Passage { position, at_ns, port_0_closed: false });
        }
        loop {
            port = [3, 2, 0, 1][usize::from(port)];
            let plug = Plug { position, port };
            if !ports.closed(plug) {
                return plug;
            }
            if port == 0 {
                self.passages.push(Passage { position, at_ns, port_0_closed: true });
            }
        }
    }
}
