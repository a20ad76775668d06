//! An alias whose writing broke off is finished on the page.

use super::{answer, browser, go_on_with_servos, open, seen, set_up, simulated, unknown, until};
use omnibase_ethercat::wire::{HostTime, Link, LinkError, sii};
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_host::{MonotonicClock, Namespace, PacketSocket};
use serde_json::{Value, json};
use std::cell::Cell;
use std::path::Path;
use std::rc::Rc;

/// A link that is cut after so many frames.
struct Cut {
    link: PacketSocket,
    left: Rc<Cell<u32>>,
}

impl Link for Cut {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let Some(left) = self.left.get().checked_sub(1) else { return Ok(()) };
        self.left.set(left);
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}

/// Half of an alias stands in an EEPROM: the page asks by two buttons what shall become of it, makes it whole, and goes on.
#[test]
fn half_an_alias_is_made_whole_by_a_button() {
    const ALIAS: u16 = 77;
    let Some(namespace) = Namespace::for_test("half_an_alias_is_made_whole_by_a_button") else { return };
    namespace.run(|| {
        let Some(mut page) = browser(1000, 800) else { return };
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("mine.toml");
        let base = folder.path().join("base.toml");
        std::fs::write(&base, unknown::BASE.replace("cycle_us = 1000", "cycle_us = 4000")).unwrap();
        let segment = format!("{}/segments/three-servos.toml", super::ROOT);
        let _simulator = simulated(Path::new(&segment), &[]);
        let left = Rc::new(Cell::new(u32::MAX));
        let bus = || {
            let link = Cut { link: PacketSocket::open(Namespace::NEAR).unwrap(), left: Rc::clone(&left) };
            let mut bus = Bus::new(link, MonotonicClock, BusOptions::default());
            // A busy machine gives the simulator its time late.
            assert!((0..20).any(|_| bus.scan().is_ok()), "nobody answers");
            bus
        };
        let begins = {
            let mut bus = bus();
            let before = bus.read_sii(1).unwrap();
            let after = bus.sii_with_alias(1, ALIAS).unwrap().unwrap();
            // On a busy machine frames come too late, and are sent again: cut off where half of it stands there.
            let is_half = (1..).take(200).any(|frames| {
                left.set(frames);
                let _ = bus.write_sii(1, &before, &after);
                left.set(u32::MAX);
                let head = bus.read_sii(1).unwrap()[..sii::HEADER].to_vec();
                let is_whole = head == after[..sii::HEADER];
                if is_whole {
                    bus.write_sii(1, &after, &before).unwrap();
                }
                !is_whole && head != before[..sii::HEADER]
            });
            assert!(is_half);
            before[..sii::HEADER].to_vec()
        };
        let state = output.with_extension("state.json");
        let writing = json!({ "position": 1, "alias": ALIAS, "begins": begins });
        let record = json!({ "done": [], "drives": [], "findings": [], "log": [], "writing": writing });
        std::fs::write(&state, record.to_string()).unwrap();

        let (process, at) = set_up(&base, Namespace::NEAR, &output, &["--realtime"]);
        open(&mut page, &at);
        until(&mut page, "what broke off is asked", |seen| seen["asked"] == "finish 1");
        for choice in ["the rest", "as before"] {
            let button = format!("Boolean(document.querySelector('[data-choice=\"{choice}\"]'))");
            assert!(page.value(&button) == true, "{choice}: {}", seen(&mut page));
        }
        answer(&mut page, "the rest");
        go_on_with_servos(&mut page);
        let record: Value = serde_json::from_str(&std::fs::read_to_string(&state).unwrap()).unwrap();
        assert!(record["writing"].is_null(), "{record}");
        assert!(record["log"].to_string().contains("alias 77 written into its EEPROM"), "{record}");
        drop(process);
        let found = bus().read_sii(1).unwrap();
        assert_eq!(u16::from_le_bytes([found[8], found[9]]), ALIAS);
    });
}
