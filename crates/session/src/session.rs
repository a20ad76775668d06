//! The bus of a robot: from what is plugged in to OP, one exchange a cycle at the pace of clocks, and back to INIT.

mod error;
mod modes;
mod peripherals;

use std::ops::Range;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use crate::supervision::{BusFigures, DatagramFigures, Role, SubDeviceFigures, Supervisor};
use crate::words::Words;
use omnibase_cia402::ErrorCode;
use omnibase_ethercat::config::SubDeviceConfig;
use omnibase_ethercat::cyclic::{
    AcyclicCompletion, AcyclicRequest, AcyclicWork, ClockDirection, CycleCounters, CyclicBus,
    Exchange as BusExchange, Goal, Handover, TransitionOptions,
};
use omnibase_ethercat::mailbox::MailboxRequest;
use omnibase_ethercat::paced::{Leader, Pace, PacedBus, Times};
use omnibase_ethercat::subdevice::{Direction, SubDevice, SyncManager};
use omnibase_ethercat::sync_manager::{CONTROL, TRIGGERS_WATCHDOG};
use omnibase_ethercat::transaction::Access;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, Link, LinkError, register};
use omnibase_ethercat::{Bus, BusOptions, ProcessImage as BusImage, SetUpError};
use omnibase_robot::config::{BusPlace, BusPlan, ClockSource, DriveWatchdog, Synchronisation};
use omnibase_robot::signals::{DriveMeasurement, MAX_DEVICES};
use omnibase_robot::{Exchange, ProcessImage, RobotPlan};

pub use error::{SessionError, WatchdogRegisters};
pub use modes::supported_modes;

/// Cycles in which drives are asked by SDO what is wrong with them.
const ASKING_CYCLES: u32 = 200;
/// The object that says it: the drive profile's error code.
const ERROR_CODE: ObjectAddress = ObjectAddress::new(0x603F, 0);
/// A robot's bus with its process data and its pace.
pub struct Session<L: Link, C: Clock> {
    paced: PacedBus<L, C>,
    wheels: Wheels,
    /// Counts when OP was reached: what was lost on the way there is no fault of the run.
    counted_before: CycleCounters,
}

/// The process data of the wheels and of what is beside them, and who looks after their SubDevices.
struct Wheels {
    image: BusImage,
    wiring: Vec<Wires>,
    /// Of the SubDevices without a wheel.
    peripherals: Vec<Wires>,
    /// Those whose process data didn't go in the last exchange: bit n for the n-th.
    resting: u16,
    supervisor: Supervisor,
}

impl Wheels {
    fn exchange<L: Link, C: Clock>(
        &mut self,
        paced: &mut PacedBus<L, C>,
    ) -> Result<(Exchange, Times), LinkError> {
        let Wheels { image, wiring, peripherals, resting, supervisor } = self;
        let were_away = Away::now(supervisor);
        // Whoever is away mustn't find an old command when it comes back: all zero disables a drive.
        for wires in wiring.iter().chain(&*peripherals).filter(|wires| supervisor.is_away(wires.position)) {
            image.outputs[wires.outputs.clone()].fill(0);
        }
        let (exchange, times) = paced.exchange_and(image, |bus, deadline| {
            let resting_of = |(n, wires): (usize, &Wires)| u16::from(bus.rests(wires.position)) << n;
            *resting = peripherals.iter().take(MAX_DEVICES).enumerate().map(resting_of).sum();
            supervisor.after(bus, deadline);
        })?;
        Ok((self.robot_exchange(exchange, were_away), times))
    }

    /// What became of an exchange, as the robot needs to know it; of some SubDevices nothing was heard when it began.
    fn robot_exchange(&mut self, exchange: BusExchange, were_away: Away) -> Exchange {
        // Whoever is on its way back already answers, but its way isn't over. Whoever was away when the frame left had
        // its inputs left as they were, even if it is operational by now.
        let are_away = Away::now(&self.supervisor);
        let Away { wheels, devices } = were_away.or(are_away);
        // A slow one that wasn't asked in this exchange is no less missing for that.
        let unasked = self.resting & self.supervisor.not_operational_devices();
        match exchange {
            BusExchange::Complete if are_away != Away::default() || unasked != 0 => {
                Exchange::Without { wheels, devices: devices | unasked }
            }
            BusExchange::Complete => match self.supervisor.take_restarted() {
                0 => Exchange::Complete,
                wheels => Exchange::Restarted { wheels },
            },
            BusExchange::Lost { .. } => Exchange::Lost,
            BusExchange::ShortCount { expected, received, .. } => Exchange::ShortCount { expected, received },
            // Who fell silent isn't away yet, and said nothing.
            BusExchange::Without { .. } => {
                Exchange::Without { wheels, devices: devices | self.supervisor.not_operational_devices() }
            }
        }
    }
}

