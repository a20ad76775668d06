//! What is configured against what is there.

use omnibase_ethercat::config::{DcConfig, ExpectedIdentity};
use omnibase_ethercat::error::Mismatch;
use omnibase_ethercat::wire::sii::Identity;
use omnibase_ethercat::{Bus, BusOptions, Match, SetUpError, SubDeviceConfig, Warning};
use omnibase_ethercat_sim::{EscConfig, Segment, in_process};

use crate::segment::{obedient, sii_of};

/// Three SubDevices: products 1, 2, 3 of vendor 9; aliases 5, 7, 7; the last without a clock.
fn configure(configs: &[SubDeviceConfig]) -> Result<Vec<Warning>, SetUpError> {
    let devices = [(1, 5), (2, 7), (3, 7)].map(|(product_code, alias)| {
        let identity = Identity { vendor_id: 9, product_code, revision: 1, serial: 0 };
        let features = if product_code == 3 { 0 } else { EscConfig::default().features };
        obedient(EscConfig { sii: sii_of(identity, alias), features, ..EscConfig::default() })
    });
    let (link, clock) = in_process(Segment::line(devices.into()).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan()?;
    bus.configure(configs)?;
    Ok(bus.warnings().to_vec())
}

fn product(product_code: u32) -> SubDeviceConfig {
    let identity = ExpectedIdentity { product_code: Some(product_code), ..ExpectedIdentity::default() };
    SubDeviceConfig { identity, ..SubDeviceConfig::default() }
}

fn at(place: Match, product_code: u32) -> SubDeviceConfig {
    SubDeviceConfig { place: Some(place), ..product(product_code) }
}

fn refusal(configs: &[SubDeviceConfig]) -> (Mismatch, String) {
    match configure(configs) {
        Err(SetUpError::Mismatch(mismatch)) => (mismatch.clone(), mismatch.to_string()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_right_ones_are_taken_in_any_order() {
    let warnings = configure(&[product(1), product(2), product(3)]).unwrap();
    assert_eq!(warnings, [Warning::DuplicateAlias { alias: 7, positions: vec![1, 2] }]);
    configure(&[at(Match::Position(2), 3), at(Match::Alias(5), 1), at(Match::Position(1), 2)]).unwrap();
    configure(&[]).unwrap();
}

#[test]
fn swapped_devices_are_named_with_where_the_expected_one_is() {
    let (mismatch, text) = refusal(&[product(1), product(3), product(2)]);
    assert!(matches!(mismatch, Mismatch::Identity { position: 1, elsewhere: Some(2), .. }));
    assert_eq!(
        text,
        "SubDevice 1: expected product 0x00000003 but found 0x00000002, the expected device is at position 2"
    );
}

#[test]
fn a_missing_and_a_surplus_device_are_named() {
    let mut fourth = product(4);
    fourth.name = Some("wheel 4".into());
    let (_, text) = refusal(&[product(1), product(2), product(3), fourth]);
    assert_eq!(text, "4 SubDevices are configured, 3 are there: SubDevice 3 (wheel 4) is missing");
    let (_, text) = refusal(&[product(1), product(2)]);
    assert!(text.starts_with("2 SubDevices are configured, 3 are there: SubDevice 2 ("), "{text}");
    assert!(text.ends_with("vendor 0x00000009, product 0x00000003) has no configuration"), "{text}");
}

#[test]
fn aliases_and_positions_that_fit_nobody_are_named() {
    let others = [product(2), product(3)];
    let with = |first: SubDeviceConfig| refusal(&[first, others[0].clone(), others[1].clone()]).0;
    assert_eq!(
        with(at(Match::Alias(6), 1)),
        Mismatch::NoSuchAlias { alias: 6, found: vec![5, 7, 7], name: None }
    );
    let both = Mismatch::AmbiguousAlias { alias: 7, positions: vec![1, 2] };
    assert_eq!(with(at(Match::Alias(7), 2)), both);
    let none = Mismatch::NoSuchPosition { position: 9, count: 3, name: None };
    assert_eq!(with(at(Match::Position(9), 1)), none);
    assert_eq!(with(at(Match::Position(1), 2)), Mismatch::ConfiguredTwice { position: 1 });
}

#[test]
fn sync_without_a_clock_is_refused() {
    let mut third = product(3);
    third.dc = DcConfig::Sync0 { cycle_ns: 1_000_000, shift_ns: 0 };
    let (mismatch, _) = refusal(&[product(1), product(2), third]);
    assert_eq!(mismatch, Mismatch::NoClock { position: 2, name: None });
}
