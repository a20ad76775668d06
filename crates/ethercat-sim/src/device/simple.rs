//! Simple devices with generated images: a coupler, and digital inputs and outputs bit by bit.

use super::generic::Generic;
use super::image::{
    ImagePlan, Mailbox, PDI_DIGITAL_IO, PDI_EMULATED, PDI_WITH_FIRMWARE, PORT_EBUS, PORT_MII, emit,
};
use super::{Piece, drive::SERVO_VENDOR, parameters};
use crate::dictionary::pdo::Direction;
use crate::dictionary::standard::PdoMap;
use crate::firmware::{ProcessSyncManager, SmActivation};
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_ethercat_wire::sii::{self, Identity, ImageTooShort, MailboxArea};

/// Product code of the coupler.
pub const COUPLER_PRODUCT: u32 = 0x0000_1100;
/// Product code of digital I/O; the numbers of inputs and outputs stand in the bytes below.
pub const DIGITAL_IO_PRODUCT: u32 = 0x0D00_0000;
/// Where a terminal's mailbox lies.
const MAILBOX: MailboxArea =
    MailboxArea { receive_offset: 0x1000, receive_size: 128, send_offset: 0x1400, send_size: 128 };
/// Most bits of a direction.
pub const DIGITAL_IO_LIMIT: u8 = 64;

/// A coupler without process data: port 0 in, port 1 to the terminals, port 2 to the next device.
pub fn coupler(piece: &Piece) -> Result<Generic, ImageTooShort> {
    let sii = emit(&ImagePlan {
        pdi_control: PDI_EMULATED,
        identity: identity(COUPLER_PRODUCT, piece),
        alias: piece.alias,
        group: "Coupler",
        order: "Coupler",
        name: "Coupler",
        ports: PORT_MII | PORT_EBUS << 4 | PORT_MII << 8,
        flags: 0,
        mailbox: None,
        process_data: &[],
        pdos: &[],
        dictionary: None,
        dc_modes: &[],
    });
    Generic::from_sii(&sii, piece)
}

/// Numbers of bits, each at most [`DIGITAL_IO_LIMIT`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DigitalIo {
    /// Bits that the MainDevice reads: objects 0x6000:01 and up.
    pub inputs: u8,
    /// Bits that the MainDevice writes: objects 0x7000:01 and up.
    pub outputs: u8,
}

/// Digital inputs and outputs, a PDO with one bit each.
pub fn digital_io(bits: DigitalIo, piece: &Piece) -> Result<Generic, ImageTooShort> {
    let DigitalIo { inputs, outputs } = bits;
    let mut process_data = Vec::new();
    let mut pdos = Vec::new();
    let directions = [
        (Direction::Outputs, outputs, 0x1000, 0x64, (0x1600, 0x7000, "Output")),
        (Direction::Inputs, inputs, 0x1100, 0x20, (0x1A00, 0x6000, "Input")),
    ];
    for (direction, count, start, control, (pdo, object, name)) in directions {
        let count = count.min(DIGITAL_IO_LIMIT);
        if count == 0 {
            continue;
        }
        let number = process_data.len() as u8;
        process_data.push(ProcessSyncManager {
            number,
            direction,
            start,
            control,
            max_bytes: 8,
            listed_bytes: 0,
            activation: SmActivation::SafeOp,
        });
        pdos.extend((0..count).map(|bit| PdoMap {
            index: pdo + u16::from(bit),
            name: format!("{name} {}", bit + 1),
            entries: vec![(ObjectAddress::new(object, bit + 1), 1)],
        }));
    }
    let name = format!("Digital I/O {inputs}+{outputs}");
    let product = DIGITAL_IO_PRODUCT | u32::from(inputs) << 8 | u32::from(outputs);
    let sii = image(&name, identity(product, piece), &process_data, &pdos, piece, None);
    Generic::from_sii(&sii, piece)
}