/// Who is away: bit n for the n-th.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Away {
    wheels: u16,
    devices: u16,
}

impl Away {
    fn now(supervisor: &Supervisor) -> Self {
        Away { wheels: supervisor.away_wheels(), devices: supervisor.away_devices() }
    }

    fn or(self, other: Away) -> Self {
        Away { wheels: self.wheels | other.wheels, devices: self.devices | other.devices }
    }
}

/// The position of whoever is of a hot-connect group that isn't there.
const ABSENT: u16 = u16::MAX;

/// Where one SubDevice's process data stand.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Wires {
    /// Position of the SubDevice.
    position: u16,
    inputs: Range<usize>,
    outputs: Range<usize>,
}

impl ProcessImage for Wheels {
    fn inputs(&self, wheel: usize) -> &[u8] {
        self.wiring.get(wheel).map_or(&[], |wires| &self.image.inputs[wires.inputs.clone()])
    }

    fn outputs(&mut self, wheel: usize) -> &mut [u8] {
        match self.wiring.get(wheel) {
            Some(wires) => &mut self.image.outputs[wires.outputs.clone()],
            None => &mut [],
        }
    }

    fn device_inputs(&self, device: usize) -> Option<&[u8]> {
        let wires = self.peripherals.get(device).filter(|wires| wires.position != ABSENT)?;
        let rests = u32::from(self.resting) >> device & 1 == 1;
        Some(if rests { &[] } else { &self.image.inputs[wires.inputs.clone()] })
    }

    fn device_outputs(&mut self, device: usize) -> &mut [u8] {
        match self.peripherals.get(device) {
            Some(wires) => &mut self.image.outputs[wires.outputs.clone()],
            None => &mut [],
        }
    }
}

impl<L: Link, C: Clock> Session<L, C> {
    /// Finds the SubDevices, compares them with the plan and configures them; they are in PRE-OP then.
    ///
    /// `warn` is told what a person should know of the segment.
    pub fn prepare(
        link: L,
        clock: C,
        plan: &RobotPlan,
        warn: &mut dyn FnMut(String),
    ) -> Result<Self, SessionError> {
        let mut bus = Bus::new(link, clock, BusOptions::default());
        bus.scan()?;
        let (configs, absent) = asked(plan, bus.subdevices())?;
        for group in &absent {
            warn(format!(
                "hot-connect group `{group}` isn't plugged in: the robot runs without it, and takes it in at its next start"
            ));
        }
        let configured = bus.configure(&configs);
        bus.warnings().iter().for_each(|warning| warn(warning.to_string()));
        configured.map_err(SessionError::of_configuration)?;
        for device in &plan.devices {
            peripherals::check_maps(device, bus.subdevices())?;
        }
        check_cycle(&bus, plan)?;
        check_watchdogs(&mut bus, &plan.bus)?;
        modes::check(&mut bus, plan)?;
        let Handover { bus, clock, subdevices } = bus.into_cyclic(clock_direction(&plan.bus))?;
        let (wiring, peripherals) = wire(plan, &bus, &subdevices)?;
        let image = bus.plan().image();
        let paced = PacedBus::new(bus, clock, pace(&plan.bus));
        let place =
            |all: &[Wires], one: &SubDevice| all.iter().position(|wires| wires.position == one.position);
        let role_of = |one: &SubDevice| match (place(&wiring, one), place(&peripherals, one)) {
            (Some(wheel), _) => Role::Wheel(wheel),
            (None, Some(device)) => Role::Device(device),
            (None, None) => Role::Nobody,
        };
        let tolerated = plan.safety.lost_exchanges_tolerated;
        let supervisor = Supervisor::new(subdevices, tolerated, absent.join(", "), role_of);
        let wheels = Wheels { image, wiring, peripherals, resting: 0, supervisor };
        Ok(Session { paced, wheels, counted_before: CycleCounters::default() })
    }

