use super::standard::{self, Mapping, PdoMap};
use super::*;
use omnibase_ethercat_wire::coe::ObjectAddress as At;

fn dictionary() -> Dictionary {
    Dictionary::new(vec![
        Object::variable(
            0x6040,
            Entry::unsigned16(0, "Controlword", 0).with_access(Access::READ_WRITE | Access::RX_PDO),
        ),
        Object::variable(
            0x607A,
            Entry::integer32(0, "Target", -5).with_access(Access::READ_WRITE | Access::RX_PDO),
        ),
        Object::variable(
            0x6060,
            Entry::integer8(0, "Mode", 0).with_access(Access::READ_WRITE).with_limits(-1, 10),
        ),
        Object::variable(
            0x2000,
            Entry::text(0, "Note", "abc").with_access(Access::READ_WRITE).with_capacity(8),
        ),
        Object::variable(0x2001, Entry::unsigned32(0, "Secret", 7).with_access(Access::WRITE)),
        Object::record(
            0x7000,
            "Channels",
            DataType::RECORD,
            vec![
                Entry::bits(1, "Bit", DataType::BOOLEAN, 1).with_access(Access::READ_WRITE | Access::RX_PDO),
                Entry::bits(2, "Three", DataType(0x32), 3).with_access(Access::READ_WRITE | Access::RX_PDO),
                Entry::unsigned16(3, "Word", 0x1234).with_access(Access::READ_WRITE),
            ],
        ),
        standard::mapping(
            &PdoMap {
                index: 0x1600,
                name: "Rx".into(),
                entries: vec![(At::new(0x6040, 0), 16), (At::new(0, 0), 8), (At::new(0x607A, 0), 32)],
            },
            Mapping::Configurable,
        ),
        standard::assignment(2, &[0x1600], Mapping::Configurable),
    ])
}

#[test]
fn rights_lengths_and_ranges_have_their_abort_codes() {
    let d = dictionary();
    let state = AlState::PreOp;
    let write = |index, data: &[u8]| d.check_write(At::new(index, 0), data, state);
    assert_eq!(d.read(At::new(0x5000, 0), state), Err(AbortCode::NO_SUCH_OBJECT));
    assert_eq!(d.read(At::new(0x6040, 1), state), Err(AbortCode::NO_SUCH_SUBINDEX));
    assert_eq!(d.read(At::new(0x2001, 0), state), Err(AbortCode::WRITE_ONLY));
    assert_eq!(write(0x6040, &[1]), Err(AbortCode::TOO_SHORT));
    assert_eq!(write(0x6040, &[1, 2, 3]), Err(AbortCode::TOO_LONG));
    assert_eq!(write(0x6060, &[11]), Err(AbortCode::VALUE_TOO_HIGH));
    assert_eq!(write(0x6060, &[0xFE]), Err(AbortCode::VALUE_TOO_LOW));
    assert_eq!(write(0x6060, &[0xFF]), Ok(()));
    assert_eq!(d.check_write(At::new(0x7000, 1), &[2], state), Err(AbortCode::VALUE_RANGE));
    assert_eq!(d.check_write(At::new(0x7000, 0), &[2], state), Err(AbortCode::READ_ONLY));
    assert_eq!(d.check_write(At::new(0x1600, 0), &[0], AlState::Op), Err(AbortCode::DEVICE_STATE));
}

#[test]
fn strings_have_any_length_up_to_their_capacity_and_return_to_their_default() {
    let mut d = dictionary();
    let at = At::new(0x2000, 0);
    assert_eq!(d.peek(at), Some(&b"abc"[..]));
    assert_eq!(d.check_write(at, &[b'x'; 9], AlState::PreOp), Err(AbortCode::TOO_LONG));
    d.store(at, b"longer");
    assert_eq!(d.peek(at), Some(&b"longer"[..]));
    d.restore_defaults();
    assert_eq!(d.peek(at), Some(&b"abc"[..]));
}

