//! Another program answers at the page's address: what it asks is its own, though it has the number of the question before.

use super::relay::Relay;
use super::{BMM, ROOT, answer, browser, go_on_with_servos, open, say, seen, set_up, until};
use omnibase_setup::{AliasWrite, Record};
use std::path::Path;
use std::time::Duration;

/// The line leads to another program while an answer to the first one waits to be said: the page shows the other's question and keeps
/// that answer for itself. Then a button has an EEPROM forgotten that is gone.
#[test]
fn another_program_asks_its_own_question_and_hears_no_answer_to_the_one_before() {
    let Some(mut page) = browser(1000, 800) else { return };
    let folder = tempfile::tempdir().unwrap();
    let segment = format!("sim:{ROOT}/segments/three-servos.toml");
    let output = |alias: u16| folder.path().join(format!("{alias}.toml"));
    let begun = |alias: u16| {
        let writing = Some(AliasWrite { position: 7, alias, ..AliasWrite::default() });
        let record = Record { writing, ..Record::default() };
        std::fs::write(output(alias).with_extension("state.json"), record.to_json()).unwrap();
        set_up(Path::new(BMM), &segment, &output(alias), &[])
    };
    let kept = |alias: u16| {
        let text = std::fs::read_to_string(output(alias).with_extension("state.json")).unwrap();
        Record::from_json(&text).unwrap()
    };
    let is_asked = |alias: u16| {
        format!(
            "!document.getElementById('question').hidden && document.getElementById('asked').textContent.includes('alias {alias} was being written')"
        )
    };
    let (first, at) = begun(11_111);
    let relay = Relay::start(&at);
    open(&mut page, &relay.at);
    page.wait(&is_asked(11_111));
    let number = seen(&mut page)["number"].clone();
    // A line that takes nothing.
    page.value("void (window.send = WebSocket.prototype.send, WebSocket.prototype.send = () => {})");
    say(&mut page, "gone");
    let (mut second, at) = begun(22_222);
    relay.lead(&at);
    drop(first);
    page.value("void (WebSocket.prototype.send = window.send)");
    page.wait(&is_asked(22_222));
    assert_eq!(seen(&mut page)["number"], number);
    // Answers are said again twice a second.
    std::thread::sleep(Duration::from_millis(1500));
    assert!(page.value(&is_asked(22_222)) == true, "{}", seen(&mut page));
    assert!(kept(22_222).writing.is_some(), "nobody said that to this one");

    answer(&mut page, "gone");
    go_on_with_servos(&mut page);
    page.click("#leave");
    until(&mut page, "it is left", |seen| !seen["over"].is_null());
    assert_eq!(second.0.wait().unwrap().code(), Some(1));
    let told = std::fs::read_to_string(output(22_222).with_extension("record.md")).unwrap();
    assert!(told.contains("alias 22222 was being written (SubDevice 7 then) isn't on the bus"), "{told}");
    assert_eq!(kept(22_222).writing, None);
    assert!(kept(11_111).writing.is_some());
}
