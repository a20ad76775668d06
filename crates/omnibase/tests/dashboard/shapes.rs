//! Fence and walls drawn and changed on the page.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};

use super::browser::Browser;
use super::robot::Robot;
use super::screen::Screen;
use super::{HIT, browser, opened, until};

const FENCE: &str = "fence.rectangle_m=[-1.2, -1.2, 1.6, 1.2]";

/// Sizes of usual windows.
const WINDOWS: [(u32, u32); 7] =
    [(1920, 1080), (1600, 900), (1440, 900), (1366, 768), (1280, 720), (1024, 768), (360, 740)];

/// Buttons above the view that can't be clicked somewhere, or lie below the legend.
const COVERED: &str = "(() => {
    const legend = [...document.querySelectorAll('.legend > :not([hidden])')];
    const lies = (one, other) => one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
    return [...document.querySelectorAll('.tools button')].filter((button) => {
        button.scrollIntoView({ block: 'center', behavior: 'instant' });
        const box = button.getBoundingClientRect();
        const parts = [0.1, 0.3, 0.5, 0.7, 0.9];
        const isBelow = legend.some((key) => key.getBoundingClientRect().width > 0 && lies(key.getBoundingClientRect(), box));
        return isBelow || parts.some((x) => parts.some((y) =>
            document.elementFromPoint(box.left + x * box.width, box.top + y * box.height) !== button));
    }).map((button) => button.id);
})()";

/// Writes a number into a field of the bar, as by the keyboard.
fn write(page: &mut Browser, field: &str, value: f64) {
    page.value(&format!(
        "(() => {{ const field = document.getElementById('shape-bar').elements.{field}; field.focus(); \
         field.value = {value}; field.dispatchEvent(new Event('change', {{ bubbles: true }})); }})()"
    ));
}

fn fence(robot: &Robot) -> Value {
    robot.read("now")["fence"].clone()
}

/// Writes a map 4 m wide around odom's origin, all free but for a wall of 0.2 by 0.4 m; the name of its file.
fn map_with_a_wall(folder: &Path) -> PathBuf {
    let rows = (0..40).flat_map(|row| (0..40).map(move |column| (row, column)));
    let is_wall = |(row, column)| (18..22).contains(&row) && (5..7).contains(&column);
    let cells: Vec<u8> = rows.map(|at| if is_wall(at) { 0 } else { 254 }).collect();
    std::fs::write(folder.join("room.pgm"), [b"P5 40 40 255\n", &cells[..]].concat()).unwrap();
    let settings = "image: room.pgm\nresolution: 0.1\norigin: [-2.0, -2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let file = folder.join("room.yaml");
    std::fs::write(&file, settings).unwrap();
    file
}

/// What the view shows at a place of odom, in words of JavaScript: red, green, blue, and how opaque.
fn colour([x_m, y_m]: [f64; 2]) -> String {
    format!(
        "(() => {{ const view = document.getElementById('view'), {{ scale, centre_m }} = view.dataset, [x, y] = centre_m.split(' '); \
         const at = [view.width / 2 + ({x_m} - x) * scale, view.height / 2 - ({y_m} - y) * scale]; \
         return [...view.getContext('2d').getImageData(...at, 1, 1).data].join(); }})()"
    )
}

