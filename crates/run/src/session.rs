//! The bus of a robot: from what is plugged in to OP, one exchange a cycle at the pace of clocks, and back to INIT.

mod error;

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::events::Words;
use crate::supervision::{BusFigures, DatagramFigures, SubDeviceFigures, Supervisor};
use omnibase_cia402::ErrorCode;
use omnibase_ethercat::cyclic::{
    AcyclicCompletion, AcyclicRequest, AcyclicWork, ClockDirection, CycleCounters, CyclicBus, DcFollower,
    Exchange as BusExchange, FollowerGains, Goal, Handover, HostToDc, Phase, TransitionOptions,
};
use omnibase_ethercat::mailbox::MailboxRequest;
use omnibase_ethercat::subdevice::{Direction, SubDevice};
use omnibase_ethercat::transaction::Access;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::frame::FrameBuilder;
use omnibase_ethercat::wire::{
    Address, AlState, Clock, Command, DcTime, HostTime, Link, LinkError, register,
};
use omnibase_ethercat::{Bus, BusOptions, Match, ProcessImage as BusImage, SetUpError};
use omnibase_robot::config::{BusPlan, ClockSource, DrivePlace, DriveWatchdog, Synchronisation};
use omnibase_robot::signals::DriveMeasurement;
use omnibase_robot::{Exchange, ProcessImage, RobotPlan};

pub use error::{SessionError, WatchdogRegisters};

/// Frames that ask for INIT where the orderly way there failed.
const BROADCAST_ATTEMPTS: u32 = 3;
/// Cycles in which drives are asked by SDO what is wrong with them.
const ASKING_CYCLES: u32 = 200;
/// The object that says it: the drive profile's error code.
const ERROR_CODE: ObjectAddress = ObjectAddress::new(0x603F, 0);
/// The longest wait for each state on the way back.
const END_TIMEOUT: Duration = Duration::from_secs(1);

/// What one cycle's times were.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// Periods of the cycle since the one before: more than one where cycles were left out.
    pub periods: u64,
    /// The instant of its period: the one nearest to its begin.
    pub wake: HostTime,
    /// How long after the instant that was planned for it it began, ns.
    pub late_ns: u64,
    /// From the send until all frames were back or given up, ns.
    pub round_trip_ns: u64,
    /// How far its frame was behind (positive) or before its place in the DC cycle, ns; `None` without a reading.
    pub dc_phase_ns: Option<i64>,
}

/// Who leads whom in time.
#[derive(Debug)]
enum Pace {
    /// The cycle runs by the host's clock.
    Free,
    /// The cycle follows the reference clock.
    FollowDc(DcFollower),
    /// The reference clock follows the host's; the follower tells the first phase.
    LeadDc(DcFollower, HostToDc),
}

/// A robot's bus with its process data and its pace.
///
/// One that goes without its [`Session::end`] (a panic) asks everyone for INIT all the same, where nobody has to wait
/// for the drives' watchdogs.
pub struct Session<L: Link, C: Clock> {
    bus: CyclicBus<L>,
    clock: C,
    image: BusImage,
    wiring: Vec<Wires>,
    supervisor: Supervisor,
    /// Counts when OP was reached: what was lost on the way there is no fault of the run.
    counted_before: CycleCounters,
    pace: Pace,
    cycle: Duration,
    timeout: Duration,
    last_clock: Option<DcTime>,
    wake: HostTime,
    /// The phase error of the last frame, where it brought a reading.
    phase_ns: Option<i64>,
    end: End,
}

/// Whether the way back was gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    ToCome,
    Gone,
}

impl<L: Link, C: Clock> Drop for Session<L, C> {
    fn drop(&mut self) {
        if self.end == End::ToCome {
            self.broadcast_init();
        }
    }
}

/// Where one wheel's process data stand.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Wires {
    /// Position of the SubDevice.
    position: u16,
    inputs: Range<usize>,
    outputs: Range<usize>,
}

/// The process data of all wheels, as the robot sees them.
struct WheelImage<'a> {
    image: &'a mut BusImage,
    wiring: &'a [Wires],
}

