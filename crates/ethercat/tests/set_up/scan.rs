//! Finding SubDevices on the simulated bus.

use crate::segment::{Seldom, obedient, recorded_sii, sii_of, with_eeprom};
use omnibase_ethercat::config::SubDeviceConfig;
use omnibase_ethercat::wire::sii::Identity;
use omnibase_ethercat::wire::{AlState, Clock, HostTime, register, sii};
use omnibase_ethercat::{Bus, BusOptions, SetUpError, Warning};
use omnibase_ethercat_sim::{Attachment, EscConfig, Parent, Segment, SegmentFile, SubDevice, in_process};
use std::path::Path;
use std::time::Duration;

#[test]
fn a_line_of_recorded_devices_is_found_and_named() {
    let names = ["ek1100-sii.bin", "el2828-sii.bin", "el2889-sii.bin", "akd-sii.bin"];
    let Some(images) = names.map(recorded_sii).into_iter().collect::<Option<Vec<_>>>() else { return };
    let devices = images.iter().map(|sii| obedient(EscConfig { sii: sii.clone(), ..EscConfig::default() }));
    let (link, clock) = in_process(Segment::line(devices.collect()).unwrap());
    let mut bus = Bus::new(link, clock.clone(), BusOptions::default());
    let found: Vec<_> = bus.scan().unwrap().iter().map(|one| (one.name.clone(), one.parent)).collect();
    println!("{found:?} after {:?}", clock.now());
    assert_eq!(bus.warnings(), []);
    assert_eq!(bus.read_sii(3).unwrap(), images[3]);
}