#[test]
fn a_fence_is_changed_by_mouse_and_keyboard_and_none_is_taken_that_leaves_the_robot_outside() {
    let Some(mut page) = browser(1400, 1000) else { return };
    let maps = tempfile::tempdir().unwrap();
    let map = format!("map.file={:?}", map_with_a_wall(maps.path()));
    let triangle = "map.blocked_m=[[[1.2,0.3],[1.5,0.3],[1.4,0.9]]]";
    let robot = Robot::start(&["--set", FENCE, "--set", triangle, "--set", &map]);
    page.open(&robot.url());
    opened(&mut page);
    // The map lies underneath, in the colour of walls, and nothing where its floor is free.
    let [wall, free] = [[-1.4, 0.1], [-1.4, 0.4]].map(colour);
    let grey = "(() => { const ink = new OffscreenCanvas(1, 1).getContext('2d'); \
        ink.fillStyle = getComputedStyle(document.documentElement).getPropertyValue('--line'); ink.fillRect(0, 0, 1, 1); \
        return [...ink.getImageData(0, 0, 1, 1).data].join(); })()";
    page.wait(&format!("{wall} === {grey}"));
    assert_eq!(page.value(&free), json!("0,0,0,0"));
    let screen = Screen::of(&mut page, &robot);
    // Words that come above the view while the mouse is on its way move the button.
    until(&mut page, "the fence is edited", |page| {
        page.click("#fence");
        page.is_true_within("!document.getElementById('shape-bar').hidden", HIT)
    });
    page.wait("document.getElementById('shape-bar').elements.corner.length === 4");
    // By the mouse: a corner is dragged, and a click on a side's middle makes another one. A page that hears its robot late says so
    // above the view, which moves by that: then it is dragged on from where it lies.
    // Words may also lie over the view for a moment: then nothing was dragged, or the view was.
    let (mut corner, goal) = ([1.6, 1.2], [1.4, 1.1]);
    until(&mut page, "the corner is dragged", |page| {
        let [from, to] = [corner, goal].map(|at| screen.place(page, at));
        page.mouse("mousePressed", from);
        page.mouse("mouseMoved", [from[0] - 10.0, from[1] + 4.0]);
        page.mouse("mouseMoved", to);
        page.mouse("mouseReleased", to);
        let field = |page: &mut Browser, name: &str| {
            let value = format!("Number(document.getElementById('shape-bar').elements.{name}.value)");
            page.value(&value).as_f64().unwrap()
        };
        if field(page, "corner") == 2.0 {
            corner = ["x", "y"].map(|axis| field(page, axis));
        }
        (0..2).all(|axis| (corner[axis] - goal[axis]).abs() < 0.02)
    });
    screen.click(&mut page, [0.3, 1.15]);
    page.wait("document.getElementById('shape-bar').elements.corner.length === 5");
    // By the keyboard: where the new one lies.
    write(&mut page, "x", 0.3);
    write(&mut page, "y", 1.0);
    page.wait("document.querySelector('#shape-bar .diff').textContent.includes('+polygon_m = ')");
    page.picture("fence");
    assert_eq!(fence(&robot)[2], json!([1.6, 1.2]), "nothing is taken by itself");
    until(&mut page, "the fence is taken", |page| {
        page.click("#shape-bar [name=take]");
        robot.is_true_within(|robot| fence(robot).as_array().unwrap().len() == 5, HIT)
    });
    let taken = fence(&robot);
    assert_eq!((&taken[0], &taken[3]), (&json!([-1.2, -1.2]), &json!([0.3, 1.0])), "{taken}");
    let dragged = [0, 1].map(|axis| taken[2][axis].as_f64().unwrap());
    assert!((dragged[0] - 1.4).abs() < 0.02 && (dragged[1] - 1.1).abs() < 0.02, "{taken}");
    page.wait("document.getElementById('shape-bar').hidden");
    // One that leaves the robot outside is refused, and the one before stays.
    page.click("#fence");
    page.wait("!document.getElementById('shape-bar').hidden");
    page.value("(() => { const { corner } = document.getElementById('shape-bar').elements; corner.value = 0; corner.onchange(); })()");
    write(&mut page, "x", 1.0);
    write(&mut page, "y", 0.6);
    until(&mut page, "it is refused", |page| {
        page.click("#shape-bar [name=take]");
        page.is_true_within("document.getElementById('said').textContent.includes('fence')", HIT)
    });
    assert_eq!(fence(&robot), taken);
    for (width, height) in [(390, 844), (320, 640)] {
        page.resize(width, height);
        let is_wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth";
        assert_eq!(page.value(is_wide), json!(false), "{width} px: it is wider than the window");
        page.middle("#view");
        page.picture(&format!("fence-{width}"));
    }
    page.resize(1400, 1000);
    let dark = json!({"features": [{"name": "prefers-color-scheme", "value": "dark"}]});
    page.ask("Emulation.setEmulatedMedia", dark);
    page.picture("fence-dark");
    page.click("#shape-bar [name=close]");
    a_wall_is_drawn_changed_and_removed(&mut page, &robot, &screen);
    robot.end();
}

fn a_wall_is_drawn_changed_and_removed(page: &mut Browser, robot: &Robot, screen: &Screen) {
    page.click("#wall");
    for corner in [[0.7, -1.0], [1.3, -1.0], [1.3, -0.5]] {
        screen.click(page, corner);
    }
    page.wait("document.getElementById('shape-bar').elements.corner.length === 3");
    page.click("#shape-bar [name=take]");
    page.wait("document.getElementById('shape-bar').hidden");
    let walls = |robot: &Robot| robot.read("map")["walls_m"].clone();
    robot.wait("the wall is drawn", |robot| walls(robot)[0].as_array().is_some_and(|wall| wall.len() == 3));
    // A second one is saved with the file's and the first.
    page.click("#wall");
    for corner in [[-1.0, -1.0], [-0.6, -1.0], [-0.6, -0.6]] {
        screen.click(page, corner);
    }
    page.wait("document.getElementById('shape-bar').elements.corner.length === 3");
    let line = page.value("document.querySelector('#shape-bar .more').textContent");
    assert_eq!(line.as_str().unwrap().matches("[[").count(), 3, "{line}");
    page.click("#shape-bar [name=close]");
    until(page, "the wall is chosen", |page| {
        screen.click(page, [1.2, -0.9]);
        page.is_true_within("!document.getElementById('shape-bar').hidden", HIT)
    });
    page.picture("wall");
    page.click("#shape-bar [name=remove]");
    robot.wait("the wall is gone", |robot| walls(robot) == json!([]));
    a_way_shows_its_speed(page, robot);
}

