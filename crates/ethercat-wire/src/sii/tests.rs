use super::*;
use proptest::prelude::*;

/// Where recordings of real devices lie, beside the repository.
fn capture(name: &str) -> Option<Vec<u8>> {
    let path = format!("{}/../../../shared/captures/{name}", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).ok();
    if bytes.is_none() {
        eprintln!("SKIPPED: {path} is not there");
    }
    bytes
}

#[test]
fn more_pdos_than_one_category_holds_are_written_in_several() {
    let pdo = |number: u16| Pdo {
        index: 0x1A00 + number,
        sync_manager: Some(3),
        synchronization: 0,
        name: 0,
        flags: 0,
        entries: vec![
            PdoEntry {
                object: ObjectAddress::new(0x6000, 1),
                name: 0,
                data_type: 5,
                bit_length: 8,
                flags: 0
            };
            255
        ],
    };
    let mut image = Image { tx_pdos: (0..100).map(pdo).collect(), ..Image::default() };
    image.header.raw = image.header.bytes();
    let (read, problems) = Image::parse(&image.emit()).unwrap();
    assert_eq!(read.tx_pdos.len(), 100);
    assert_eq!(read.tx_pdos, image.tx_pdos);
    assert!(problems.iter().all(|problem| problem.text.contains("checksum")), "{problems:?}");
}

#[test]
fn real_images_are_read_without_a_problem_and_written_back_without_loss() {
    for (name, device, tx, rx) in [
        ("ek1100-sii.bin", "EK1100", 0, 0),
        ("el2828-sii.bin", "EL2828", 0, 8),
        ("el2889-sii.bin", "EL2889", 0, 16),
        ("akd-sii.bin", "AKD", 12, 12),
    ] {
        let Some(bytes) = capture(name) else { continue };
        let (image, problems) = Image::parse(&bytes).unwrap();
        assert_eq!(problems, [], "{name}");
        assert!(image.name().unwrap().contains(device), "{name}: {:?}", image.name());
        assert_eq!((image.tx_pdos.len(), image.rx_pdos.len()), (tx, rx), "{name}");
        let written = image.emit();
        assert_eq!(written.len(), bytes.len(), "{name}");
        assert_eq!(Image::parse(&written).unwrap(), (image, vec![]), "{name}: written back it differs");
    }
}

#[test]
fn a_broken_string_table_costs_the_strings_alone() {
    let Some(bytes) = capture("akd-broken-strings-sii.bin") else { return };
    let (image, problems) = Image::parse(&bytes).unwrap();
    assert!(!problems.is_empty());
    assert_eq!(image.header.identity.vendor_id, 0x6A);
}

#[test]
fn too_short_is_an_error_and_a_missing_end_is_named() {
    assert_eq!(Image::parse(&[0; 127]), Err(ImageTooShort { found: 127 }));
    let (_, problems) = Image::parse(&[0xFF; 128]).unwrap();
    assert!(problems.iter().any(|problem| problem.offset == 128 && problem.text.contains("end category")));
}

#[test]
fn a_category_that_lies_about_its_size_is_bounded_and_named() {
    let mut bytes = Image::default().emit();
    bytes.truncate(HEADER);
    bytes.extend_from_slice(&[41, 0, 0xFF, 0x7F, 0, 0x10, 0x80, 0, 0x26, 0, 1, 1, 0xAA]);
    let (image, problems) = Image::parse(&bytes).unwrap();
    assert_eq!(image.sync_managers.len(), 1);
    assert!(problems.iter().any(|problem| problem.text.contains("category 41 announces")), "{problems:?}");
    assert!(problems.iter().all(|problem| problem.offset < bytes.len()), "{problems:?}");
}

#[test]
fn the_checksum_is_that_of_the_standard() {
    let Some(bytes) = capture("ek1100-sii.bin") else { return };
    let words: [u8; 14] = bytes[..14].try_into().unwrap();
    assert_eq!(checksum(&words), bytes[14]);
}

fn images() -> impl Strategy<Value = Image> {
    let strings = prop::collection::vec(prop::collection::vec(any::<u8>(), 0..40), 0..6);
    let fmmus = prop::collection::vec(any::<u8>().prop_map(FmmuUsage::from_code), 0..4)
        .prop_filter("whole words", |fmmus| fmmus.len() % 2 == 0);
    let sync_managers = prop::collection::vec(any::<[u8; 8]>(), 0..5);
    let entries = prop::collection::vec(any::<(u16, u8, u8, u8, u8, u16)>(), 0..9);
    let pdos = prop::collection::vec((any::<(u16, Option<u8>, u8, u8, u16)>(), entries), 0..4);
    let header = any::<(u32, u32, u32, u32, u16)>();
    let other = prop::collection::vec((100u16..0x7FFF, prop::collection::vec(any::<[u8; 2]>(), 0..9)), 0..3);
    (header, strings, fmmus, sync_managers, pdos, other).prop_map(
        |(header, strings, fmmus, sync_managers, pdos, other)| {
            let mut image = Image { strings, fmmus, ..Image::default() };
            let identity = &mut image.header.identity;
            (
                identity.vendor_id,
                identity.product_code,
                identity.revision,
                identity.serial,
                image.header.alias,
            ) = header;
            image.header.checksum = u16::from(image.header.computed_checksum());
            image.header.raw = image.header.bytes();
            image.general = Some(General { name: 1, coe_details: 0x2D, ..General::default() });
            image.sync_managers = sync_managers
                .iter()
                .map(|b| SyncManager {
                    start: u16::from_le_bytes([b[0], b[1]]),
                    length: u16::from_le_bytes([b[2], b[3]]),
                    control: b[4],
                    status: b[5],
                    enable: b[6],
                    usage: SyncManagerUsage::from_code(b[7]),
                })
                .collect();
            image.tx_pdos = pdos
                .iter()
                .map(|((index, sync_manager, synchronization, name, flags), entries)| Pdo {
                    index: *index,
                    sync_manager: sync_manager.filter(|number| *number != 0xFF),
                    synchronization: *synchronization,
                    name: *name,
                    flags: *flags,
                    entries: entries
                        .iter()
                        .map(|(index, subindex, name, data_type, bit_length, flags)| PdoEntry {
                            object: ObjectAddress::new(*index, *subindex),
                            name: *name,
                            data_type: *data_type,
                            bit_length: *bit_length,
                            flags: *flags,
                        })
                        .collect(),
                })
                .collect();
            image.other =
                other.into_iter().map(|(kind, words)| OtherCategory { kind, data: words.concat() }).collect();
            image
        },
    )
}

proptest! {
    #[test]
    fn what_is_written_is_read_back(image in images()) {
        let (read, problems) = Image::parse(&image.emit()).unwrap();
        prop_assert_eq!(problems, []);
        prop_assert_eq!(read, image);
    }

    #[test]
    fn any_bytes_are_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        let _ = Image::parse(&bytes);
    }

    #[test]
    fn any_categories_are_read_without_a_panic(
        bytes in prop::collection::vec(prop_oneof![4 => Just(0u8), 3 => 8u8..64, 1 => any::<u8>()], 128..600),
    ) {
        let _ = Image::parse(&bytes);
    }
}