impl ProcessImage for WheelImage<'_> {
    fn inputs(&self, wheel: usize) -> &[u8] {
        self.wiring.get(wheel).map_or(&[], |wires| &self.image.inputs[wires.inputs.clone()])
    }

    fn outputs(&mut self, wheel: usize) -> &mut [u8] {
        match self.wiring.get(wheel) {
            Some(wires) => &mut self.image.outputs[wires.outputs.clone()],
            None => &mut [],
        }
    }
}

impl<L: Link, C: Clock> Session<L, C> {
    /// Finds the drives, compares them with the plan and configures them; they are in PRE-OP then.
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
        let configs: Vec<_> = plan.drives.iter().map(|drive| drive.subdevice_config(&plan.bus)).collect();
        let configured = bus.configure(&configs);
        bus.warnings().iter().for_each(|warning| warn(warning.to_string()));
        configured?;
        check_watchdogs(&mut bus, plan)?;
        let direction = match plan.bus.clock_source {
            ClockSource::DistributedClock => ClockDirection::CycleFollowsDc,
            ClockSource::Host => ClockDirection::DcFollowsHost,
        };
        let Handover { bus, clock, subdevices } = bus.into_cyclic(direction)?;
        let wiring = wire(plan, &bus, &subdevices)?;
        let cycle = Duration::from_nanos(plan.bus.cycle_ns);
        let pace = if bus.clock_use().reference().is_some() { pace(&plan.bus) } else { Pace::Free };
        let wheel_of =
            |one: &SubDevice| wiring.iter().position(|wires: &Wires| wires.position == one.position);
        Ok(Session {
            supervisor: Supervisor::new(subdevices, plan.safety.lost_exchanges_tolerated, wheel_of),
            counted_before: CycleCounters::default(),
            image: bus.plan().image(),
            wake: clock.now() + cycle,
            bus,
            clock,
            wiring,
            pace,
            cycle,
            timeout: Duration::from_nanos(plan.bus.receive_timeout_ns),
            last_clock: None,
            phase_ns: None,
            end: End::ToCome,
        })
    }

    /// Cycles until everyone is in OP; `false` where `stop` came first. Outputs are zero until somebody writes them.
    pub fn reach_op(&mut self, stop: &AtomicBool) -> Result<bool, SessionError> {
        let reached = self.reach(Goal::Op, "OP", TransitionOptions::default(), stop);
        self.counted_before = self.bus.counters();
        reached
    }

    /// Brings everyone back to INIT; who doesn't go there in order is asked by broadcast.
    pub fn end(&mut self) -> Result<(), SessionError> {
        let options = TransitionOptions { state_timeout: END_TIMEOUT, ..TransitionOptions::default() };
        let ended = self.reach(Goal::Init, "INIT", options, &AtomicBool::new(false));
        if ended.is_err() {
            self.broadcast_init();
        }
        self.end = End::Gone;
        ended.map(drop)
    }

    /// Asks every drive by SDO for its error code, beside the cycle; `None` for a drive that doesn't answer in time.
    ///
    /// Outputs stay as they are. Not for the cycle: it allocates.
    pub fn error_codes(&mut self) -> Result<Vec<Option<ErrorCode>>, LinkError> {
        let mut codes = vec![None; self.wiring.len()];
        for (wheel, wires) in self.wiring.iter().enumerate() {
            let position = wires.position;
            let upload = MailboxRequest::upload(ERROR_CODE, Vec::with_capacity(2));
            let work = AcyclicWork::Mailbox(upload);
            // A full queue is one more drive that isn't heard.
            let _ = self.bus.submit(AcyclicRequest { tag: wheel as u64, position, work });
        }
        let mut open = self.wiring.len();
        for _ in 0..ASKING_CYCLES {
            if open == 0 {
                break;
            }
            // Without the supervisor, who would take the answers.
            self.clock.sleep_until(self.wake);
            let woke = self.clock.now();
            self.leave_out((woke - self.wake).as_nanos() as u64);
            self.bus.exchange(&mut self.image, self.wake.max(woke) + self.timeout)?;
            self.phase_ns = self.plan_next(woke);
            while let Some(completion) = self.bus.poll_completion() {
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

    fn reach(
        &mut self,
        goal: Goal,
        name: &'static str,
        options: TransitionOptions,
        stop: &AtomicBool,
    ) -> Result<bool, SessionError> {
        self.bus.request(goal, options, self.clock.now());
        loop {
            match self.bus.phase() {
                Phase::Reached(_) => return Ok(true),
                Phase::Failed(error) => return Err(SessionError::Transition { goal: name, error }),
                Phase::Standby => return Ok(false),
                Phase::Moving { .. } => {}
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            self.exchange()?;
        }
    }

    /// One cycle: sleeps until its instant, exchanges, and plans the next instant. `Err` only where the port is broken: a link
    /// that is down loses the exchange.
    ///
    /// Whoever comes late belongs to the period whose instant is nearest; the periods before it are left out, and no
    /// burst catches up. Frames pass half a cycle away from SYNC0: one that comes later than that serves the next
    /// SYNC0, which another frame must not serve again.
    pub fn exchange(&mut self) -> Result<(Exchange, Times), LinkError> {
        self.clock.sleep_until(self.wake);
        let woke = self.clock.now();
        let late_ns = (woke - self.wake).as_nanos() as u64;
        let left_out = self.leave_out(late_ns);
        // Where the host overslept the frame still needs its time to come back.
        let deadline = self.wake.max(woke) + self.timeout;
        if let Pace::LeadDc(_, leader) = &self.pace {
            self.bus.steer_clock(leader.time_at(woke));
        }
        // Whoever is away mustn't find an old command when it comes back: all zero disables a drive.
        let were_away = self.supervisor.away_wheels();
        for wires in self.wiring.iter().filter(|wires| self.supervisor.is_away(wires.position)) {
            self.image.outputs[wires.outputs.clone()].fill(0);
        }
        let exchange = self.bus.exchange(&mut self.image, deadline)?;
        self.supervisor.after(&mut self.bus, deadline);
        let back = self.clock.now();
        let (wake, round_trip_ns) = (self.wake, (back - woke).as_nanos() as u64);
        self.phase_ns = self.plan_next(woke);
        let dc_phase_ns = self.phase_ns;
        let times = Times { periods: 1 + left_out, wake, late_ns, round_trip_ns, dc_phase_ns };
        Ok((self.robot_exchange(exchange, were_away), times))
    }

    /// What became of an exchange, as the robot needs to know it; of some wheels nobody was heard when it began.
    fn robot_exchange(&mut self, exchange: BusExchange, were_away: u16) -> Exchange {
        // Whoever is on its way back already answers, but its way isn't over. Whoever was away when the frame left had
        // its inputs left as they were, even if it is well by now.
        let wheels = were_away | self.supervisor.away_wheels();
        match exchange {
            BusExchange::Complete if self.supervisor.away_wheels() != 0 => Exchange::Without { wheels },
            BusExchange::Complete => match self.supervisor.take_restarted() {
                0 => Exchange::Complete,
                wheels => Exchange::Restarted { wheels },
            },
            BusExchange::Lost { .. } => Exchange::Lost,
            BusExchange::ShortCount { expected, received, .. } => Exchange::ShortCount { expected, received },
            BusExchange::Without { .. } => Exchange::Without { wheels },
        }
    }

    /// Has the supervisor look at what the drives said.
    pub fn look_at_drives(&mut self, drives: &[DriveMeasurement]) {
        self.supervisor.look_at_drives(drives);
    }

    /// The SubDevices as the set-up found them.
    pub fn subdevices(&self) -> impl Iterator<Item = &SubDevice> {
        self.supervisor.subdevices()
    }

    /// Whether the SubDevice at `position` is lost or on its way back.
    pub fn is_away(&self, position: u16) -> bool {
        self.supervisor.is_away(position)
    }

    /// Has something done beside the cycle, in spare datagrams; given back where there is no room.
    ///
    /// Its tag has the bit [`OTHERS`](crate::supervision::OTHERS).
    pub fn submit_acyclic(&mut self, request: AcyclicRequest) -> Result<(), AcyclicRequest> {
        self.bus.submit(request)
    }

    /// What was submitted by this tag, once it has ended.
    pub fn take_acyclic(&mut self, tag: u64) -> Option<AcyclicCompletion> {
        self.supervisor.take_ended(tag)
    }

    /// The next thing that happened on the bus.
    pub fn take_event(&mut self) -> Option<Words> {
        self.supervisor.take_event()
    }

    /// The next of what a drive said by an emergency: its wheel, and its error.
    pub fn take_said(&mut self) -> Option<(usize, ErrorCode)> {
        self.supervisor.take_said()
    }

    /// What was counted since OP was reached.
    pub fn figures(&self) -> BusFigures {
        let (now, before) = (self.bus.counters(), self.counted_before);
        BusFigures {
            frames_lost: now.frames_lost - before.frames_lost,
            frames_late: now.late - before.late,
            frames_short: now.short - before.short,
            frames_duplicate: now.duplicate - before.duplicate,
            frames_foreign: now.foreign - before.foreign,
            working_counter_errors: now.working_counter_errors - before.working_counter_errors,
            al_status: self.bus.status().map_or(0, |status| status.bits.into()),
            dc_phase_ns: self.phase_ns.unwrap_or(0),
            ..*self.supervisor.totals()
        }
    }

    /// What was counted of each SubDevice.
    pub fn subdevice_figures(&self) -> Vec<SubDeviceFigures> {
        self.supervisor.figures().cloned().collect()
    }

    /// Working counters, by datagram.
    pub fn datagram_figures(&self) -> Vec<DatagramFigures> {
        let counts = self.bus.datagram_counts().map(|count| DatagramFigures {
            name: format!("frame {} datagram {} {}", count.frame, count.datagram, count.command),
            expected: count.expected,
            short_counts: count.short_counts,
        });
        counts.collect()
    }

    /// Goes on to the period whose instant is nearest to the present. How many periods were left out.
    fn leave_out(&mut self, late_ns: u64) -> u64 {
        let cycle_ns = self.cycle.as_nanos().max(1) as u64;
        let missed = late_ns.saturating_add(cycle_ns / 2) / cycle_ns;
        self.wake = HostTime(self.wake.0.saturating_add(missed.saturating_mul(cycle_ns)));
        missed
    }

    /// Plans the next instant; the phase error of this cycle's frame, where it brought a reading.
    fn plan_next(&mut self, woke: HostTime) -> Option<i64> {
        // A reading that didn't change is that of an earlier frame.
        let reading = self.bus.clock().filter(|time| self.last_clock != Some(*time));
        self.last_clock = self.bus.clock();
        let planned = self.wake + self.cycle;
        // How long after the period's instant the frame left: negative where an earlier one was left out for it.
        let off_ns = woke.0.wrapping_sub(self.wake.0) as i64;
        let phase_ns = match &self.pace {
            Pace::Free => None,
            Pace::FollowDc(follower) | Pace::LeadDc(follower, _) => {
                reading.map(|clock| follower.phase_error(clock))
            }
        };
        self.wake = match &mut self.pace {
            Pace::Free => planned,
            // The reading as it were, had the host woken at the instant: its lateness says nothing about the clocks.
            Pace::FollowDc(follower) => {
                let on_time = reading.map(|clock| DcTime(clock.0.wrapping_add_signed(-off_ns)));
                follower.next_wake(self.wake, on_time)
            }
            Pace::LeadDc(_, leader) => {
                let is_first = leader.time_at(woke).is_none();
                if let Some(clock) = reading {
                    leader.read(woke, clock);
                }
                match phase_ns {
                    Some(phase_ns) if is_first => {
                        // Once, before any SYNC0: from then on both pass alike.
                        HostTime(planned.0.saturating_add_signed(off_ns - phase_ns))
                    }
                    _ => planned,
                }
            }
        };
        phase_ns
    }

    /// The process data as the robot sees them.
    pub fn image(&mut self) -> impl ProcessImage + '_ {
        WheelImage { image: &mut self.image, wiring: &self.wiring }
    }

    /// The clock.
    pub fn clock(&self) -> &C {
        &self.clock
    }

    /// What the bus counted.
    pub fn counters(&self) -> CycleCounters {
        self.bus.counters()
    }

    /// Asks everyone who still listens for INIT: one that is gone must not keep the others in OP.
    fn broadcast_init(&mut self) {
        let mut frame = FrameBuilder::new();
        let ask = [AlState::Init.bits() as u8 | AlState::ERROR as u8, 0];
        if frame.push(Command::Bwr, 0, Address::broadcast(register::AL_CONTROL), &ask).is_ok() {
            for _ in 0..BROADCAST_ATTEMPTS {
                // Where the link is gone nobody hears it; the drives' watchdogs stop them.
                let _ = self.bus.link_mut().send(frame.bytes());
            }
        }
    }
}

/// Reads back what decides whether the wheels stop when this program dies.
fn check_watchdogs<L: Link, C: Clock>(bus: &mut Bus<L, C>, plan: &RobotPlan) -> Result<(), SessionError> {
    let expected =
        WatchdogRegisters { divider: DriveWatchdog::DIVIDER, process_data: plan.bus.drive_watchdog.steps };
    let positions: Vec<u16> = bus.subdevices().iter().map(|one| one.position).collect();
    for position in positions {
        let drive = bus.subdevice(position)?.config.name.clone().unwrap_or_default();
        let mut read = |what, register| {
            let access = bus.transactor().perform_one(Access::read_at(what, position, register, 2))?;
            Ok::<u16, SetUpError>(access.data.iter().rev().fold(0, |word, byte| word << 8 | u16::from(*byte)))
        };
        let found = WatchdogRegisters {
            divider: read("the watchdogs' divider", register::WATCHDOG_DIVIDER)?,
            process_data: read("the process-data watchdog", register::WATCHDOG_PROCESS_DATA)?,
        };
        if found != expected {
            return Err(SessionError::Watchdog { drive, position, expected, found });
        }
    }
    Ok(())
}

fn pace(bus: &BusPlan) -> Pace {
    if bus.synchronisation != Synchronisation::Sync0 {
        return Pace::Free;
    }
    let cycle = Duration::from_nanos(bus.cycle_ns);
    // Frames pass half a cycle away from SYNC0, before and behind it.
    let phase_ns = (i64::from(bus.sync0_shift_ns) + bus.cycle_ns as i64 / 2).rem_euclid(bus.cycle_ns as i64);
    let follower = DcFollower::new(cycle, Duration::from_nanos(phase_ns as u64), FollowerGains::default());
    match bus.clock_source {
        ClockSource::DistributedClock => Pace::FollowDc(follower),
        ClockSource::Host => Pace::LeadDc(follower, HostToDc::new()),
    }
}

/// How long before a cycle's frame the drives read the encoders whose values it fetches, ns.
pub fn input_age_ns(bus: &BusPlan) -> u64 {
    match bus.synchronisation {
        Synchronisation::Sync0 => bus.cycle_ns / 2,
        // At the arrival of the frame before.
        Synchronisation::SyncManagerEvent | Synchronisation::FreeRun => bus.cycle_ns,
    }
}

fn wire<L>(plan: &RobotPlan, bus: &CyclicBus<L>, subdevices: &[SubDevice]) -> Result<Vec<Wires>, SessionError>
where
    L: Link,
{
    let wires = plan.drives.iter().map(|drive| {
        let place = match drive.place {
            DrivePlace::Position(position) => Match::Position(position),
            DrivePlace::Alias(alias) => Match::Alias(alias),
        };
        let found = subdevices.iter().find(|one| one.config.place == Some(place));
        let placements = found.map_or(&[][..], |one| bus.plan().placements_of(one.position));
        let bytes = |direction: Direction, name, expected: usize| {
            let placement = placements.iter().find(|placement| placement.direction == direction);
            let range = placement.map_or(0..0, |placement| placement.bytes());
            if range.len() == expected {
                return Ok(range);
            }
            let drive = drive.name.clone();
            Err(SessionError::Length { drive, direction: name, expected, found: range.len() })
        };
        Ok(Wires {
            position: found.map_or(u16::MAX, |one| one.position),
            inputs: bytes(Direction::Inputs, "inputs", drive.input_bytes())?,
            outputs: bytes(Direction::Outputs, "outputs", drive.output_bytes())?,
        })
    });
    wires.collect()
}