    /// Cycles until everyone is in OP; `false` where `stop` came first. Outputs are zero until somebody writes them.
    pub fn reach_op(&mut self, stop: &AtomicBool) -> Result<bool, SessionError> {
        let Session { paced, wheels, .. } = self;
        let reached = paced
            .reach(Goal::Op, TransitionOptions::default(), stop, |paced| wheels.exchange(paced).map(drop));
        self.counted_before = self.paced.bus().counters();
        Ok(reached?)
    }

    /// Brings everyone back to INIT; who doesn't go there in order is asked by broadcast.
    pub fn end(&mut self) -> Result<(), SessionError> {
        let Session { paced, wheels, .. } = self;
        Ok(paced.end(|paced| wheels.exchange(paced).map(drop))?)
    }

    /// Asks every drive by SDO for its error code, beside the cycle; `None` for a drive that doesn't answer in time.
    ///
    /// Outputs stay as they are. Not for the cycle: it allocates.
    pub fn error_codes(&mut self) -> Result<Vec<Option<ErrorCode>>, LinkError> {
        let mut codes = vec![None; self.wheels.wiring.len()];
        for (wheel, wires) in self.wheels.wiring.iter().enumerate() {
            let position = wires.position;
            let upload = MailboxRequest::upload(ERROR_CODE, Vec::with_capacity(2));
            let work = AcyclicWork::Mailbox(upload);
            // A full queue is one more drive that isn't heard.
            let _ = self.paced.bus_mut().submit(AcyclicRequest { tag: wheel as u64, position, work });
        }
        let mut open = codes.len();
        for _ in 0..ASKING_CYCLES {
            if open == 0 {
                break;
            }
            // Without the supervisor, who would take the answers.
            self.paced.exchange(&mut self.wheels.image)?;
            while let Some(completion) = self.paced.bus_mut().poll_completion() {
                let AcyclicWork::Mailbox(answer) = completion.work else { continue };
                // What somebody asked before the end is nobody's any more.
                if completion.tag >= codes.len() as u64 {
                    continue;
                }
                open = open.saturating_sub(1);
                if completion.result.is_ok()
                    && let [low, high] = answer.data[..]
                    && let Some(code) = codes.get_mut(completion.tag as usize)
                {
                    *code = Some(ErrorCode(u16::from_le_bytes([low, high])));
                }
            }
        }
        Ok(codes)
    }

    /// One cycle: sleeps until its instant, exchanges, and plans the next instant. `Err` only where the port is broken.
    pub fn exchange(&mut self) -> Result<(Exchange, Times), LinkError> {
        self.wheels.exchange(&mut self.paced)
    }

    /// Has the supervisor look at what the drives said.
    pub fn look_at_drives(&mut self, drives: &[DriveMeasurement]) {
        self.wheels.supervisor.look_at_drives(drives);
    }

    /// The SubDevices as the set-up found them.
    pub fn subdevices(&self) -> impl Iterator<Item = &SubDevice> {
        self.wheels.supervisor.subdevices()
    }

    /// Whether the SubDevice at `position` is lost or on its way back.
    pub fn is_away(&self, position: u16) -> bool {
        self.wheels.supervisor.is_away(position)
    }

    /// Has something done beside the cycle, in spare datagrams; given back where there is no room.
    ///
    /// Its tag has the bit [`OTHERS`](crate::supervision::OTHERS).
    pub fn submit_acyclic(&mut self, request: AcyclicRequest) -> Result<(), AcyclicRequest> {
        self.paced.bus_mut().submit(request)
    }

    /// What was submitted by this tag, once it has ended.
    pub fn take_acyclic(&mut self, tag: u64) -> Option<AcyclicCompletion> {
        self.wheels.supervisor.take_ended(tag)
    }

    /// The next thing that happened on the bus.
    pub fn take_event(&mut self) -> Option<Words> {
        self.wheels.supervisor.take_event()
    }

