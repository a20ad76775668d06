//! A recorded start-up of real devices, played against simulated chips: the same working counters must come back.

use crate::bench::idle;
use omnibase_ethercat_sim::{Attachment, DcRegisters, EscConfig, Parent, Segment, SubDevice};
use omnibase_ethercat_wire::bytes::u32_at;
use omnibase_ethercat_wire::frame::{Datagrams, PROCESSED_BIT};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, HostTime};
use std::path::PathBuf;

/// Time stamps (ns) and bytes of the packets of a pcapng file with one little-endian section.
fn packets(file: &[u8]) -> Vec<(u64, Vec<u8>)> {
    let (mut at, mut packets) = (0, Vec::new());
    while at + 12 <= file.len() {
        let (kind, length) = (u32_at(file, at), u32_at(file, at + 4) as usize);
        if kind == 6 {
            let time = u64::from(u32_at(file, at + 12)) << 32 | u64::from(u32_at(file, at + 16));
            let captured = u32_at(file, at + 20) as usize;
            packets.push((time, file[at + 28..at + 28 + captured].to_vec()));
        }
        at += length;
    }
    packets
}

/// EK1100 (ET1100), EL2828 and EL2889 (ET1200) as the recording shows them.
fn segment(image: impl Fn(&str) -> Vec<u8>) -> Segment {
    let coupler = EscConfig {
        build: 2,
        port_descriptor: 0x2F,
        features: 0x00FC,
        sii: image("ek1100-sii.bin"),
        dc_offset_ns: 1_000_000_000_000,
        ..EscConfig::default()
    };
    let terminal = |features, dc_registers, name| EscConfig {
        esc_type: 0x12,
        fmmu_count: 3,
        sm_count: 4,
        ram_kib: 1,
        port_descriptor: 0x0A,
        features,
        dc_registers,
        sii: image(name),
        ..EscConfig::default()
    };
    let devices = [
        coupler,
        terminal(0x01FC, DcRegisters::ReceiveTimesOnly, "el2828-sii.bin"),
        terminal(0x00FC, DcRegisters::Full, "el2889-sii.bin"),
    ];
    let attachments = (0..3)
        .map(|n: usize| Attachment {
            parent: match n.checked_sub(1) {
                None => Parent::MainDevice,
                Some(position) => Parent::SubDevice { position, port: 1 },
            },
            entry_port: 0,
            cable_delay_ns: 10,
        })
        .collect();
    Segment::new(devices.map(|config| SubDevice::new(config, idle())).into(), attachments).unwrap()
}

#[test]
fn a_recorded_start_up_gets_the_recorded_working_counters() {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/captures"));
    let Ok(recording) = std::fs::read(folder.join("replay-dc.pcapng")) else {
        eprintln!("SKIPPED: no recordings in {}", folder.display());
        return;
    };
    let mut segment = segment(|name| std::fs::read(folder.join(name)).unwrap());
    let packets = packets(&recording);
    let begin = packets[0].0;
    let (mut answered, mut sii_words) = (0, 0);
    let mut waiting: Vec<Vec<u8>> = Vec::new();
    for (number, (time, packet)) in packets.iter().enumerate() {
        if packet[6] & PROCESSED_BIT == 0 {
            let mut frame = packet.clone();
            let back = segment.process(&mut frame, HostTime(1_000_000 + time - begin));
            assert!(back.is_some(), "packet {}", number + 1);
            waiting.push(frame);
            continue;
        }
        let index = packet[17];
        let ours = waiting.iter().position(|frame| frame[17] == index).expect("a request came before");
        let ours = waiting.remove(ours);
        answered += 1;
        let pairs = Datagrams::new(&ours).unwrap().zip(Datagrams::new(packet).unwrap());
        for (ours, real) in pairs.map(|(ours, real)| (ours.unwrap(), real.unwrap())) {
            let place = format!("packet {}: {:?}", number + 1, real.header.target());
            assert_eq!(ours.header, real.header, "{place}");
            assert_eq!(ours.working_counter, real.working_counter, "{place}");
            let Some(Address::Station { register, .. }) = real.header.target() else { continue };
            match register {
                reg::SII_DATA => {
                    assert_eq!(ours.data, real.data, "{place}");
                    sii_words += ours.data.len() / 2;
                }
                reg::FEATURES | reg::STATION_ALIAS | reg::AL_STATUS => {
                    assert_eq!(ours.data, real.data, "{place}")
                }
                // All but the PDI watchdog, which isn't simulated.
                reg::DL_STATUS => {
                    assert_eq!((ours.data[0] | 2, ours.data[1]), (real.data[0] | 2, real.data[1]), "{place}")
                }
                _ => {}
            }
        }
    }
    assert!(answered > 1500 && sii_words > 100, "{answered} answers, {sii_words} words of SII");
}
