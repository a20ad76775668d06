//! The two servo drives: a generic CiA 402 one, and the Yaskawa SGDV.

use super::Piece;
use super::axis::{Axis, Load, SingleAxis};
use super::generic::FIRMWARE;
use super::image::{ImagePlan, Mailbox, PDI_WITH_FIRMWARE, PORT_MII, emit};
use super::servo::{CommunicationFaults, Servo, ServoConfig};
use crate::dictionary::Dictionary;
use crate::dictionary::pdo::{self, Direction};
use crate::dictionary::standard::{Nameplate, PdoMap};
use crate::firmware::{
    FileStore, Firmware, FirmwareConfig, MailboxProtocols, PdoRules, ProcessSyncManager, SmActivation,
    StateControl, SyncMonitoring, Synchronization, TransitionTimes,
};
use crate::{EscConfig, SubDevice};
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_ethercat_wire::register;
use omnibase_ethercat_wire::sii::{self, Identity, MailboxArea};

/// Vendor of the generic servo: one that the ETG gives nobody.
pub const SERVO_VENDOR: u32 = 0x0000_0F0F;
/// Product code of the generic servo.
pub const SERVO_PRODUCT: u32 = 0x0000_0402;
/// Vendor: Yaskawa Electric.
pub const SGDV_VENDOR: u32 = 0x0000_0539;
/// Product code: SGDV-OCA01A.
pub const SGDV_PRODUCT: u32 = 0x0220_0001;
/// Device type (0x1000): CiA 402 servo drive.
const DEVICE_TYPE: u32 = 0x0002_0192;
/// Yaskawa's alarm A.A12, "EtherCAT outputs data synchronization error", as 0x603F shows it.
const ALARM_A12: u16 = 0x0A12;
/// Yaskawa's alarm A.A11, "EtherCAT AL state error".
const ALARM_A11: u16 = 0x0A11;
/// Emergency error code: manufacturer specific, the alarm stands in the data.
const EMERGENCY_DEVICE_SPECIFIC: u16 = 0xFF00;

/// What stands in the generic drive's firmware file at first.
const FIRMWARE_CONTENT: &[u8] = b"CiA402-Servo firmware 1";
/// A third of the 1 KiB between the SyncManagers: three buffers.
const PROCESS_DATA_LIMIT: u16 = 341;
const MAILBOX: MailboxArea =
    MailboxArea { receive_offset: 0x1000, receive_size: 256, send_offset: 0x1400, send_size: 256 };

const PROCESS_DATA: [ProcessSyncManager; 2] = [
    ProcessSyncManager {
        number: 2,
        direction: Direction::Outputs,
        start: 0x1800,
        control: 0x64,
        max_bytes: PROCESS_DATA_LIMIT,
        listed_bytes: 0,
        activation: SmActivation::SafeOp,
    },
    ProcessSyncManager {
        number: 3,
        direction: Direction::Inputs,
        start: 0x1C00,
        control: 0x20,
        max_bytes: PROCESS_DATA_LIMIT,
        listed_bytes: 0,
        activation: SmActivation::SafeOp,
    },
];

/// Which of the two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveKind {
    /// A CiA 402 servo that processes every command.
    Generic,
    /// A Yaskawa SGDV: no LRW, APRW, FPRW, BRW; SYNC0 in multiples of 125 us; A.A12.
    Sgdv,
}

/// A drive of a kind with its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Which kind.
    pub kind: DriveKind,
    /// Motor, loops and timing.
    pub servo: ServoConfig,
    /// How long it takes to change its AL state.
    pub times: TransitionTimes,
    /// Outputs by default (0x1600).
    pub rx_pdo: PdoMap,
    /// Inputs by default (0x1A00).
    pub tx_pdo: PdoMap,
}

