//! The moment of a cycle, and what became of its exchange.

/// The moment of one cycle; the only clock that the stages know.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CycleTime {
    /// Number of the cycle, from 0.
    pub index: u64,
    /// The cycle's own moment on its grid, ns since any fixed instant; it never runs backwards.
    pub now_ns: u64,
    /// Period, ns.
    pub period_ns: u64,
}

impl CycleTime {
    /// The moment of cycle `index` on a grid that begins at 0.
    pub fn on_grid(index: u64, period_ns: u64) -> Self {
        CycleTime { index, now_ns: index.saturating_mul(period_ns), period_ns }
    }

    /// Period, s.
    pub fn period_s(&self) -> f64 {
        self.period_ns as f64 * 1e-9
    }
}

/// What became of the exchange whose inputs a cycle works on. Losing a frame is a value, not an error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Exchange {
    /// Every SubDevice took part: the inputs are new.
    Complete,
    /// No answer in time: the inputs are those of an earlier cycle.
    #[default]
    Lost,
    /// Some SubDevice didn't take part: the inputs can't be trusted.
    ShortCount {
        /// Working counter with all SubDevices.
        expected: u16,
        /// Working counter that came back.
        received: u16,
    },
    /// Some SubDevices are known to be away. The inputs of all other wheels are new.
    Without {
        /// Wheels whose inputs are missing: bit n for wheel n; 0 where only SubDevices without a wheel are away.
        wheels: u16,
        /// The same of the SubDevices that drive no wheel, in the order of the robot's file.
        devices: u16,
    },
    /// Every SubDevice took part, but some drives started anew since they last did: what they count has another
    /// origin. Whatever the robot does, it stops; only then do they count again.
    Restarted {
        /// Bit n for wheel n.
        wheels: u16,
    },
}

impl Exchange {
    /// Whether the inputs of a wheel are those of this very cycle.
    pub fn has_inputs_of(self, wheel: usize) -> bool {
        match self {
            Exchange::Complete => true,
            Exchange::Without { wheels, .. } => u32::from(wheels) >> wheel & 1 == 0,
            Exchange::Lost | Exchange::ShortCount { .. } | Exchange::Restarted { .. } => false,
        }
    }

    /// Whether the inputs of a SubDevice without a wheel are those of this very cycle.
    pub fn has_inputs_of_device(self, device: usize) -> bool {
        match self {
            Exchange::Complete => true,
            Exchange::Without { devices, .. } => u32::from(devices) >> device & 1 == 0,
            Exchange::Lost | Exchange::ShortCount { .. } | Exchange::Restarted { .. } => false,
        }
    }

    /// The three numbers by which recordings hold an exchange: sort, then expected and received working counter, or
    /// wheels and other SubDevices.
    pub fn codes(self) -> [u64; 3] {
        match self {
            Exchange::Complete => [0, 0, 0],
            Exchange::Lost => [1, 0, 0],
            Exchange::ShortCount { expected, received } => [2, expected.into(), received.into()],
            Exchange::Restarted { wheels } => [3, wheels.into(), 0],
            Exchange::Without { wheels, devices } => [4, wheels.into(), devices.into()],
        }
    }

    /// The exchange of three numbers; `None` where no exchange has them.
    pub fn from_codes(codes: [u64; 3]) -> Option<Self> {
        Some(match codes {
            [0, 0, 0] => Exchange::Complete,
            [1, 0, 0] => Exchange::Lost,
            [2, expected, received] => Exchange::ShortCount {
                expected: expected.try_into().ok()?,
                received: received.try_into().ok()?,
            },
            [3, wheels, 0] => Exchange::Restarted { wheels: wheels.try_into().ok()? },
            [4, wheels, devices] => {
                Exchange::Without { wheels: wheels.try_into().ok()?, devices: devices.try_into().ok()? }
            }
            _ => return None,
        })
    }
}
