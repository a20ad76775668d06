//! The SubDevices' own objects, browsed on the page while the robot runs.

use super::robot::Robot;
use super::{browser, opened};

#[test]
fn objects_are_browsed_with_names_types_and_values() {
    let robot = Robot::start(&[]);
    let Some(mut page) = browser(1600, 1000) else { return };
    page.open(&robot.url());
    opened(&mut page);
    page.value("void (document.getElementById('objects').open = true)");
    page.wait("document.querySelectorAll('#objects option').length === 3");
    let name = "document.querySelector('[data-object=\"1008\"]')";
    page.wait(&format!("{name}?.textContent.length > 5"));
    page.value(&format!("void ({name}.open = true)"));
    page.wait(&format!("/^1008:00 r- .*string = \".+\"$/.test({name}.querySelector('li')?.textContent)"));
    page.wait("document.querySelector('[data-object=\"1018\"]')");
    page.value("void (document.querySelector('[data-object=\"1018\"]').open = true)");
    page.wait("/^1018:01 r- .*u32 = \\d+$/.test(document.querySelectorAll('[data-object=\"1018\"] li')[1]?.textContent)");
    // Where something is allowed in some states only, they stand there.
    page.wait("document.querySelector('[data-object=\"1600\"]')");
    page.value("void (document.querySelector('[data-object=\"1600\"]').open = true)");
    page.wait("/^1600:01 rw .* u32 \\(written in PRE-OP only\\) = \\d+$/.test(document.querySelectorAll('[data-object=\"1600\"] li')[1]?.textContent)");
    // Another SubDevice, and its own objects.
    page.value("void (document.querySelector('#objects select').selectedIndex = 2)");
    page.value("void document.querySelector('#objects select').dispatchEvent(new Event('change'))");
    page.wait(&format!("{name}?.textContent.length > 5 && !{name}.open"));
}