    /// The next of what a drive said by an emergency: its wheel, and its error.
    pub fn take_said(&mut self) -> Option<(usize, ErrorCode)> {
        self.wheels.supervisor.take_said()
    }

    /// What was counted since OP was reached.
    pub fn figures(&self) -> BusFigures {
        let (now, before) = (self.paced.bus().counters(), self.counted_before);
        BusFigures {
            frames_lost: now.frames_lost - before.frames_lost,
            frames_late: now.late - before.late,
            frames_short: now.short - before.short,
            frames_duplicate: now.duplicate - before.duplicate,
            frames_foreign: now.foreign - before.foreign,
            working_counter_errors: now.working_counter_errors - before.working_counter_errors,
            al_status: self.paced.bus().status().map_or(0, |status| status.bits.into()),
            dc_phase_ns: self.paced.dc_phase_ns().unwrap_or(0),
            ..*self.wheels.supervisor.totals()
        }
    }

    /// What was counted of each SubDevice.
    pub fn subdevice_figures(&self) -> Vec<SubDeviceFigures> {
        self.wheels.supervisor.figures().cloned().collect()
    }

    /// Working counters, by datagram.
    pub fn datagram_figures(&self) -> Vec<DatagramFigures> {
        let counts = self.paced.bus().datagram_counts().map(|count| DatagramFigures {
            name: format!("frame {} datagram {} {}", count.frame, count.datagram, count.command),
            expected: count.expected,
            short_counts: count.short_counts,
        });
        counts.collect()
    }

    /// The cycle, and how long its frames are awaited.
    pub fn pace(&self) -> (Duration, Duration) {
        self.paced.pace()
    }

    /// The process data as the robot sees them.
    pub fn image(&mut self) -> &mut impl ProcessImage {
        &mut self.wheels
    }

    /// The clock.
    pub fn clock(&self) -> &C {
        self.paced.clock()
    }

    /// What the bus counted.
    pub fn counters(&self) -> CycleCounters {
        self.paced.bus().counters()
    }
}

/// Frames are back in time, as the segment's length was measured.
fn check_cycle<L: Link, C: Clock>(bus: &Bus<L, C>, plan: &RobotPlan) -> Result<(), SessionError> {
    let fit = bus.cycle_fit()?;
    if fit.needed() <= Duration::from_nanos(plan.bus.receive_timeout_ns) {
        return Ok(());
    }
    let (cycle_us, timeout_us) = (plan.bus.cycle_ns / 1000, plan.bus.receive_timeout_ns / 1000);
    Err(SessionError::CycleTooShort { cycle_us, timeout_us, fit })
}

/// Reads back what decides whether the wheels stop, and outputs go safe, when this program dies, of everybody who was given a watchdog;
/// an error names the first that has another one.
pub fn check_watchdogs<L: Link, C: Clock>(bus: &mut Bus<L, C>, plan: &BusPlan) -> Result<(), SessionError> {
    let expected =
        WatchdogRegisters { divider: DriveWatchdog::DIVIDER, process_data: plan.drive_watchdog.steps };
    let watched = bus.subdevices().iter().filter(|one| one.config.watchdogs.process_data.is_some());
    let positions: Vec<u16> = watched.map(|one| one.position).collect();
    for position in positions {
        let one = bus.subdevice(position)?;
        let name = one.config.name.as_ref().unwrap_or(&one.name).clone();
        let outputs = one.process_data(Direction::Outputs);
        let is_on = |one: &&SyncManager| one.enabled || one.op_only().is_some();
        let outputs: Vec<u8> = outputs.filter(is_on).map(|one| one.index).collect();
        let mut read = |what, register, bytes| {
            let access = bus.transactor().perform_one(Access::read_at(what, position, register, bytes))?;
            Ok::<u16, SetUpError>(access.data.iter().rev().fold(0, |word, byte| word << 8 | u16::from(*byte)))
        };
        let found = WatchdogRegisters {
            divider: read("the watchdogs' divider", register::WATCHDOG_DIVIDER, 2)?,
            process_data: read("the process-data watchdog", register::WATCHDOG_PROCESS_DATA, 2)?,
        };
        if found != expected {
            return Err(SessionError::Watchdog { name, position, expected, found });
        }
        for sync_manager in outputs {
            let register = register::SM + register::SM_SIZE * u16::from(sync_manager) + CONTROL;
            let control = read("what outputs trigger", register, 1)? as u8;
            if control & TRIGGERS_WATCHDOG == 0 {
                return Err(SessionError::Unwatched { name, position, sync_manager, control });
            }
        }
    }
    Ok(())
}

