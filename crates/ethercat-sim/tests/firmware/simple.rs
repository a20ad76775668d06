//! Devices without firmware and devices from images: their terminals follow the frames.

use crate::rig::{FIRST, Rig, fmmu, sync_manager};
use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::generic::Generic;
use omnibase_ethercat_sim::device::simple::{DigitalIo, coupler, digital_io};
use omnibase_ethercat_sim::segment_file::line_of_images;
use omnibase_ethercat_sim::{Attachment, Parent, Segment};
use omnibase_ethercat_wire::coe::ObjectAddress as At;
use omnibase_ethercat_wire::sii::{FmmuUsage, Image};
use omnibase_ethercat_wire::{Address, Command};
use std::path::Path;

fn captured(name: &str) -> Option<Vec<u8>> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/captures"));
    let image = std::fs::read(folder.join(name)).ok();
    if image.is_none() {
        eprintln!("SKIPPED: {} has no {name}", folder.display());
    }
    image
}

/// An FMMU for some bits of a byte.
fn bits(logical: u32, first: u8, last: u8, physical: u16, kind: u8) -> [u8; 16] {
    let mut registers = fmmu(logical, 1, physical, kind);
    (registers[6], registers[7]) = (first, last);
    registers
}

#[test]
fn digital_io_exchanges_bits_that_dont_fill_bytes() {
    let Generic { sub_device, panel, .. } =
        digital_io(DigitalIo { inputs: 3, outputs: 5 }, &Piece::default()).unwrap();
    let mut rig = Rig::of(sub_device);
    rig.write(FIRST, 0x0800, &sync_manager(0x1000, 1, 0x64));
    rig.write(FIRST, 0x0808, &sync_manager(0x1100, 1, 0x20));
    // Outputs in bits 0 to 4 and inputs in bits 5 to 7 of one logical byte.
    rig.write(FIRST, 0x0600, &bits(0x100, 0, 4, 0x1000, 2));
    rig.write(FIRST, 0x0610, &bits(0x100, 5, 7, 0x1100, 1));
    for state in [2, 4, 8] {
        assert_eq!(rig.request(FIRST, state), (state, 0));
    }
    assert!(panel.set_input(At::new(0x6000, 2), 1));
    rig.wait_us(300);
    let (data, counter) = rig.send(Command::Lrw, Address::Logical(0x100), &[0b1_0011]);
    assert_eq!((data[0], counter), (0b0101_0011, 3), "bit 2 of the inputs is bit 6 of the byte");
    rig.wait_us(300);
    let outputs: Vec<u64> = (1..=5).map(|bit| panel.output(At::new(0x7000, bit)).unwrap()).collect();
    assert_eq!(outputs, [1, 1, 0, 0, 1]);
    assert_eq!(panel.output(At::new(0x7000, 6)), None);
    assert!(!panel.set_input(At::new(0x6000, 4), 1));
    assert_eq!(rig.request(FIRST, 4), (4, 0));
    rig.wait_us(300);
    assert_eq!(panel.output(At::new(0x7000, 1)), Some(0), "outputs are safe outside of OP");
    assert_eq!(rig.request(FIRST, 2), (2, 0));
}

#[test]
fn a_coupler_is_there_and_has_nothing_to_say() {
    let piece = Piece { alias: 7, serial: 99, ..Piece::default() };
    let mut rig = Rig::of(coupler(&piece).unwrap().sub_device);
    assert_eq!(rig.word(FIRST, 0x0012), 7);
    for control in [2, 4, 8, 0x18, 1, 0x11, 0x31] {
        rig.write(FIRST, 0x0120, &u16::to_le_bytes(control));
        rig.wait_us(10);
        assert_eq!(rig.state(FIRST), (control & 0x1F, 0), "the acknowledge bit comes back too");
    }
    let image = Image::parse(rig.segment.sub_devices()[0].esc().sii_image()).unwrap();
    assert_eq!(image.1, []);
    assert_eq!((image.0.name().as_deref(), image.0.header.identity.serial), (Some("Coupler"), 99));
}

