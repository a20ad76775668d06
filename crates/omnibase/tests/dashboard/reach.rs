//! The page for everybody: by keyboard, by eye in both themes, by ear, and with words for what can't be done now.

use serde_json::json;

use crate::browser::Browser;
use crate::robot::Robot;
use crate::{HIT, browser, opened, press, until};

const BMM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
const HOLDS: &str = "document.getElementById('phase').textContent === 'holding'";

/// Text of too little contrast with what is behind it (WCAG 2.1, success criterion 1.4.3, level AA): what, how much.
/// Buttons that can't act are excepted there.
const PALE: &str = "(() => {
    const parts = (colour) => (colour.match(/[\\d.]+/g) ?? []).map(Number);
    const linear = (part) => ((part /= 255), part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4);
    const luminance = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
    const over = ([r, g, b, a = 1], below) => [r, g, b].map((part, n) => part * a + below[n] * (1 - a));
    const behind = (element) => {
        if (!element) return [255, 255, 255];
        const colour = parts(getComputedStyle(element).backgroundColor);
        return colour[3] === 0 ? behind(element.parentElement) : over(colour, behind(element.parentElement));
    };
    const found = [];
    for (const element of document.querySelectorAll('body *')) {
        const text = [...element.childNodes].filter((node) => node.nodeType === 3).map((node) => node.data.trim()).join('');
        const style = getComputedStyle(element);
        if (!text || !element.checkVisibility() || element.closest(':disabled, option, .off')) continue;
        const [size, weight] = [parseFloat(style.fontSize), Number(style.fontWeight)];
        const needed = size >= 24 || (size >= 18.66 && weight >= 700) ? 3 : 4.5;
        const back = behind(element);
        const [light, dark] = [luminance(over(parts(style.color), back)), luminance(back)].sort((a, b) => b - a);
        const ratio = (light + 0.05) / (dark + 0.05);
        if (ratio < needed) found.push(`${element.tagName}.${element.className} '${text.slice(0, 30)}': ${ratio.toFixed(2)} of ${needed}`);
    }
    return found;
})()";

fn theme(page: &mut Browser, name: &str) {
    let features = json!([{ "name": "prefers-color-scheme", "value": name }]);
    page.ask("Emulation.setEmulatedMedia", json!({ "features": features }));
}

fn key(page: &mut Browser, what: &str, key: &str) {
    page.ask("Input.dispatchKeyEvent", json!({ "type": what, "key": key, "code": key }));
}

/// Holds a key at a stick until that brings something. On a busy machine the stick may be lost meanwhile, as it shall be; then it is
/// enabled and taken again.
fn held(page: &mut Browser, stick: &str, name: &str, mut brings: impl FnMut(&mut Browser) -> bool) {
    until(page, stick, |page| {
        if page.value("document.getElementById('enable-stick').hidden") == json!(false) {
            press(page, "#enable-stick", "document.getElementById('enable-stick').hidden");
        }
        page.value(&format!("document.getElementById('{stick}').focus()"));
        key(page, "keyUp", name);
        key(page, "keyDown", name);
        brings(page)
    });
}

#[test]
fn text_has_contrast_in_both_themes_and_every_state() {
    let Some(mut page) = browser(1400, 1000) else { return };
    let robot = Robot::start(&[]);
    page.tamper();
    page.open(&robot.url());
    opened(&mut page);
    let states = [
        ("disabled", ""),
        ("holding", "seen.phase = 'holding';"),
        ("tracking", "seen.phase = 'tracking'; seen.commander = 'page 2'; seen.by_stick = true;"),
        ("stopping", "seen.phase = 'stopping';"),
        (
            "fault",
            "seen.phase = 'fault'; seen.stop_reason = 'a drive failed'; seen.drives[0].error = 'over-current';",
        ),
        ("emergency", "seen.emergency_stop = true;"),
        ("joystick blocked", "seen.joystick = 'blocked';"),
        ("joystick lost", "seen.joystick = 'lost';"),
    ];
    for (state, change) in states {
        // The page has drawn it.
        let time_s = format!("{}", 1000 + states.iter().position(|(name, _)| *name == state).unwrap());
        page.change(&format!("{change} seen.time_s = {time_s};"));
        page.wait(&format!("document.getElementById('pose').textContent.includes('{time_s}.0 s')"));
        for name in ["light", "dark"] {
            theme(&mut page, name);
            assert_eq!(page.value(PALE), json!([]), "{state}, {name}");
            page.picture(&format!("{}-{name}", state.replace(' ', "-")));
        }
    }
    page.value("void (document.getElementById('counts').style.color = '#777')");
    assert_eq!(page.value(PALE).as_array().unwrap().len(), 1, "what is pale is found");
}