#[test]
fn complete_access_pads_subindex_0_and_packs_bits() {
    let mut d = dictionary();
    d.store(At::new(0x7000, 1), &[1]);
    d.store(At::new(0x7000, 2), &[0b101]);
    let bytes = d.read_complete(0x7000, FirstSubindex::Zero, AlState::PreOp).unwrap();
    // 1 | 101 << 1 = 0b1011, then 0x1234 from bit 4 on.
    assert_eq!(bytes, [3, 0, 0x4B, 0x23, 0x01]);
    assert_eq!(d.read_complete(0x7000, FirstSubindex::One, AlState::PreOp).unwrap(), bytes[2..]);
    let parts = d.split_complete(0x7000, FirstSubindex::Zero, AlState::PreOp, &bytes).unwrap();
    assert_eq!(parts.len(), 3);
    assert_eq!(parts[1], (At::new(0x7000, 2), vec![0b101]));
    assert_eq!(parts[2], (At::new(0x7000, 3), vec![0x34, 0x12]));
    let split = |data: &[u8]| d.split_complete(0x7000, FirstSubindex::Zero, AlState::PreOp, data).map(|_| ());
    assert_eq!(split(&bytes[..4]), Err(AbortCode::TOO_SHORT));
    assert_eq!(split(&[3, 0, 0, 0, 0, 0]), Err(AbortCode::TOO_LONG));
    assert_eq!(split(&[2, 0, 0, 0, 0]), Err(AbortCode::READ_ONLY));
    let at = |index| d.read_complete(index, FirstSubindex::Zero, AlState::PreOp);
    assert_eq!(at(0x6040), Err(AbortCode::UNSUPPORTED_ACCESS));
    assert_eq!(at(0x1600).unwrap(), [3, 0, 0x10, 0, 0x40, 0x60, 8, 0, 0, 0, 0x20, 0, 0x7A, 0x60]);
}

#[test]
fn a_mapping_is_written_only_while_it_is_empty_and_only_with_objects_that_fit() {
    let mut d = dictionary();
    let entry = At::new(0x1600, 1);
    let mapped = |value: u32| value.to_le_bytes();
    let check = |d: &Dictionary, at, data: &[u8]| pdo::check_write(d, at, data, 100);
    assert_eq!(check(&d, entry, &mapped(0x6040_0010)), Err(AbortCode::SUBINDEX_ZERO_FIRST));
    d.store(At::new(0x1600, 0), &[0]);
    assert_eq!(check(&d, entry, &mapped(0x6040_0010)), Ok(()));
    assert_eq!(check(&d, entry, &mapped(0x6040_0020)), Err(AbortCode::NOT_MAPPABLE));
    assert_eq!(check(&d, entry, &mapped(0x6060_0008)), Err(AbortCode::NOT_MAPPABLE));
    assert_eq!(check(&d, entry, &mapped(0x5FFF_0008)), Err(AbortCode::NO_SUCH_OBJECT));
    assert_eq!(check(&d, entry, &mapped(0x6040_0110)), Err(AbortCode::NO_SUCH_SUBINDEX));
    assert_eq!(pdo::check_write(&d, At::new(0x1600, 0), &[3], 6), Err(AbortCode::PDO_LENGTH));
    assert_eq!(check(&d, At::new(0x1600, 0), &[33]), Err(AbortCode::VALUE_TOO_HIGH));
    assert_eq!(check(&d, At::new(0x1600, 0), &[3]), Ok(()));
    d.store(At::new(0x1C12, 0), &[0]);
    assert_eq!(check(&d, At::new(0x1C12, 1), &[0, 0x17]), Err(AbortCode::NOT_MAPPABLE));
    assert_eq!(check(&d, At::new(0x1C12, 1), &[0, 0x16]), Ok(()));
}

#[test]
fn a_layout_moves_values_both_ways_and_leaves_gaps_alone() {
    let mut d = dictionary();
    let layout = pdo::layout(&d, 0x1C12, pdo::Direction::Outputs).unwrap();
    assert_eq!((layout.bits, layout.copies.len()), (56, 2));
    layout.take(&[0x0F, 0x00, 0xAA, 0xFE, 0xFF, 0xFF, 0xFF], &mut d);
    let control: Field<u16> = d.field(0x6040, 0).unwrap();
    let target: Field<i32> = d.field(0x607A, 0).unwrap();
    assert_eq!((d.get(control), d.get(target)), (0x0F, -2));
    let mut image = [0x55; 7];
    layout.put(&d, &mut image);
    assert_eq!(image, [0x0F, 0x00, 0x55, 0xFE, 0xFF, 0xFF, 0xFF]);
    assert!(d.field::<u32>(0x607A, 0).is_none(), "the type is checked");
    assert_eq!(
        pdo::layout(&d, 0x1C12, pdo::Direction::Inputs).unwrap_err().at,
        At::new(0x1C12, 1),
        "an RxPDO doesn't belong into the inputs"
    );
}