/// Colours of the way's speed have a legend up to its greatest one.
fn a_way_shows_its_speed(page: &mut Browser, robot: &Robot) {
    until(page, "it holds", |_| {
        robot.call(&json!({ "do": "enable" }));
        robot.is_true_within(|robot| robot.read("now")["phase"] == "holding", HIT)
    });
    let (_, said) = robot.call(&json!({ "do": "drive_to", "pose": [0.6, -0.4, 0.0] }));
    assert_eq!(said["done"], true, "{said}");
    let speeds = robot.read("planned")["speeds_m_s"].clone();
    let most = speeds.as_array().unwrap().iter().map(|speed| speed.as_f64().unwrap()).fold(0.0, f64::max);
    page.wait(&format!("document.getElementById('speed-most').textContent === '{most:.2} m/s'"));
    assert_eq!(page.value("document.getElementById('speed-key').hidden"), json!(false));
    page.middle("#view");
    page.picture("way-dark");
    page.ask("Emulation.setEmulatedMedia", json!({ "features": [] }));
    page.picture("way");
    what_is_left_and_what_binds_is_told(page, robot);
    it_grows_shrinks_and_moves_by_hand(page);
    // It is there: the way isn't begun again, but planned.
    page.wait("document.querySelector('[data-do=track]').disabled && document.getElementById('drive-to').classList.contains('go')");
    for (width, height) in WINDOWS {
        page.resize(width, height);
        let covered = page.value(COVERED);
        assert_eq!(covered, json!([]), "at {width} px these lie below something else");
    }
    page.resize(320, 640);
    page.middle("#view");
    page.picture("way-320");
}

/// On its way the page says how long that still takes and what binds it, and has a legend for the limits' colours.
fn what_is_left_and_what_binds_is_told(page: &mut Browser, robot: &Robot) {
    let mut goals = [[-0.5, -0.4, 0.0], [0.6, -0.4, 0.0]].into_iter().cycle();
    until(page, "it says what is left and what binds", |page| {
        let (_, said) = robot.call(&json!({ "do": "drive_to", "pose": goals.next() }));
        let told = "/^[0-9.]+ s left[.] Bound by [a-z]/.test(document.getElementById('left').textContent)";
        said["done"] == true && page.is_true_within(told, HIT)
    });
    let limit = robot.read("planned")["binds"]["limits"][0]["name"].clone();
    let limit = limit.as_str().unwrap();
    page.wait(&format!("document.getElementById('binds-key').textContent.includes('{limit} ')"));
}

/// By the wheel, and by the keyboard.
fn it_grows_shrinks_and_moves_by_hand(page: &mut Browser) {
    const SCALE: &str = "Number(document.getElementById('view').dataset.scale)";
    const CENTRE: &str = "document.getElementById('view').dataset.centre_m.split(' ').map(Number)";
    let [x, y] = page.middle("#view");
    let before = page.value(SCALE).as_f64().unwrap();
    for (turned, grown) in [(-200.0, 1.35), (200.0, 1.0)] {
        let wheel = json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0.0, "deltaY": turned });
        page.ask("Input.dispatchMouseEvent", wheel);
        page.wait(&format!("Math.abs({SCALE} / {before} - {grown}) < 0.01"));
    }
    page.value("document.getElementById('view').focus()");
    let mut press = |key: &str, brings: &str| {
        page.ask("Input.dispatchKeyEvent", json!({ "type": "keyDown", "key": key }));
        page.ask("Input.dispatchKeyEvent", json!({ "type": "keyUp", "key": key }));
        page.wait(brings);
        page.value(CENTRE)
    };
    let grown = 1.25 * before;
    let centre_m = press("+", &format!("Math.abs({SCALE} - {grown}) < 0.01"));
    let [x_m, y_m] = [0, 1].map(|axis| centre_m[axis].as_f64().unwrap());
    let step_m = 40.0 / grown;
    press("ArrowLeft", &format!("Math.abs({CENTRE}[0] - {}) < 1e-3", x_m - step_m));
    press("ArrowUp", &format!("Math.abs({CENTRE}[1] - {}) < 1e-3", y_m + step_m));
    press("-", &format!("Math.abs({SCALE} - {before}) < 0.01"));
}