impl Drive {
    /// A drive as it leaves the factory.
    pub fn new(kind: DriveKind) -> Self {
        let (rx, tx): (&[_], &[_]) = match kind {
            DriveKind::Generic => (
                &[(0x6040, 16), (0x607A, 32), (0x60FF, 32), (0x6071, 16), (0x6072, 16), (0x6060, 8), (0, 8)],
                &[(0x6041, 16), (0x6064, 32), (0x606C, 32), (0x6077, 16), (0x603F, 16), (0x6061, 8), (0, 8)],
            ),
            DriveKind::Sgdv => (
                &[
                    (0x6040, 16),
                    (0x607A, 32),
                    (0x60FF, 32),
                    (0x6071, 16),
                    (0x6072, 16),
                    (0x6060, 8),
                    (0, 8),
                    (0x60C1, 32),
                ],
                &[
                    (0x6041, 16),
                    (0x6064, 32),
                    (0x6077, 16),
                    (0x60F4, 32),
                    (0x6061, 8),
                    (0, 8),
                    (0x60B9, 16),
                    (0x60BA, 32),
                ],
            ),
        };
        let generic = ServoConfig::default();
        let servo = match kind {
            DriveKind::Generic => generic,
            DriveKind::Sgdv => ServoConfig {
                synchronization: Synchronization {
                    supported: Synchronization::FREE_RUN | Synchronization::SYNC0,
                    cycle_step_ns: 125_000,
                    shortest_cycle_ns: 125_000,
                    longest_cycle_ns: 4_000_000,
                    monitoring: SyncMonitoring::SafeOpAndOp,
                },
                faults: CommunicationFaults {
                    lost: ALARM_A11,
                    synchronization: ALARM_A12,
                    emergency: Some(EMERGENCY_DEVICE_SPECIFIC),
                },
                ..generic
            },
        };
        Drive {
            kind,
            servo,
            times: TransitionTimes::default(),
            rx_pdo: pdo_map(0x1600, "Outputs", rx),
            tx_pdo: pdo_map(0x1A00, "Inputs", tx),
        }
    }

    /// A SubDevice with this drive and a motor of its own.
    pub fn build(&self, piece: &Piece, load: Load) -> SubDevice {
        self.build_on(piece, Box::new(SingleAxis::new(load)))
    }

    /// A SubDevice with this drive on any axis.
    pub fn build_on(&self, piece: &Piece, axis: Box<dyn Axis>) -> SubDevice {
        let (servo, dictionary) = self.servo(piece, &self.pdos(), axis);
        let sii = self.image(piece, &dictionary);
        let refused = match self.kind {
            DriveKind::Generic => 0,
            DriveKind::Sgdv => register::FEATURE_NO_LRW | register::FEATURE_NO_READ_WRITE,
        };
        let chip = EscConfig::default();
        let esc = EscConfig {
            port_descriptor: 0x0F,
            features: chip.features | refused,
            sii,
            dc_offset_ns: piece.dc_offset_ns,
            dc_drift_ppm: piece.dc_drift_ppm,
            ..chip
        };
        SubDevice::new(esc, Box::new(self.stack(piece, servo, dictionary)))
    }

    /// The drive's firmware alone, to run it behind another chip.
    pub fn firmware(&self, piece: &Piece, axis: Box<dyn Axis>) -> Firmware {
        let (servo, dictionary) = self.servo(piece, &self.pdos(), axis);
        self.stack(piece, servo, dictionary)
    }

    /// The drive's servo with these PDOs, without firmware and chip.
    pub fn servo(&self, piece: &Piece, pdos: &[PdoMap], axis: Box<dyn Axis>) -> (Servo, Dictionary) {
        Servo::new(self.servo.clone(), &self.nameplate(piece), pdos, axis)
    }

    fn pdos(&self) -> [PdoMap; 2] {
        [self.rx_pdo.clone(), self.tx_pdo.clone()]
    }

