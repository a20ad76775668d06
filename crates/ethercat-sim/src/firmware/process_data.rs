//! Process data: when outputs are taken and inputs given, and whether the MainDevice keeps its beat.

use super::{Firmware, FirmwareConfig, ProcessSyncManager, SmActivation, checks};
use crate::device::{Moment, Outputs};
use crate::dictionary::pdo::{self, Direction, Layout};
use crate::dictionary::{Dictionary, Field};
use crate::pdi::Pdi;
use core::time::Duration;
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_ethercat_wire::register::{self as reg, al_event};
use omnibase_ethercat_wire::{AlState, AlStatusCode, HostTime};

/// Period of a device that runs by its own clock.
const FREE_RUN: Duration = Duration::from_millis(1);
/// The same of a chip without firmware.
const EMULATED_FREE_RUN: Duration = Duration::from_micros(100);
/// What a missing set of outputs adds to the error counter; one that came takes 1 off (ETG.1020, 0x10F1:02).
const MISSED: u32 = 3;
/// SYNC0 counts as gone after so many cycles without it.
const SYNC_TIMEOUT_CYCLES: u32 = 4;
/// The error counter's limit where the dictionary has no 0x10F1:02.
const ERROR_LIMIT: u16 = 9;

/// Which PDOs of a device go together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PdoRules {
    /// Those that must be assigned.
    pub mandatory: Vec<u16>,
    /// Pairs of which one alone may be assigned.
    pub excluded: Vec<[u16; 2]>,
}

impl PdoRules {
    /// A PDO against the rules, as it is assigned or isn't.
    fn wrong(&self, assigned: &[u16]) -> Option<u16> {
        let is_assigned = |pdo: &u16| assigned.contains(pdo);
        let both = self.excluded.iter().find(|pair| pair.iter().all(is_assigned)).map(|pair| pair[0]);
        both.or_else(|| self.mandatory.iter().copied().find(|pdo| !is_assigned(pdo)))
    }
}

/// In which states a device that runs with SYNC0 counts cycles without new outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncMonitoring {
    /// In OP.
    Op,
    /// In SAFE-OP too: outputs must flow before the first SYNC0.
    SafeOpAndOp,
}

/// What a device can be synchronised with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Synchronization {
    /// Bits of 0x1C32:04: 0 free run, 1 SyncManager event, 2 SYNC0, 3 SYNC1.
    pub supported: u16,
    /// SYNC0 cycles are multiples of this, ns.
    pub cycle_step_ns: u32,
    /// Shortest SYNC0 cycle, ns.
    pub shortest_cycle_ns: u32,
    /// Longest SYNC0 cycle, ns.
    pub longest_cycle_ns: u32,
    /// Where cycles without outputs count.
    pub monitoring: SyncMonitoring,
}

impl Synchronization {
    /// Bit of [`Synchronization::supported`]: free run.
    pub const FREE_RUN: u16 = 1 << 0;
    /// Bit of [`Synchronization::supported`]: with the event of the outputs' SyncManager.
    pub const SYNC_MANAGER: u16 = 1 << 1;
    /// Bit of [`Synchronization::supported`]: with SYNC0.
    pub const SYNC0: u16 = 1 << 2;
    /// Bit of [`Synchronization::supported`]: with SYNC1.
    pub const SYNC1: u16 = 1 << 3;
}

/// What the device runs with (values of 0x1C32:01).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Beat {
    FreeRun = 0,
    SyncManager = 1,
    Sync0 = 2,
    Sync1 = 3,
}

/// Whether a state can be entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Entry {
    Ready,
    /// Not yet; should it never become ready, the code says why.
    Waiting(AlStatusCode),
}

#[derive(Debug)]
struct Area {
    plan: ProcessSyncManager,
    layout: Layout,
    image: Vec<u8>,
}

/// Fields of 0x1C32 that the cycle writes.
#[derive(Clone, Copy, Debug)]
struct Counters {
    missed: Field<u16>,
}