#[test]
fn the_stick_is_held_by_arrow_keys_and_let_go_with_them() {
    let Some(mut page) = browser(1400, 1000) else { return };
    let robot = Robot::start(&[]);
    page.open(&robot.url());
    opened(&mut page);
    press(&mut page, "[data-do=enable]", HOLDS);
    held(&mut page, "stick", "ArrowUp", |_| {
        robot.is_true_within(|robot| robot.value("state/twist_in_body_x_m_s") > 0.1, HIT)
    });
    key(&mut page, "keyUp", "ArrowUp");
    robot.wait("it holds again", |robot| robot.speed_m_s() < 1e-3 && robot.read("now")["phase"] == "holding");
    // A window that loses the focus lets go.
    held(&mut page, "turn", "ArrowLeft", |page| {
        page.is_true_within("document.getElementById('turn').classList.contains('held')", HIT)
    });
    page.value("window.dispatchEvent(new Event('blur'))");
    page.wait("!document.getElementById('turn').classList.contains('held')");
}

#[test]
fn what_cannot_be_done_now_says_why_and_what_is_shown_is_read_at_a_glance() {
    let Some(mut page) = browser(1400, 1000) else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.toml");
    let text = std::fs::read_to_string(BMM).unwrap();
    std::fs::write(&file, text.replace("name = \"wheel_2\"", "name = \"left rear\"")).unwrap();
    let robot = Robot::start_file(file.to_str().unwrap(), &[]);
    page.tamper();
    page.open(&robot.url());
    opened(&mut page);
    let why = |name: &str| {
        format!(
            "(() => {{ const b = document.querySelector('.buttons [data-do={name}]'); return b.disabled ? b.title : ''; }})()"
        )
    };
    page.wait(&format!("{} === 'Enable the drives first.'", why("track")));
    assert_eq!(page.value(&why("enable")), "");
    assert_eq!(page.value(&why("acknowledge")), "There is no fault.");
    press(&mut page, "[data-do=enable]", HOLDS);
    page.wait(&format!("{} === 'The drives are enabled.'", why("enable")));
    assert_eq!(page.value(&why("resume")), "No path was left.");
    assert_eq!(page.value(&why("track")), "");
    // Drives by their names, angles within half a turn, and nothing without a sign.
    page.value("document.getElementById('plots').scrollIntoView()");
    let keys = "[...document.querySelectorAll('.plot .keys')].map((keys) => keys.textContent).join()";
    page.wait(&format!("{keys}.includes('left rear/speed_rad_s')"));
    assert!(!page.value(keys).as_str().unwrap().contains("wheel_2"));
    let columns = robot.read("robot")["columns"].clone();
    let column = |name: &str| columns.as_array().unwrap().iter().position(|known| known == name).unwrap();
    page.change(&format!(
        "seen.values[{}] = -0.00001; seen.values[{}] = {};",
        column("state/pose_x_m"),
        column("state/pose_heading_rad"),
        7.0 * std::f64::consts::FRAC_PI_2,
    ));
    let pose = "document.getElementById('pose').textContent";
    page.wait(&format!("{pose}.includes('heading-90.00°') && {pose}.includes('x0.0000 m')"));
    let label = "document.getElementById('view').getAttribute('aria-label')";
    page.wait(&format!(
        "{label} === 'Top view: the platform at x 0.0 m, y 0.0 m, heading -90°; 0 obstacles'"
    ));
}