/// An input and output terminal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Terminal {
    /// Its name.
    pub name: String,
    /// Vendor.
    pub vendor_id: u32,
    /// Product.
    pub product_code: u32,
    /// Revision.
    pub revision: u32,
    /// PDOs that the MainDevice writes.
    pub outputs: Vec<PdoMap>,
    /// PDOs that the MainDevice reads.
    pub inputs: Vec<PdoMap>,
    /// Parameters with their bytes, each 1, 2 or 4; a terminal that has any has a mailbox.
    pub parameters: Vec<(ObjectAddress, usize)>,
}

/// What a terminal with firmware can be synchronised by.
const DC_MODES: &[(&str, u16)] = &[("FreeRun", 0), ("DcSync", 0x0300)];
/// Where a terminal's outputs lie, and its inputs where the buffers of the outputs leave that free.
const OUTPUTS: u16 = 0x1800;
const INPUTS: u16 = 0x1C00;
/// Buffers of a direction.
const BUFFERS: u16 = 3;

/// A terminal with these PDOs; one without any has no process data.
pub fn terminal(terminal: &Terminal, piece: &Piece) -> Result<Generic, ImageTooShort> {
    let Terminal { name, vendor_id, product_code, revision, outputs, inputs, parameters } = terminal;
    let mailbox = (!parameters.is_empty()).then_some(Mailbox {
        area: MAILBOX,
        protocols: sii::PROTOCOL_COE,
        bootstrap: MailboxArea::default(),
        coe_details: sii::COE_SDO | sii::COE_PDO_ASSIGN,
    });
    let mut process_data = Vec::new();
    let [output_bytes, input_bytes] = [outputs, inputs].map(|pdos| bytes(pdos));
    let inputs_at =
        INPUTS.max(OUTPUTS.saturating_add(output_bytes.saturating_mul(BUFFERS)).next_multiple_of(8));
    for (direction, pdos, start, control, max_bytes) in [
        (Direction::Outputs, outputs, OUTPUTS, 0x64, output_bytes),
        (Direction::Inputs, inputs, inputs_at, 0x20, input_bytes),
    ] {
        if !pdos.is_empty() {
            let number = if mailbox.is_some() { 2 } else { 0 } + process_data.len() as u8;
            process_data.push(ProcessSyncManager {
                number,
                direction,
                start,
                control,
                max_bytes,
                listed_bytes: 0,
                activation: SmActivation::SafeOp,
            });
        }
    }
    let pdos: Vec<PdoMap> = outputs.iter().chain(inputs).cloned().collect();
    let identity = Identity {
        vendor_id: *vendor_id,
        product_code: *product_code,
        revision: *revision,
        serial: piece.serial,
    };
    let sii = image(name, identity, &process_data, &pdos, piece, mailbox);
    Generic::with_objects(&sii, piece, parameters::objects(parameters))
}

/// Bytes of a direction; more than any chip has memory for where they are more than a number holds.
fn bytes(pdos: &[PdoMap]) -> u16 {
    let bits: usize = pdos.iter().flat_map(|pdo| &pdo.entries).map(|(_, bits)| usize::from(*bits)).sum();
    u16::try_from(bits.div_ceil(8)).unwrap_or(u16::MAX)
}

fn image(
    name: &str,
    identity: Identity,
    process_data: &[ProcessSyncManager],
    pdos: &[PdoMap],
    piece: &Piece,
    mailbox: Option<Mailbox>,
) -> Vec<u8> {
    emit(&ImagePlan {
        pdi_control: if mailbox.is_some() { PDI_WITH_FIRMWARE } else { PDI_DIGITAL_IO },
        identity,
        alias: piece.alias,
        group: "Digital I/O",
        order: name,
        name,
        ports: PORT_EBUS | PORT_EBUS << 4,
        flags: piece.identification.map_or(0, |_| sii::FLAG_IDENT_AL_STATUS),
        mailbox,
        process_data,
        pdos,
        dictionary: None,
        dc_modes: if mailbox.is_some() { DC_MODES } else { &[] },
    })
}

fn identity(product_code: u32, piece: &Piece) -> Identity {
    Identity { vendor_id: SERVO_VENDOR, product_code, revision: 1, serial: piece.serial }
}
