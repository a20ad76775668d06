//! The EEPROM interface.

use crate::bench::{Bench, idle};
use omnibase_ethercat_sim::{EscConfig, Fault};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::sii::checksum;

/// An image of 256 bytes: configuration area with checksum, then byte n = n.
fn image() -> Vec<u8> {
    let mut image: Vec<u8> = (0..=255).collect();
    image[..14].copy_from_slice(&[0x05, 0x00, 0x44, 0xEE, 0x64, 0, 0, 0, 0xBC, 0x0A, 0, 0, 0, 0]);
    image[14] = checksum(image.first_chunk().unwrap());
    image[15] = 0;
    // Size: 2 KiBit, which is 256 bytes.
    image[0x7C..0x7E].copy_from_slice(&[1, 0]);
    image
}

fn bench() -> Bench {
    Bench::single(EscConfig { sii: image(), ..EscConfig::default() }, idle())
}

fn command(bench: &mut Bench, control: u16, word: u32) -> u16 {
    let ([a, b], [c, d, e, f]) = (control.to_le_bytes(), word.to_le_bytes());
    bench.fpwr(0x1001, reg::SII_CONTROL, &[a, b, c, d, e, f])
}

fn status(bench: &mut Bench) -> u64 {
    bench.number_at(0x1001, reg::SII_CONTROL, 2)
}

#[test]
fn a_read_is_busy_for_its_time_and_then_gives_eight_bytes() {
    let mut bench = bench();
    assert_eq!(status(&mut bench), 0x0040);
    assert_eq!(command(&mut bench, 0x0100, 0x10), 1);
    assert_eq!(status(&mut bench), 0x8140);
    assert_eq!(command(&mut bench, 0x0100, 0x20), 0, "busy: nothing can be written");
    bench.wait_us(50);
    assert_eq!(status(&mut bench), 0x0140);
    assert_eq!(bench.number_at(0x1001, reg::SII_DATA, 8), 0x2726_2524_2322_2120);
    assert_eq!(bench.number_at(0x1001, reg::SII_ADDRESS, 4), 0x10);
    // Behind its end the EEPROM reads as erased.
    command(&mut bench, 0x0100, 0x7F);
    bench.wait_us(50);
    assert_eq!(bench.number_at(0x1001, reg::SII_DATA, 8), 0xFFFF_FFFF_FFFF_FFFE);
}

#[test]
fn a_write_needs_its_enable_bit() {
    let mut bench = bench();
    bench.fpwr(0x1001, reg::SII_DATA, &[0xCD, 0xAB]);
    command(&mut bench, 0x0200, 0x40);
    assert_eq!(status(&mut bench), 0x4240);
    command(&mut bench, 0x0000, 0x40);
    assert_eq!(status(&mut bench), 0x0040);
    command(&mut bench, 0x0201, 0x40);
    assert_eq!(status(&mut bench), 0x8240);
    bench.wait_us(1000);
    assert_eq!(status(&mut bench), 0x0240);
    assert_eq!(bench.segment.sub_devices()[0].esc().sii_image()[0x80..0x82], [0xCD, 0xAB]);
    command(&mut bench, 0x0201, 0x8000);
    assert_eq!(status(&mut bench), 0x2240, "no such word: not acknowledged");
    command(&mut bench, 0x0600, 0x40);
    assert_eq!(status(&mut bench), 0x2640, "no such command");
}

#[test]
fn the_configuration_area_is_loaded_at_power_on_and_reload_keeps_the_alias() {
    let mut bench = bench();
    assert_eq!(bench.number_at(0x1001, reg::PDI_CONTROL, 2), 0x0005);
    assert_eq!(bench.number_at(0x1001, 0x0150, 2), 0xEE44);
    assert_eq!(bench.number_at(0x1001, reg::DC_PULSE_LENGTH, 2), 0x0064);
    assert_eq!(bench.number_at(0x1001, reg::STATION_ALIAS, 2), 0x0ABC);
    assert_eq!(bench.number_at(0x1001, reg::DL_STATUS, 2) & 1, 1);
    // Another alias, and its checksum.
    let mut area: [u8; 14] = *image().first_chunk().unwrap();
    area[8] = 0xBD;
    for (word, data) in [(4, [0xBD, 0x0A]), (7, [checksum(&area), 0])] {
        bench.fpwr(0x1001, reg::SII_DATA, &data);
        command(&mut bench, 0x0201, word);
        bench.wait_us(1000);
    }
    command(&mut bench, 0x0400, 0);
    bench.wait_us(50);
    assert_eq!(status(&mut bench), 0x0440);
    assert_eq!(bench.number_at(0x1001, reg::STATION_ALIAS, 2), 0x0ABC);
    bench.segment.inject(0, Fault::PowerOff).unwrap();
    bench.segment.inject(0, Fault::PowerOn).unwrap();
    bench.number(1);
    assert_eq!(bench.number_at(0x1001, reg::STATION_ALIAS, 2), 0x0ABD);
}

#[test]
fn a_wrong_checksum_and_a_missing_eeprom_are_told() {
    let mut sii = image();
    sii[14] ^= 1;
    let mut bench = Bench::single(EscConfig { sii, ..EscConfig::default() }, idle());
    assert_eq!(status(&mut bench), 0x1840);
    assert_eq!(bench.number_at(0x1001, reg::DL_STATUS, 2) & 1, 0);
    assert_eq!(bench.number_at(0x1001, reg::STATION_ALIAS, 2), 0);
    command(&mut bench, 0x0100, 0x10);
    bench.wait_us(50);
    assert_eq!(bench.number_at(0x1001, reg::SII_DATA, 2), 0x2120, "it can be read all the same");

    let mut bench = Bench::single(EscConfig::default(), idle());
    assert_eq!(status(&mut bench), 0x1040);
    command(&mut bench, 0x0100, 0);
    assert_eq!(status(&mut bench), 0x3140);
}

#[test]
fn one_side_owns_the_eeprom() {
    let mut bench = bench();
    bench.pdi_write(reg::SII_PDI_ACCESS, &[1]);
    assert_eq!(bench.pdi_read(reg::SII_PDI_ACCESS, 1), [0], "not offered yet");
    bench.pdi_write(reg::SII_CONTROL, &[0x00, 0x01]);
    assert_eq!(status(&mut bench), 0x0040);
    assert_eq!(bench.fpwr(0x1001, reg::SII_CONFIG, &[1]), 1);
    bench.pdi_write(reg::SII_PDI_ACCESS, &[1]);
    assert_eq!(command(&mut bench, 0x0100, 0x10), 0);
    bench.pdi_write(reg::SII_CONTROL, &[0x00, 0x01, 0x10, 0, 0, 0]);
    assert_eq!(status(&mut bench), 0x8140);
    bench.wait_us(50);
    assert_eq!(bench.pdi_read(reg::SII_DATA, 2), [0x20, 0x21]);
    // The MainDevice takes it back by force.
    assert_eq!(bench.fpwr(0x1001, reg::SII_CONFIG, &[2]), 1);
    assert_eq!(bench.fpwr(0x1001, reg::SII_CONFIG, &[0]), 1);
    assert_eq!(bench.number_at(0x1001, reg::SII_PDI_ACCESS, 1), 0);
    assert_eq!(command(&mut bench, 0x0100, 0x10), 1);
}