#[test]
fn generated_images_read_back_without_a_problem() {
    use omnibase_ethercat_sim::device::axis::Load;
    use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
    for (kind, vendor, product, name) in [
        (DriveKind::Generic, 0x0F0F, 0x0402, "CiA402-Servo"),
        (DriveKind::Sgdv, 0x0539, 0x0220_0001, "SGDV-OCA01A"),
    ] {
        let sub_device = Drive::new(kind).build(&Piece { alias: 5, ..Piece::default() }, Load::default());
        let (image, problems) = Image::parse(sub_device.esc().sii_image()).unwrap();
        assert_eq!(problems, []);
        assert_eq!((image.header.identity.vendor_id, image.header.identity.product_code), (vendor, product));
        assert_eq!((image.name().as_deref(), image.header.alias), (Some(name), 5));
        assert_eq!(image.fmmus[..3], [FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxState]);
        let controls: Vec<u8> = image.sync_managers.iter().map(|sm| sm.control).collect();
        assert_eq!(controls, [0x26, 0x22, 0x64, 0x20]);
        let lengths = (image.rx_pdos[0].bit_length(), image.tx_pdos[0].bit_length());
        assert_eq!(lengths, if kind == DriveKind::Sgdv { (160, 160) } else { (128, 128) });
        assert_eq!(u32::from(image.sync_managers[2].length) * 8, lengths.0);
        assert_eq!(image.string(image.rx_pdos[0].entries[0].name).as_deref(), Some("Controlword"));
        assert_eq!(image.dc_modes[1].assign_activate, 0x0300);
        let features = sub_device.esc().config().features;
        assert_eq!(features & 0x0600, if kind == DriveKind::Sgdv { 0x0600 } else { 0 });
    }
}

#[test]
fn an_ek1100_with_an_el2828_switches_its_outputs() {
    let (Some(ek1100), Some(el2828)) = (captured("ek1100-sii.bin"), captured("el2828-sii.bin")) else {
        return;
    };
    let coupler = Generic::from_sii(&ek1100, &Piece::default()).unwrap();
    let terminal = Generic::from_sii(&el2828, &Piece::default()).unwrap();
    let panel = terminal.panel.clone();
    let attachments = vec![
        Attachment { parent: Parent::MainDevice, entry_port: 0, cable_delay_ns: 100 },
        Attachment { parent: Parent::SubDevice { position: 0, port: 1 }, entry_port: 0, cable_delay_ns: 0 },
    ];
    let segment = Segment::new(vec![coupler.sub_device, terminal.sub_device], attachments).unwrap();
    let mut rig = Rig::new(segment);
    let station = FIRST + 1;
    rig.write(station, 0x0800, &sync_manager(0x0F00, 1, 0x44));
    rig.write(station, 0x0600, &fmmu(0x100, 1, 0x0F00, 2));
    for state in [2, 4, 8] {
        assert_eq!(rig.request(station, state), (state, 0));
    }
    assert_eq!(rig.send(Command::Lwr, Address::Logical(0x100), &[0xA5]).1, 1);
    rig.wait_us(300);
    let lit: Vec<u64> = panel.outputs().map(|object| panel.output(object).unwrap()).collect();
    assert_eq!(lit, [1, 0, 1, 0, 0, 1, 0, 1]);
    assert_eq!(rig.request(station, 1), (1, 0));
}

#[test]
fn a_drive_from_its_image_alone_reaches_op() {
    let Some(image) = captured("akd-sii.bin") else { return };
    let (parsed, _) = Image::parse(&image).unwrap();
    let mut rig = Rig::new(line_of_images(&[image]).unwrap());
    for (number, sm) in (0u16..).zip(&parsed.sync_managers) {
        rig.write(FIRST, 0x0800 + 8 * number, &sync_manager(sm.start, sm.length, sm.control));
    }
    assert_eq!(rig.request(FIRST, 2), (2, 0));
    let bytes = |pdos: &[omnibase_ethercat_wire::sii::Pdo], sm| {
        let assigned = pdos.iter().filter(|pdo| pdo.sync_manager == Some(sm));
        assigned.map(|pdo| pdo.bit_length()).sum::<u32>().div_ceil(8) as u16
    };
    let (outputs, inputs) = (bytes(&parsed.rx_pdos, 2), bytes(&parsed.tx_pdos, 3));
    let [sm2, sm3] = [2, 3].map(|number: usize| parsed.sync_managers[number]);
    rig.rewrite(FIRST, 0x0810, &sync_manager(sm2.start, outputs, sm2.control));
    rig.rewrite(FIRST, 0x0818, &sync_manager(sm3.start, inputs, sm3.control));
    rig.write(FIRST, 0x0600, &fmmu(0x1_0000, outputs, sm2.start, 2));
    rig.write(FIRST, 0x0610, &fmmu(0x2_0000, inputs, sm3.start, 1));
    assert_eq!(rig.request(FIRST, 4), (4, 0));
    rig.outputs(FIRST, &vec![0; usize::from(outputs)]);
    assert_eq!(rig.request(FIRST, 8), (8, 0));
}