#[test]
fn an_empty_segment_says_why() {
    let (link, clock) = in_process(Segment::line(vec![]).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    let error = bus.scan().unwrap_err();
    println!("{error}");
    assert!(matches!(error, SetUpError::NoSubDevices(_)));
}

#[test]
fn a_thousand_subdevices_are_found() {
    let Some(sii) = recorded_sii("el2828-sii.bin") else { return };
    let devices = (0..1000).map(|_| obedient(EscConfig { sii: sii.clone(), ..EscConfig::default() }));
    let (link, clock) = in_process(Segment::line(devices.collect()).unwrap());
    let mut bus = Bus::new(link, clock.clone(), BusOptions::default());
    assert_eq!(bus.scan().unwrap().len(), 1000);
    println!("scanned at {:?}", clock.now());
    bus.configure(&[]).unwrap();
    println!("PRE-OP at {:?}", clock.now());
    assert!(clock.now() < HostTime(60_000_000_000));
    println!("{:?}", bus.transactor().counters);
}

#[test]
fn one_whose_in_and_out_are_swapped_is_named() {
    let scan = |segment: Segment| {
        let (link, clock) = in_process(segment);
        let mut bus = Bus::new(link, clock, BusOptions::default());
        let found = bus.scan().map(|found| found.len());
        (found.map_err(|error| error.to_string()), format!("{:?}", bus.warnings()))
    };
    // In the middle of a line ports don't make a tree.
    let line = |swapped: usize, last: &str| {
        let one = |n: usize| {
            let entry = if n == swapped { "entry_port = 1\n" } else { "" };
            format!("[[subdevice]]\nkind = \"servo\"\nalias = {}\n{entry}", n + 1)
        };
        let text = (0..4).map(one).collect::<String>() + last;
        scan(SegmentFile::parse(&text).unwrap().build(Path::new(".")).unwrap())
    };
    let (named, _) = line(1, "");
    let named = named.unwrap_err();
    assert!(named.contains("SubDevice 3 (alias 2): frames reach its port 1 before its port 0"), "{named}");
    let first = line(0, "").0.unwrap_err();
    assert!(first.contains("SubDevice 3 (alias 1)"), "behind all that hang on it: {first}");
    // At the end it makes no other order, which is said.
    let (last, warnings) = line(3, "");
    assert_eq!(last, Ok(4));
    assert!(warnings.contains("EntersAtPort { position: 3, port: 1 }"), "{warnings}");
    // In a fork ports make a tree, and it isn't the one that is there.
    let at = |position, port, entry_port| Attachment {
        parent: Parent::SubDevice { position, port },
        entry_port,
        cable_delay_ns: 100,
    };
    let root = Attachment { parent: Parent::MainDevice, entry_port: 0, cable_delay_ns: 100 };
    let fork = |clocks: bool| {
        let features = if clocks { EscConfig::default().features } else { 0 };
        let devices = (0..4).map(|_| obedient(EscConfig { features, ..EscConfig::default() })).collect();
        Segment::new(devices, vec![root, at(2, 0, 0), at(0, 1, 1), at(0, 2, 0)]).unwrap()
    };
    let named = scan(fork(true)).0.unwrap_err();
    assert!(named.contains("SubDevice 2: frames reach its port 1 before its port 0"), "{named}");
    // Nobody's clock tells: it is taken for the tree that ports make.
    assert_eq!(scan(fork(false)).0, Ok(4));
}

#[test]
fn one_whose_processor_reads_nothing_is_named() {
    use omnibase_ethercat_sim::Fault;
    use omnibase_ethercat_sim::pdi::ApplicationFault;
    let text = "[[subdevice]]\nkind = \"servo\"\ncount = 3\n";
    let mut segment = SegmentFile::parse(text).unwrap().build(Path::new(".")).unwrap();
    segment.inject(1, Fault::from(ApplicationFault::Frozen(true))).unwrap();
    let (link, clock) = in_process(segment);
    let error = Bus::new(link, clock, BusOptions::default()).scan().map(<[_]>::len).unwrap_err();
    assert_eq!(error, SetUpError::NoFirmware { position: 1 });
    assert!(error.to_string().contains("its firmware hangs or is missing"), "{error}");
}

/// A processor that looks for requests only ten times a second has firmware, and reaches every state.
#[test]
fn one_whose_processor_looks_seldom_is_waited_for() {
    let every = Duration::from_millis(100);
    let devices = (0..3).map(|number| {
        let identity = sii::Identity { vendor_id: 5, product_code: 6, revision: 7, serial: number };
        let config = EscConfig { sii: sii_of(identity, 0), ..EscConfig::default() };
        match number {
            1 => SubDevice::new(config, Box::new(Seldom { every, next: HostTime(0) })),
            _ => obedient(config),
        }
    });
    let (link, clock) = in_process(Segment::line(devices.collect()).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    for _ in 0..2 {
        assert_eq!(bus.scan().map(<[_]>::len), Ok(3));
        assert_eq!(bus.configure(&[]), Ok(()));
        assert_eq!(bus.request_state(&[1], AlState::SafeOp), Ok(()));
    }
}

/// Behind a chip that didn't load its EEPROM nobody hears a second request: the device is there all the same.
#[test]
fn one_whose_eeprom_was_not_loaded_is_found() {
    use omnibase_ethercat_sim::Fault;
    use omnibase_ethercat_sim::pdi::ApplicationFault;
    let mut segment = Segment::line(vec![with_eeprom(Vec::new())]).unwrap();
    segment.inject(0, Fault::from(ApplicationFault::Frozen(true))).unwrap();
    let (link, clock) = in_process(segment);
    let mut bus = Bus::new(link, clock, BusOptions::default());
    for _ in 0..2 {
        assert_eq!(bus.scan().map(<[_]>::len), Ok(1));
    }
    assert!(bus.subdevices()[0].broken.is_some());
}

/// A fork: 0 has 1 at port 3, 2 at port 1 (3 behind it, without clock; 4 behind that), 5 at port 2.
#[test]
fn delays_and_parents_in_a_tree_are_the_true_ones() {
    let hangs_on = [None, Some((0, 3)), Some((0, 1)), Some((2, 1)), Some((3, 1)), Some((0, 2))];
    let cables_ns = [100, 50, 250, 70, 110, 30];
    let devices = (0..6).map(|n| {
        let features = if n == 3 { 0 } else { EscConfig::default().features };
        obedient(EscConfig { features, dc_offset_ns: n * 1_000_000_007, ..EscConfig::default() })
    });
    let attachments = hangs_on.iter().zip(cables_ns).map(|(parent, cable_delay_ns)| {
        let parent = match *parent {
            None => Parent::MainDevice,
            Some((position, port)) => Parent::SubDevice { position, port },
        };
        Attachment { parent, entry_port: 0, cable_delay_ns }
    });
    let segment = Segment::new(devices.collect(), attachments.collect()).unwrap();
    let (link, clock) = in_process(segment);
    let mut bus = Bus::new(link, clock.clone(), BusOptions::default());
    bus.scan().unwrap();
    bus.configure(&[]).unwrap();
    let parents = bus.subdevices().iter().map(|one| one.parent.map(|p| (usize::from(p.position), p.port)));
    assert_eq!(parents.collect::<Vec<_>>(), hangs_on);
    // 300 ns through each SubDevice, and the cables on the way, those of branches passed before twice.
    let to_1 = 300 + 50;
    let to_2 = 2 * to_1 + 300 + 250;
    let to_4 = to_2 + 300 + 70 + 300 + 110;
    let back_from_2 = 2 * (to_4 - to_2) + 300 + 250;
    let to_5 = to_2 + back_from_2 + 300 + 30;
    let delays = bus.subdevices().iter().map(|one| one.dc.map(|dc| dc.delay_ns));
    let expected = [Some(0), Some(to_1), Some(to_2), None, Some(to_4), Some(to_5)];
    assert_eq!(delays.collect::<Vec<_>>(), expected);
    // Nothing drifts here: all clocks show the same from now on, whatever they showed at power-on.
    let now = clock.now();
    let times = bus.transactor().link.segment().sub_devices().iter().map(|one| one.esc().system_time(now));
    let times: Vec<_> = times.flatten().map(|time| time.0).collect();
    assert!(times.iter().all(|time| *time == times[0]), "{times:?}");
    let apart = times[0].abs_diff(now.0);
    assert!(apart < 100_000, "system time is {apart} ns from the host's");
}

/// Nobody knows what it is, whatever its processor would do: who wants all is refused, who does without it has the others.
#[test]
fn one_whose_eeprom_cant_be_known_stays_out_of_everything() {
    let spoiled = {
        let mut image = sii_of(Identity::default(), 0);
        image[14] ^= 0xFF;
        image
    };
    let cases = [
        (Vec::new(), "its EEPROM can't be read (word 0x0000: "),
        (vec![0xFF; 256], "its EEPROM is erased: write its maker's image"),
        (spoiled, "the checksum of its EEPROM is wrong"),
    ];
    for (image, cause) in cases {
        let devices = vec![obedient(EscConfig::default()), with_eeprom(image)];
        let (link, clock) = in_process(Segment::line(devices).unwrap());
        let mut bus = Bus::new(link, clock, BusOptions::default());
        assert_eq!(bus.scan().unwrap().len(), 2);
        let other = SubDeviceConfig::default();
        let both = [other.clone(), SubDeviceConfig::default()];
        for configs in [&[][..], &[other], &both] {
            let refused = bus.configure(configs).unwrap_err().to_string();
            assert!(refused.starts_with(&format!("SubDevice 1 can't be used: {cause}")), "{refused}");
        }
        assert_eq!(bus.configure_sound(), Ok(()));
        let states = bus.transactor().link.segment().sub_devices().iter();
        let states: Vec<_> = states.map(|one| one.esc().peek(register::AL_STATUS, 2).unwrap()[0]).collect();
        assert_eq!(states, [2, 1], "{cause}");
    }
}

#[test]
fn a_dead_eeprom_is_a_warning() {
    let (link, clock) = in_process(Segment::line(vec![with_eeprom(Vec::new())]).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    assert_eq!(bus.scan().unwrap().len(), 1);
    assert!(matches!(bus.warnings(), [Warning::NoEeprom(_)]), "{:?}", bus.warnings());
}
