//! The page for everybody: by keyboard, by eye in both themes, by ear, and with words for what can't be done now.

use serde_json::json;

use super::browser::Browser;
use super::robot::Robot;
use super::{HIT, browser, opened, press, until};

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

/// What doesn't find its room, also with the longest age of what was seen: a page that is wider than its window, numbers and words of
/// buttons in two lines or cut off, text on top of other text.
const SQUEEZED: &str = "(() => {
    document.documentElement.style.setProperty('--age', '\"up to 1234.5 s old\"');
    const found = [], told = (element) => `${element.tagName}.${element.className} '${element.textContent.trim().slice(0, 30)}'`;
    const wide = document.documentElement.scrollWidth - innerWidth;
    if (wide > 0) found.push(`the page is ${wide} px too wide`);
    for (const slider of document.querySelectorAll('input[type=range]')) if (slider.checkVisibility() && slider.clientWidth < 60) found.push(`a slider of ${slider.clientWidth} px`);
    for (const table of document.querySelectorAll('section table')) if (table.checkVisibility() && table.getBoundingClientRect().right > table.parentElement.getBoundingClientRect().right - 8) found.push(`${told(table)} leaves its section`);
    const texts = [];
    for (const element of document.querySelectorAll('body *')) {
        const nodes = [...element.childNodes].filter((node) => node.nodeType === 3 && node.data.trim());
        if (!nodes.length || !element.checkVisibility() || element.closest('option, details:not([open]) > :not(summary)')) continue;
        const range = document.createRange();
        range.setStartBefore(nodes[0]);
        range.setEndAfter(nodes.at(-1));
        const boxes = [...range.getClientRects()].filter((box) => box.width > 1 && box.height > 1);
        const lines = new Set(boxes.map((box) => Math.round(box.top / 4)));
        if (element.matches('td:not(:first-child, #drives :nth-child(2)), th, button:not(.stop), .badge, .pose dd') && lines.size > 1) found.push(`${told(element)} in ${lines.size} lines`);
        if (element.matches('td, th, button, .badge') && element.scrollWidth > element.clientWidth + 1 && element.clientWidth) found.push(`${told(element)} is cut off`);
        // What scrolls, or is cut with dots, shows what fits.
        if (!element.closest('select, .events ol, .who, .line, .stop')) boxes.forEach((box) => texts.push([element, box]));
    }
    texts.forEach(([one, a], n) => texts.slice(n + 1).forEach(([other, b]) => {
        const across = Math.min(a.right, b.right) - Math.max(a.left, b.left), down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (!one.contains(other) && !other.contains(one) && across > 2 && down > 4) found.push(`${told(one)} under ${told(other)}`);
    }));
    return [...new Set(found)];
})()";

/// Windows: a desk's, a phone's, and the narrowest phone's.
const WINDOWS: [(&str, u32, u32); 3] =
    [("desktop", 1400, 1000), ("phone-390", 390, 844), ("phone-320", 320, 640)];

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
fn text_has_contrast_and_room_in_both_themes_every_window_and_every_state() {
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
        ("disconnected", ""),
    ];
    for (number, (state, change)) in states.into_iter().enumerate() {
        // The page has drawn it, with times as a long run has them.
        let time_s = format!("{}", 1000 + number);
        page.change(&format!(
            "{change} seen.time_s = {time_s} + 1e-5 * (window.ticks = (window.ticks ?? 0) + 1); for (const one of Object.values(seen.timing)) if (one) one.worst_time_s = 12345.67;"
        ));
        page.wait(&format!("document.getElementById('pose').textContent.includes('{time_s}.0 s')"));
        if state == "disconnected" {
            page.swallow();
            page.wait("document.body.classList.contains('old')");
        }
        for (window, width, height) in WINDOWS {
            page.resize(width, height);
            for name in ["light", "dark"] {
                theme(&mut page, name);
                assert_eq!(page.value(PALE), json!([]), "{state}, {window}, {name}");
                assert_eq!(page.value(SQUEEZED), json!([]), "{state}, {window}, {name}");
                let parts = [
                    ("", "document.getElementById('phase')"),
                    ("-below", "document.getElementById('drives')"),
                ];
                for (part, at) in parts.into_iter().filter(|_| Browser::are_pictures_kept()) {
                    page.value(&format!("void {at}.scrollIntoView({{ block: 'center' }})"));
                    if state != "disconnected" {
                        page.wait("!document.body.classList.contains('old')");
                    }
                    page.picture(&format!("{}-{window}-{name}{part}", state.replace(' ', "-")));
                }
                page.value("scrollTo(0, 0)");
            }
        }
    }
    page.value("void (document.getElementById('counts').style.color = '#777')");
    assert_eq!(page.value(PALE).as_array().unwrap().len(), 1, "what is pale is found");
    page.value("void (document.getElementById('counts').style.marginTop = '-1.5rem')");
    assert_ne!(page.value(SQUEEZED), json!([]), "what lies on other text is found");
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