#[derive(Debug)]
pub(super) struct ProcessData {
    rules: PdoRules,
    synchronization: Synchronization,
    outputs: Vec<Area>,
    inputs: Vec<Area>,
    counters: Option<Counters>,
    output_events: u32,
    input_events: u32,
    running: bool,
    beat: Beat,
    cycle_ns: u32,
    /// The mode that the device itself put into 0x1C32:01, to tell it from one that the user wrote.
    shown: u16,
    requested: Option<u16>,
    outputs_seen: bool,
    sync_seen: bool,
    fresh: bool,
    error_limit: u32,
    errors: u32,
    due: Option<HostTime>,
    free_run: Duration,
}

const SYNC_TYPE: ObjectAddress = ObjectAddress::new(0x1C32, 1);

impl ProcessData {
    pub fn new(config: &FirmwareConfig, dictionary: &Dictionary) -> Self {
        let areas = |direction| -> Vec<Area> {
            let plans = config.process_data.iter().filter(|plan| plan.direction == direction);
            plans.map(|plan| Area { plan: *plan, layout: Layout::default(), image: Vec::new() }).collect()
        };
        let (outputs, inputs) = (areas(Direction::Outputs), areas(Direction::Inputs));
        let events = |areas: &[Area]| {
            areas.iter().fold(0, |events, area| events | al_event::sync_manager(area.plan.number))
        };
        ProcessData {
            rules: config.pdo_rules.clone(),
            synchronization: config.synchronization,
            output_events: events(&outputs),
            input_events: events(&inputs),
            outputs,
            inputs,
            counters: dictionary.field(0x1C32, 11).map(|missed| Counters { missed }),
            running: false,
            beat: Beat::FreeRun,
            cycle_ns: 0,
            shown: dictionary.peek_number(SYNC_TYPE).unwrap_or(0) as u16,
            requested: None,
            outputs_seen: false,
            sync_seen: false,
            fresh: false,
            error_limit: u32::from(ERROR_LIMIT),
            errors: 0,
            due: None,
            free_run: FREE_RUN,
        }
    }

    /// Events that matter while process data run.
    pub fn events(&self) -> u32 {
        if !self.running {
            return 0;
        }
        let own = if self.output_events != 0 { self.output_events } else { self.input_events };
        match self.beat {
            Beat::Sync0 => self.output_events | al_event::SYNC0,
            Beat::Sync1 => self.output_events | al_event::SYNC1,
            Beat::FreeRun => self.output_events,
            Beat::SyncManager => own,
        }
    }

    pub fn due(&self) -> Option<HostTime> {
        self.due
    }

    pub fn is_due(&self, now: HostTime) -> bool {
        self.due.is_some_and(|due| due <= now)
    }

    /// Bytes of process data that one direction can hold.
    pub fn max_bytes(&self) -> usize {
        let most = |areas: &[Area]| areas.iter().map(|area| usize::from(area.plan.max_bytes)).max();
        most(&self.outputs).max(most(&self.inputs)).unwrap_or(0)
    }

    /// PRE-OP to SAFE-OP: mapping, SyncManagers, FMMUs, synchronisation.
    pub fn prepare(&mut self, pdi: &mut dyn Pdi, dictionary: &mut Dictionary) -> Result<(), AlStatusCode> {
        self.lay_out(dictionary)?;
        for area in self.outputs.iter().chain(&self.inputs) {
            checks::process_data(pdi, &area.plan, area.layout.bytes())?;
        }
        if !checks::areas_apart(pdi) {
            return Err(AlStatusCode::INVALID_SYNC_MANAGER);
        }
        self.choose_beat(pdi, dictionary)
    }

    fn lay_out(&mut self, dictionary: &Dictionary) -> Result<(), AlStatusCode> {
        let refused = |direction| match direction {
            Direction::Outputs => AlStatusCode::INVALID_OUTPUT_MAPPING,
            Direction::Inputs => AlStatusCode::INVALID_INPUT_MAPPING,
        };
        let mut assigned = Vec::new();
        for area in self.outputs.iter_mut().chain(&mut self.inputs) {
            let code = refused(area.plan.direction);
            let assignment = pdo::ASSIGNMENTS.start() + u16::from(area.plan.number);
            assigned.extend(pdo::assigned(dictionary, assignment).map_err(|_| code)?);
            area.layout = pdo::layout(dictionary, assignment, area.plan.direction).map_err(|_| code)?;
            if area.layout.bytes() > usize::from(area.plan.max_bytes) {
                return Err(code);
            }
            let bytes =
                if area.layout.bits == 0 { usize::from(area.plan.listed_bytes) } else { area.layout.bytes() };
            area.image = vec![0; bytes];
        }
        match self.rules.wrong(&assigned) {
            Some(pdo) => Err(refused(Direction::of_pdo(pdo).unwrap_or(Direction::Outputs))),
            None => Ok(()),
        }
    }