/// What a robot's file asks of the SubDevices that were found, and the hot-connect groups that aren't there.
fn asked(plan: &RobotPlan, found: &[SubDevice]) -> Result<(Vec<SubDeviceConfig>, Vec<String>), SessionError> {
    let absent = peripherals::absent_groups(plan, found)?;
    let drives = plan.drives.iter().map(|drive| drive.subdevice_config(&plan.bus));
    let peripherals = plan.devices.iter().map(|device| peripherals::config(device, &plan.bus, found));
    Ok((drives.chain(peripherals).collect(), absent))
}

/// Whether a start of the robot finds everybody where its file has them, behind [`Bus::scan`]; nothing is asked of the segment.
pub fn finds_all<L: Link, C: Clock>(bus: &Bus<L, C>, plan: &RobotPlan) -> Result<(), SessionError> {
    let (configs, _) = asked(plan, bus.subdevices())?;
    bus.places(&configs).map(drop).map_err(SessionError::of_configuration)
}

/// Who follows whom, where there are distributed clocks.
pub fn clock_direction(bus: &BusPlan) -> ClockDirection {
    match bus.clock_source {
        ClockSource::DistributedClock => ClockDirection::CycleFollowsDc,
        ClockSource::Host => ClockDirection::DcFollowsHost,
    }
}

/// The cycle, and who leads it.
pub fn pace(bus: &BusPlan) -> Pace {
    let leader = match (bus.synchronisation, bus.clock_source) {
        (Synchronisation::Sync0, ClockSource::DistributedClock) => Leader::ReferenceClock,
        (Synchronisation::Sync0, ClockSource::Host) => Leader::Host,
        (Synchronisation::SyncManagerEvent | Synchronisation::FreeRun, _) => Leader::Nobody,
    };
    Pace {
        cycle: Duration::from_nanos(bus.cycle_ns),
        timeout: Duration::from_nanos(bus.receive_timeout_ns),
        leader,
        sync0_shift_ns: bus.sync0_shift_ns,
    }
}

/// Where the process data of the wheels stand, and of what is beside them.
fn wire<L>(
    plan: &RobotPlan,
    bus: &CyclicBus<L>,
    subdevices: &[SubDevice],
) -> Result<(Vec<Wires>, Vec<Wires>), SessionError>
where
    L: Link,
{
    let wires = |name: &str, place: BusPlace, inputs: usize, outputs: usize| {
        // Of a hot-connect group that isn't there: everybody else was found when the bus was configured.
        let Some(found) = peripherals::found(place, subdevices) else {
            return Ok(Wires { position: ABSENT, ..Wires::default() });
        };
        let placements = bus.plan().placements_of(found.position);
        let bytes = |direction: Direction, words, expected: usize| {
            let placement = placements.iter().find(|placement| placement.direction == direction);
            let range = placement.map_or(0..0, |placement| placement.bytes());
            // What nobody reads or writes has any length.
            match expected {
                0 => Ok(0..0),
                _ if range.len() == expected => Ok(range),
                _ => Err(SessionError::Length {
                    name: name.to_owned(),
                    direction: words,
                    expected,
                    found: range.len(),
                }),
            }
        };
        Ok(Wires {
            position: found.position,
            inputs: bytes(Direction::Inputs, "inputs", inputs)?,
            outputs: bytes(Direction::Outputs, "outputs", outputs)?,
        })
    };
    let drives = plan.drives.iter();
    let drives =
        drives.map(|drive| wires(&drive.name, drive.place, drive.input_bytes(), drive.output_bytes()));
    let peripherals = plan.devices.iter();
    let peripherals = peripherals
        .map(|device| wires(&device.name, device.place, device.input_bytes(), device.output_bytes()));
    Ok((drives.collect::<Result<_, _>>()?, peripherals.collect::<Result<_, SessionError>>()?))
}