    fn stack(&self, piece: &Piece, servo: Servo, dictionary: Dictionary) -> Firmware {
        let config = FirmwareConfig {
            state_control: StateControl::Firmware,
            identification: piece.identification,
            mailbox: Some((MAILBOX, MailboxProtocols::Coe)),
            bootstrap: self.has_files().then_some(MAILBOX),
            process_data: PROCESS_DATA.to_vec(),
            pdo_rules: PdoRules::default(),
            synchronization: self.servo.synchronization,
            times: self.times,
        };
        let firmware = Firmware::new(config, dictionary, Box::new(servo));
        match self.has_files() {
            true => firmware.with_files(FileStore::with_firmware(FIRMWARE, FIRMWARE_CONTENT)),
            false => firmware,
        }
    }

    /// The generic drive takes firmware over FoE.
    fn has_files(&self) -> bool {
        self.kind == DriveKind::Generic
    }

    fn image(&self, piece: &Piece, dictionary: &Dictionary) -> Vec<u8> {
        let nameplate = self.nameplate(piece);
        emit(&ImagePlan {
            pdi_control: PDI_WITH_FIRMWARE,
            identity: nameplate.identity,
            alias: piece.alias,
            group: "Drive",
            order: &nameplate.name,
            name: &nameplate.name,
            ports: PORT_MII | PORT_MII << 4,
            flags: match self.kind {
                DriveKind::Generic => 0,
                DriveKind::Sgdv => sii::FLAG_NO_LRW,
            } | piece.identification.map_or(0, |_| sii::FLAG_IDENT_AL_STATUS),
            mailbox: Some(Mailbox {
                area: MAILBOX,
                protocols: sii::PROTOCOL_COE | if self.has_files() { sii::PROTOCOL_FOE } else { 0 },
                bootstrap: if self.has_files() { MAILBOX } else { MailboxArea::default() },
                coe_details: sii::COE_SDO
                    | sii::COE_SDO_INFO
                    | sii::COE_PDO_ASSIGN
                    | sii::COE_PDO_CONFIGURATION
                    | sii::COE_COMPLETE_ACCESS,
            }),
            process_data: &PROCESS_DATA,
            pdos: &self.pdos(),
            dictionary: Some(dictionary),
            dc_modes: &[("Free run", 0x0000), ("SYNC0", 0x0300)],
        })
    }

    /// Whether the default PDOs can be mapped; says which entry can't.
    pub fn check(&self) -> Result<(), String> {
        let axis = Box::new(SingleAxis::new(Load::default()));
        let (_, dictionary) = self.servo(&Piece::default(), &self.pdos(), axis);
        for (assignment, direction) in [(0x1C12, Direction::Outputs), (0x1C13, Direction::Inputs)] {
            let layout = pdo::layout(&dictionary, assignment, direction)
                .map_err(|error| format!("mapping {}: {}", error.at, error.abort))?;
            if layout.bytes() > usize::from(PROCESS_DATA_LIMIT) {
                return Err(format!(
                    "{} bytes of process data, at most {PROCESS_DATA_LIMIT} fit",
                    layout.bytes()
                ));
            }
        }
        Ok(())
    }

    fn nameplate(&self, piece: &Piece) -> Nameplate {
        let (vendor_id, product_code, revision, name) = match self.kind {
            DriveKind::Generic => (SERVO_VENDOR, SERVO_PRODUCT, 0x0001_0000, "CiA402-Servo"),
            DriveKind::Sgdv => (SGDV_VENDOR, SGDV_PRODUCT, 0x0002_0000, "SGDV-OCA01A"),
        };
        Nameplate {
            device_type: DEVICE_TYPE,
            name: name.into(),
            hardware_version: "1.0".into(),
            software_version: env!("CARGO_PKG_VERSION").into(),
            identity: Identity { vendor_id, product_code, revision, serial: piece.serial },
        }
    }
}

/// A PDO of whole objects; 0x60C1 is an array, its first element is meant; 0 is a gap.
fn pdo_map(index: u16, name: &str, entries: &[(u16, u8)]) -> PdoMap {
    let entries = entries.iter().map(|(object, bits)| {
        let subindex = if *object == 0x60C1 { 1 } else { 0 };
        (ObjectAddress::new(*object, subindex), *bits)
    });
    PdoMap { index, name: name.into(), entries: entries.collect() }
}