    /// SYNC0 decides where it is on; a mode that the user wrote must fit.
    fn choose_beat(&mut self, pdi: &mut dyn Pdi, dictionary: &mut Dictionary) -> Result<(), AlStatusCode> {
        let supported = |bit| self.synchronization.supported & bit != 0;
        let registers = checks::sync_registers(pdi);
        let written = dictionary.peek_number(SYNC_TYPE).unwrap_or(0) as u16;
        if written != self.shown {
            self.requested = Some(written);
        }
        let conflict = AlStatusCode::INVALID_DC_SYNC_CONFIGURATION;
        let own_beat = match self.requested {
            Some(0) => Beat::FreeRun,
            _ if supported(Synchronization::SYNC_MANAGER) => Beat::SyncManager,
            _ => Beat::FreeRun,
        };
        self.beat = match (registers.sync0, self.requested) {
            (true, Some(0 | 1)) => return Err(conflict),
            (true, _) if !supported(Synchronization::SYNC0) => return Err(conflict),
            (true, Some(3)) if !registers.sync1 => return Err(conflict),
            (true, Some(3)) => Beat::Sync1,
            // SYNC0 comes several times to one SYNC1: it is the control loop's, and the application is SYNC1's.
            (true, None) if registers.sync1 && registers.sync1_cycle_ns >= registers.sync0_cycle_ns => {
                Beat::Sync1
            }
            (true, _) => Beat::Sync0,
            (false, Some(2 | 3)) => return Err(conflict),
            (false, _) => own_beat,
        };
        self.cycle_ns = 0;
        if matches!(self.beat, Beat::Sync0 | Beat::Sync1) {
            self.check_cycle(registers.sync0_cycle_ns)?;
            self.cycle_ns = registers.sync0_cycle_ns;
        }
        if self.beat == Beat::Sync1 {
            // It is counted from the first SYNC0 behind the SYNC1 before: what is shorter than SYNC0's cycle is a shift.
            let cycles = registers.sync1_cycle_ns / registers.sync0_cycle_ns + 1;
            self.cycle_ns = registers.sync0_cycle_ns.saturating_mul(cycles);
        }
        self.shown = self.beat as u16;
        for index in [0x1C32, 0x1C33] {
            dictionary.store(ObjectAddress::new(index, 1), &self.shown.to_le_bytes());
            dictionary.store(ObjectAddress::new(index, 2), &self.cycle_ns.to_le_bytes());
            dictionary.store(ObjectAddress::new(index, 10), &self.cycle_ns.to_le_bytes());
        }
        self.error_limit = dictionary
            .peek_number(ObjectAddress::new(0x10F1, 2))
            .map_or(u32::from(ERROR_LIMIT), |limit| limit as u32);
        Ok(())
    }

    fn check_cycle(&self, cycle_ns: u32) -> Result<(), AlStatusCode> {
        let Synchronization { cycle_step_ns, shortest_cycle_ns, longest_cycle_ns, .. } = self.synchronization;
        if cycle_ns == 0 {
            return Err(AlStatusCode::DC_SYNC0_CYCLE_TIME);
        }
        let fits = (shortest_cycle_ns..=longest_cycle_ns).contains(&cycle_ns)
            && cycle_ns.is_multiple_of(cycle_step_ns.max(1));
        if fits { Ok(()) } else { Err(AlStatusCode::INVALID_DC_CYCLE_TIME) }
    }

