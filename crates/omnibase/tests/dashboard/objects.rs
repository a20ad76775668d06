//! The SubDevices' own objects, browsed on the page while the robot runs.

use super::browser::Browser;
use super::robot::Robot;
use super::{HIT, browser, opened, until};

/// Opens the list of objects, anew where it was open.
const OPEN: &str = "void [false, true].map((open) => (document.getElementById('objects').open = open))";
/// Chooses a SubDevice, anew where it was chosen.
const CHOOSE: &str = "void document.querySelector('#objects select').dispatchEvent(new Event('change'))";

fn object(index: &str) -> String {
    format!("document.querySelector('[data-object=\"{index}\"]')")
}

/// Whether an object's entry says what this expression wants, once it is opened; not where it was refused.
fn says(page: &mut Browser, index: &str, entry: usize, wanted: &str) -> bool {
    let object = object(index);
    page.is_true_within(&object, HIT)
        && page.value(&format!("Boolean({object}.open = true)")) == true
        && page.is_true_within(
            &format!("{wanted}.test({object}.querySelectorAll('li')[{entry}]?.textContent)"),
            HIT,
        )
}

#[test]
fn objects_are_browsed_with_names_types_and_values() {
    let robot = Robot::start(&[]);
    let Some(mut page) = browser(1600, 1000) else { return };
    page.open(&robot.url());
    opened(&mut page);
    // What a busy machine asks too late is refused, as it shall be, and asked again.
    until(&mut page, "three SubDevices are there", |page| {
        page.value(OPEN);
        page.is_true_within("document.querySelectorAll('#objects option').length === 3", HIT)
    });
    let name = object("1008");
    until(&mut page, "its objects have names, types and values", |page| {
        page.value(CHOOSE);
        page.is_true_within(&format!("{name}?.textContent.length > 5"), HIT)
            && says(page, "1008", 0, "/^1008:00 r- .*string = \".+\"$/")
            && says(page, "1018", 1, "/^1018:01 r- .*u32 = \\d+$/")
            // Where something is allowed in some states only, they stand there.
            && says(page, "1600", 1, "/^1600:01 rw .* u32 \\(written in PRE-OP only\\) = \\d+$/")
    });
    // Closed and opened while it is asked for, an object has each entry once.
    let identity = object("1018");
    until(&mut page, "each entry stands there once", |page| {
        page.value(&format!(
            "[true, false, true].reduce((before, open) => before.then(() => new Promise((go) => {{ {identity}.open = open; \
             setTimeout(() => go(true), 5); }})), Promise.resolve())"
        ));
        page.is_true_within(&format!("{identity}.querySelectorAll('li').length === 5"), HIT)
            && page.value(&format!("{identity}.querySelectorAll('li')[4].textContent.startsWith('1018:04')"))
                == true
    });
    // Another SubDevice, and its own objects.
    page.value("void (document.querySelector('#objects select').selectedIndex = 2)");
    until(&mut page, "so has another one", |page| {
        page.value(CHOOSE);
        page.is_true_within(&format!("{name}?.textContent.length > 5 && !{name}.open"), HIT)
    });
    // A hole is what the SubDevice itself refuses; whatever else went wrong is said.
    let entry = |data: &str| {
        format!(
            "import('./objects.js').then(({{ Objects }}) => Objects.prototype.entry.call({{ ask: async () => \
             ({{ done: false, text: 'SubDevice 1 is away', data: {data} }}) }}, 1, '1018:01'))"
        )
    };
    assert_eq!(page.value(&entry("undefined")), "1018:01 SubDevice 1 is away");
    assert!(page.value(&entry("{ refused_by_subdevice: true }")).is_null());
    // Text that isn't UTF-8 is shown as its bytes.
    let text = "import('./objects.js').then(({ Objects }) => Objects.prototype.entry.call({ ask: async ({ do: what }) => \
                ({ done: true, data: what === 'sdo_type' ? { name: 'n', data_type: 9, bit_length: 16, access: 7 } : { data: '47f6' } }) }, \
                1, '1008:00'))";
    assert_eq!(page.value(text), "1008:00 r- n string = 47f6");
}