    /// SAFE-OP begins: the first inputs lie ready.
    pub fn start(&mut self, pdi: &mut dyn Pdi, dictionary: &Dictionary, now: HostTime) {
        self.running = true;
        self.outputs_seen = false;
        self.sync_seen = false;
        self.fresh = false;
        self.errors = 0;
        self.due = (self.beat == Beat::FreeRun).then(|| now + self.free_run);
        self.put_inputs(pdi, dictionary);
    }

    /// The same for a chip without firmware, which checks nothing.
    ///
    /// Such a chip's terminals follow its memory; here they look at it in short intervals.
    pub fn start_unchecked(&mut self, pdi: &mut dyn Pdi, dictionary: &Dictionary, now: HostTime) {
        if self.running || self.lay_out(dictionary).is_err() {
            return;
        }
        self.running = true;
        self.beat = Beat::FreeRun;
        self.free_run = EMULATED_FREE_RUN;
        self.due = self.has_data().then(|| now + self.free_run);
        self.put_inputs(pdi, dictionary);
    }

    pub fn stop(&mut self) {
        self.running = false;
        self.due = None;
    }

    /// Whether outputs (and SYNC0) came since SAFE-OP.
    pub fn ready_for_op(&self) -> Entry {
        let wants_outputs = self
            .outputs
            .iter()
            .any(|area| area.layout.bits != 0 && area.plan.activation == SmActivation::SafeOp);
        if wants_outputs && !self.outputs_seen {
            return Entry::Waiting(AlStatusCode::NO_VALID_OUTPUTS);
        }
        if matches!(self.beat, Beat::Sync0 | Beat::Sync1) && !self.sync_seen {
            return Entry::Waiting(AlStatusCode::NO_SYNC_ERROR);
        }
        Entry::Ready
    }

    /// What is switched on for OP alone must be on by now.
    pub fn check_op_only(&self, pdi: &mut dyn Pdi) -> Result<(), AlStatusCode> {
        let op_only = |area: &&Area| area.plan.activation == SmActivation::OpOnly && area.layout.bits != 0;
        let mut off = self.outputs.iter().chain(&self.inputs).filter(op_only);
        match off.find(|area| !checks::enabled(pdi, area.plan.number)) {
            Some(area) => Err(checks::invalid_configuration(area.plan.direction)),
            None => Ok(()),
        }
    }

    /// OP begins with the outputs that came last.
    pub fn enter_op(&mut self, pdi: &mut dyn Pdi, dictionary: &mut Dictionary) {
        self.errors = 0;
        for area in &mut self.outputs {
            if area.layout.bits != 0 {
                pdi.read(area.plan.start, &mut area.image);
                area.layout.take(&area.image, dictionary);
            }
        }
        self.fresh = true;
    }

    /// The code for a SyncManager that was switched off while it is needed.
    pub fn switched_off(&self, pdi: &mut dyn Pdi) -> Option<AlStatusCode> {
        let needed = self
            .outputs
            .iter()
            .chain(&self.inputs)
            .filter(|area| area.layout.bits != 0 && area.plan.activation == SmActivation::SafeOp);
        let mut off = needed.filter(|area| !checks::enabled(pdi, area.plan.number));
        off.next().map(|area| checks::invalid_configuration(area.plan.direction))
    }

    /// Whether any SyncManager of the process data is switched on.
    pub fn any_on(&self, pdi: &mut dyn Pdi) -> bool {
        self.outputs.iter().chain(&self.inputs).any(|area| checks::enabled(pdi, area.plan.number))
    }

    /// Events of the outputs' SyncManagers.
    pub fn output_events(&self) -> u32 {
        self.output_events
    }

    fn has_data(&self) -> bool {
        self.outputs.iter().chain(&self.inputs).any(|area| area.layout.bits != 0)
    }

    /// Output SyncManagers that were written since they were read: those whose control register raises no event.
    fn written(&self, pdi: &mut dyn Pdi) -> u32 {
        self.outputs.iter().fold(0, |events, area| {
            let mut status = [0];
            pdi.read(reg::SM + reg::SM_SIZE * u16::from(area.plan.number) + 5, &mut status);
            // Digital outputs among the registers (0x0F00) have no buffers: what stands there holds.
            let written = status[0] & 1 != 0 || area.plan.start < reg::PROCESS_DATA;
            if written { events | al_event::sync_manager(area.plan.number) } else { events }
        })
    }

    fn take_outputs(&mut self, pdi: &mut dyn Pdi, dictionary: &mut Dictionary, state: AlState, event: u32) {
        for area in &mut self.outputs {
            if event & al_event::sync_manager(area.plan.number) == 0 || area.layout.bits == 0 {
                continue;
            }
            pdi.read(area.plan.start, &mut area.image);
            self.outputs_seen = true;
            self.fresh = true;
            if state == AlState::Op {
                area.layout.take(&area.image, dictionary);
            }
        }
    }

    fn put_inputs(&mut self, pdi: &mut dyn Pdi, dictionary: &Dictionary) {
        for area in &mut self.inputs {
            if area.layout.bits != 0 {
                area.layout.put(dictionary, &mut area.image);
            }
            // What the SII lists without a PDO is zeros.
            if !area.image.is_empty() {
                pdi.write(area.plan.start, &area.image);
            }
        }
    }

    /// A beat of SYNC0 (or SYNC1): counts beats without outputs; `true` when there were too many.
    fn count_missed(&mut self, dictionary: &mut Dictionary, state: AlState) -> bool {
        let monitored = self.output_events != 0
            && (state == AlState::Op || self.synchronization.monitoring == SyncMonitoring::SafeOpAndOp);
        if !monitored {
            return false;
        }
        if self.fresh {
            self.errors = self.errors.saturating_sub(1);
            return false;
        }
        if let Some(counters) = self.counters {
            let missed = dictionary.get(counters.missed).saturating_add(1);
            dictionary.set(counters.missed, missed);
        }
        self.errors += MISSED;
        self.errors > self.error_limit
    }
}

impl Firmware {
    /// An event of the process data, or its time came.
    pub(super) fn run_process_data(&mut self, pdi: &mut dyn Pdi, event: u32, now: HostTime) {
        let state = self.states.state();
        if !self.process.running {
            return;
        }
        let process = &mut self.process;
        let timed_out = process.is_due(now);
        let event = match process.beat {
            Beat::FreeRun if timed_out => event | process.written(pdi),
            _ => event,
        };
        if event & process.output_events != 0 {
            process.take_outputs(pdi, &mut self.dictionary, state, event);
        }
        let beats = match process.beat {
            Beat::FreeRun => timed_out,
            Beat::SyncManager => event & process.events() != 0,
            Beat::Sync0 => event & al_event::SYNC0 != 0,
            Beat::Sync1 => event & al_event::SYNC1 != 0,
        };
        let synchronized = matches!(process.beat, Beat::Sync0 | Beat::Sync1);
        if !beats {
            if synchronized && timed_out {
                process.due = None;
                if state == AlState::Op {
                    self.fall(pdi, AlState::SafeOp, AlStatusCode::FATAL_SYNC_ERROR);
                }
            }
            return;
        }
        if synchronized {
            let status =
                if process.beat == Beat::Sync0 { reg::DC_SYNC0_STATUS } else { reg::DC_SYNC1_STATUS };
            pdi.read(status, &mut [0]);
            process.sync_seen = true;
            let patience = u64::from(process.cycle_ns) * u64::from(SYNC_TIMEOUT_CYCLES);
            process.due = Some(now + Duration::from_nanos(patience));
            if !self.states.has_error() && process.count_missed(&mut self.dictionary, state) {
                process.errors = 0;
                self.fall(pdi, AlState::SafeOp, AlStatusCode::SYNCHRONIZATION_ERROR);
            }
        } else if process.beat == Beat::FreeRun {
            process.due = Some(now + process.free_run);
        }
        let outputs = match (self.states.state(), self.process.fresh) {
            (AlState::Op, true) => Outputs::New,
            (AlState::Op, false) => Outputs::Held,
            _ => Outputs::Safe,
        };
        self.process.fresh = false;
        let cycle_ns = (self.process.cycle_ns != 0).then_some(self.process.cycle_ns);
        self.device.run(&mut self.dictionary, Moment { now, outputs, cycle_ns });
        self.process.put_inputs(pdi, &self.dictionary);
    }
}
