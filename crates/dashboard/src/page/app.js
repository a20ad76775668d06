// The page: what is seen goes to its places, what is pressed goes to the robot.

import { Beside } from "./beside.js";
import { faultWords } from "./fault.js";
import { AGAIN_MS, Link, OLD_MS, post, read } from "./link.js";
import { showActions } from "./actions.js";
import { Objects } from "./objects.js";
import { Obstacles } from "./obstacles.js";
import { Plots } from "./plots.js";
import { Settings } from "./settings.js";
import { Shapes } from "./shapes.js";
import { Sticks } from "./stick.js";
import { StopButton } from "./stop.js";
import { View } from "./view.js";
import { Warning } from "./warning.js";
import { write } from "./write.js";

/** So long a slow line may take for a stop. */
const STOP_MS = 10000;
/** So often numbers and plots are drawn, and all else while the platform stands. */
const READ_MS = 100;

const by = (id) => document.getElementById(id);
const view = new View(by("view"));
const link = new Link();
const sticks = new Sticks(link, {
  stick: by("stick"), turn: by("turn"), share: by("share"), odom: by("odom"), gamepad: by("gamepad"),
});
const stop = new StopButton(by("stop"), link);
const warning = new Warning();
const beside = new Beside(by("beside"), { ask, halt, value });
const settings = new Settings(by("settings"), (values) => ask({ do: "set", values }));
new Objects(by("objects"), (call) => link.call(call));
let facts = null, plots = null, columns = new Map(), last = null, me = null, may = "look", bit = null, isBlocked = false, isDrawing = false, read_ms = -Infinity, who = "connecting", planned = null, plannedKey = "", walls = null;

// What is pressed.

async function ask(call, pressed_ms) {
  return show(await link.call(call, pressed_ms));
}

/** A stop is said into a silent line too, and by the second way. */
async function halt(call) {
  if (!link.isSilent) return ask(call);
  link.say(call);
  return show(await post(call, STOP_MS));
}

function show(said) {
  by("said").textContent = said.text;
  by("said").classList.toggle("no", !said.done);
  return said;
}

function refuse(text) {
  by("said").textContent = text;
  by("said").classList.add("no");
}

for (const button of document.querySelectorAll("[data-do]")) {
  button.onclick = ({ timeStamp }) => ask({ do: button.dataset.do }, timeStamp);
}
for (const button of document.querySelectorAll("[data-stop]")) {
  button.onclick = () => halt({ do: "stop", category: button.dataset.stop });
}
by("give-up").onclick = () => stop.giveUp();
by("stop").addEventListener("said", showAge);
document.addEventListener("keydown", (event) => {
  const typing = event.target.matches?.("input:not([type=range]):not([type=checkbox]), select, textarea");
  if (event.code !== "Space" || typing) return;
  event.preventDefault();
  if (!event.repeat) stop.press();
});
// A button that has the focus isn't pressed by the same key.
document.addEventListener("keyup", (event) => event.code === "Space" && event.target.matches?.("button") && event.preventDefault());
by("share").oninput = () => (by("share-is").textContent = `${by("share").value} %`);
by("controller").onchange = () => ask({ do: "controller", name: by("controller").value });
by("follow").onclick = () => view.setFollow(!view.follow);
view.onFollow = (on) => by("follow").setAttribute("aria-pressed", on);
by("fit").onclick = () => (view.fit(), view.setFollow(false));
by("clear").onclick = () => ((view.trail = []), view.draw());
by("add-plot").onclick = () => plots?.add([]);
by("teach").onclick = async () => {
  if (last?.teaching_since_s == null && last?.taught_points == null) {
    const chosen = by("teach-by").value;
    const sampling = chosen === "points" ? "points"
      : chosen === "change" ? { change: { distance_m: 0.02, angle_rad: 0.035 } } : { period_s: Number(chosen) };
    await ask({ do: "teach", by: sampling });
  } else {
    await ask({ do: "teach_end", name: by("path-name").value, tolerance_m: Number(by("tolerance").value) });
    savedPaths().catch((error) => show({ done: false, text: error.message }));
  }
};
by("teach-point").onclick = () => ask({ do: "teach_point" });
by("load").onclick = () => by("saved").value && ask({ do: "load_saved", name: by("saved").value });
by("file").onchange = async () => {
  const [file] = by("file").files;
  if (file) await ask({ do: "load_points", text: await file.text() });
  by("file").value = "";
};

/** A button that waits for a place in the view. */
function picking(button, then) {
  button.onclick = () => {
    const on = button.getAttribute("aria-pressed") !== "true";
    if (view.edit) shapes.close();
    for (const other of [by("go"), by("drive-to"), by("obstacle")]) other.setAttribute("aria-pressed", other === button && on);
    view.onPick = on ? (place, pressed_ms) => (button.click(), then(place, pressed_ms)) : null;
    view.canvas.style.cursor = on ? "crosshair" : "";
  };
}
picking(by("go"), ([x, y], pressed_ms) => {
  ask({ do: "go_to", pose: [x, y, last ? value("state/pose_heading_rad") : 0] }, pressed_ms);
});

picking(by("drive-to"), ([x, y], pressed_ms) => {
  ask({ do: "drive_to", pose: [x, y, last ? value("state/pose_heading_rad") : 0] }, pressed_ms);
});
const shapes = new Shapes(view, by("shape-bar"), { ask, refuse, buttons: { fence: by("fence"), wall: by("wall") } });
shapes.onOpen = () => {
  for (const other of [by("go"), by("drive-to"), by("obstacle")]) other.setAttribute("aria-pressed", "false");
  view.onPick = null;
  obstacles.select(null);
};
picking(by("obstacle"), (place) => obstacles.put(place, facts.obstacle_places));
const obstacles = new Obstacles(view, by("obstacle-bar"), { ask, send: (call) => link.send(call), refuse });

// The head of the page grows by what a person must know; what stands still below it has to make way.
new ResizeObserver(([{ target }]) => {
  document.documentElement.style.setProperty("--head", `${target.offsetHeight}px`);
}).observe(document.querySelector("header"));

// What is seen.

function value(name) {
  return last?.values[columns.get(name)] ?? null;
}

function pose(topic) {
  const found = ["x_m", "y_m", "heading_rad"].map((part) => value(`${topic}/pose_${part}`));
  return found.includes(null) ? null : found;
}

/** With so many decimals, and no sign before nothing. */
const fixed = (number, digits) => (number === null ? "–" : number.toFixed(digits).replace(/^-(?=[0.]*$)/, ""));

/** An angle within ±180°. */
const degrees = (rad) => ((((rad * 180) / Math.PI + 180) % 360) + 360) % 360 - 180;

for (const change of ["open", "lost", "watched"]) link.addEventListener(change, showAge);
link.addEventListener("welcome", async ({ detail }) => {
  me = detail.you;
  bit = detail.stick_bit;
  may = detail.may;
  const { socket } = link;
  while (socket === link.socket) {
    try {
      return await begin();
    } catch (error) {
      who = error.message;
      await new Promise((later) => setTimeout(later, AGAIN_MS));
    }
  }
});
link.addEventListener("seen", ({ detail }) => {
  stop.see(detail.emergency_stop);
  if (facts) see(detail);
});

async function begin() {
  // What is seen meanwhile waits for the robot's facts, and for all that is made of them without another wait.
  const map = await read("map");
  facts = await read("robot");
  document.title = `${facts.name} · omnibase`;
  by("name").textContent = facts.name + (facts.simulated ? " (simulated)" : "");
  by("truth-key").hidden = !facts.simulated;
  who = me ? `you are ${me}` : may === "stop" ? "all sessions taken: you may look, and stop" : "you may look, and stop";
  columns = new Map(facts.columns.map((name, n) => [name, n]));
  beside.build(facts.devices);
  for (const element of document.querySelectorAll("button, .panel input, .panel select")) {
    if (!element.closest(".tools, .plots") || ["go", "drive-to", "obstacle", "wall", "fence"].includes(element.id)) element.disabled = !me;
  }
  // Whoever sees the robot may stop it.
  const stops = document.querySelectorAll("[data-stop], [data-stops-axis]");
  for (const button of [by("stop"), by("give-up"), ...stops]) button.disabled = false;
  by("controller").replaceChildren(...facts.controllers.map((name) => new Option(name, name)));
  view.robot(facts);
  shapes.file = facts.fence;
  view.room(map);
  walls = null;
  savedPaths(facts.saved_paths);
  if (!plots) {
    plots = new Plots(by("plots"), facts.columns, (name) =>
      name.replace(/^wheel_(\d+)\//, (whole, number) => (facts.wheels[number - 1] ? `${facts.wheels[number - 1].name}/` : whole)));
    const wheels = (what) => facts.columns.filter((name) => name.endsWith(`/${what}`) && name.includes("wheel"));
    plots.add(["setpoint/twist_x_m_s", "setpoint/twist_y_m_s", "setpoint/twist_heading_rad_s"]);
    plots.add(wheels("speed_rad_s"));
    plots.add(wheels("torque_nm"));
    plots.add(["error/believed_m", "error/true_m"]);
  }
  const [trace, events] = [await read("trace"), await read("events")];
  view.trail = trace.map(([, believed, truth]) => [believed, truth]);
  by("events").replaceChildren();
  events.forEach(happened);
  plannedKey = "";
}

async function savedPaths(names) {
  names ??= (await read("robot")).saved_paths;
  by("saved").replaceChildren(...names.map((name) => new Option(name, name)));
  if (!names.length) by("saved").append(new Option("none yet", ""));
  by("load").disabled = !me || !names.length;
}

function happened({ time_s, text }) {
  const item = document.createElement("li"), time = document.createElement("time");
  time.textContent = `${time_s.toFixed(2)} s`;
  item.append(time, text);
  by("events").prepend(item);
  while (by("events").children.length > 300) by("events").lastChild.remove();
}

async function drawPlanned(seen) {
  const standing = seen.phase !== "tracking" && !seen.reference_start;
  const key = JSON.stringify([seen.reference, seen.reference_start, standing && pose("state")?.map((v) => v.toFixed(2))]);
  if (key === plannedKey) return;
  plannedKey = key;
  planned = await read("planned");
  view.planned = planned.poses;
  view.speeds = planned.speeds_m_s;
  view.binds = planned.binds;
  by("binds-key").replaceChildren(...planned.binds.limits.map(({ name, colour, share }) => {
    const key = document.createElement("span");
    const mark = key.appendChild(document.createElement("i"));
    mark.style.background = colour;
    key.append(` ${name} ${Math.round(100 * share)} %`);
    return key;
  }));
  const most = Math.max(0, ...planned.speeds_m_s);
  by("speed-key").hidden = most <= 0;
  write(by("speed-most"), `${most.toFixed(2)} m/s`);
}

/** Every message counts, but only the latest is drawn: a page that draws slowly must not see ever older ones. */
function see(seen) {
  last = seen;
  isBlocked = bit !== null && Boolean((BigInt(seen.blocked_sticks) >> BigInt(bit)) & 1n);
  const believed = pose("state");
  if (believed) view.add(believed, facts.simulated ? pose("truth") : null);
  if (walls !== null && walls !== seen.walls) read("map").then((map) => view.room(map)).catch(() => {});
  walls = seen.walls;
  if (seen.values.length) plots.take(seen.time_s, seen.values);
  warning.see(seen.moves_again_in_s);
  seen.events.forEach(happened);
  if (isDrawing || !(view.hasMoved || performance.now() >= read_ms + READ_MS)) return;
  isDrawing = true;
  requestAnimationFrame(draw);
}

function draw() {
  isDrawing = false;
  const seen = last, badge = by("phase");
  write(badge, seen.phase);
  badge.className = `badge seen ${seen.phase.split(" ")[0]}`;
  const mine = seen.commander === me ? `you (${me})` : seen.commander;
  const how = seen.by_stick ? "by hand" : ({ way: "going somewhere", onto: "onto the path" })[seen.course] || "on the path";
  write(by("commander"), seen.commander === "nobody" ? "nobody commands" : `${mine} commands, ${how}`);
  showAge();
  showActions(seen, me !== null);
  const taught = seen.taught_points;
  write(by("teach"), taught !== null ? `End and save (${taught} point${taught === 1 ? "" : "s"})`
    : seen.teaching_since_s === null ? "Teach" : `End and save (${(seen.time_s - seen.teaching_since_s).toFixed(0)} s)`);
  by("teach-point").hidden = taught === null;
  if (document.activeElement !== by("controller")) by("controller").selectedIndex = seen.controller;
  obstacles.show(seen.obstacles);
  view.goal = seen.goal;
  view.fence = seen.fence;
  if (!view.edit) write(by("fence"), seen.fence.length ? "Edit fence…" : "Draw fence…");
  view.kept = value("guard/fence_kept_m");
  by("view").dataset.obstacles = seen.obstacles.length;
  const here = pose("state"), metres = here?.slice(0, 2).map((place) => `${fixed(place, 1)} m`);
  const where = here ? `at x ${metres[0]}, y ${metres[1]}, heading ${fixed(degrees(here[2]), 0)}°` : "somewhere";
  by("view").setAttribute("aria-label", `Top view: the platform ${where}; ${seen.obstacles.length} obstacles`);
  view.draw();
  drawPlanned(seen).catch(() => {});
  if (performance.now() >= read_ms + READ_MS) drawNumbers(seen);
}

/** What is read: nobody reads faster than it changes here. */
function drawNumbers(seen) {
  read_ms = performance.now();
  showPose(pose("state"));
  showDrives(seen);
  beside.show();
  settings.show(seen.settings, me !== null);
  const share = planned?.duration_s ? Math.min(1, seen.reference_time_s / planned.duration_s) : 0;
  showLeft(seen);
  by("progress").style.width = `${100 * (seen.reference_begun ? share : 0)}%`;
  plots.draw();
}

/** How long the path still takes, and what became of the way to a pose. */
function showLeft(seen) {
  // Of a way of drive_to that is over nothing is left: it is planned anew.
  const isOver = seen.of_drive_to[0] && !seen.drive_to?.under_way;
  const left_s = planned?.duration_s && seen.reference_begun && !isOver ? planned.duration_s - seen.reference_time_s : null;
  const left = left_s > 0.05 && (seen.course === "reference" || seen.course === "onto") ? `${left_s.toFixed(1)} s left` : "";
  const { limits = [], at = [] } = planned?.binds ?? {};
  const bound = limits[at[Math.round((at.length - 1) * seen.reference_time_s / planned?.duration_s)]]?.name;
  const now = left && bound ? `Bound by ${bound}` : "";
  const next = seen.reference_next !== seen.reference && !seen.of_drive_to[1] ? "Another path waits: follow it" : "";
  const way = seen.drive_to ? `Way: ${seen.drive_to.text}` : "";
  const text = [left, now, next, way].filter(Boolean).join(". ");
  by("left").hidden = !text;
  write(by("left"), text);
  by("left").classList.toggle("no", Boolean(seen.drive_to?.failed));
}

const JOYSTICK = {
  present: "The joystick at the robot is there. It comes before this page.",
  lost: "The joystick at the robot is lost. Plug it in again; then it must be enabled, here or by its own button.",
  blocked: "The joystick at the robot is blocked until it is enabled, here or by its own button. Let go of it first.",
};

const seconds = (ms) => `${(ms / 1000).toFixed(1)} s`;

/** What is old is grey, with its age; and nobody drives by it. */
function showAge() {
  const { isOld, isSilent, isOpen, age_ms, delay_ms } = link;
  const age = age_ms === null ? "nothing seen yet" : isSilent ? `${seconds(age_ms)} old` : `up to ${seconds(delay_ms)} old`;
  document.body.classList.toggle("old", isOld);
  // Whoever changes it has the style of everything on the page computed anew.
  if (isOld) document.documentElement.style.setProperty("--age", JSON.stringify(age));
  by("age").hidden = !isOld;
  write(by("age"), age);
  const isLost = isSilent && age_ms !== null;
  write(by("link"), !isSilent ? who : age_ms === null ? "connecting" : isOpen ? "nothing is heard" : "no connection");
  by("link").classList.toggle("lost", isLost);
  write(by("delay"), isSilent || delay_ms === null ? "" : `delay ${delay_ms > OLD_MS ? seconds(delay_ms) : `${delay_ms} ms`}`);
  by("delay").className = `link ${delay_ms > OLD_MS ? "lost" : delay_ms > SLOW_MS ? "slow" : ""}`;
  sticks.mayDrive = me !== null && !isBlocked && !isOld;
  showBanner(last);
  if (last) showStick(last);
}

/** A delay above it is told in another colour. */
const SLOW_MS = 200;

/** What a person must know wherever on the page they are, the worst of it, with what mends it. */
function showBanner(seen) {
  const isLost = link.isSilent && link.age_ms !== null;
  const [text, kind, button] =
    stop.isUnheard ? ["STOP was not heard. Use the emergency stop on the machine. This page tries on until it is heard.", "", "give-up"]
    : isLost ? [`${link.isOpen ? "Nothing is heard of the robot" : "No connection"}: what this page commanded has stopped; what is pressed is not sent.${seen?.moves_again_in_s != null ? " It said that it moves again by itself: keep away from it." : ""}`, "", ""]
    : !seen ? ["", "", ""]
    : seen.emergency_stop ? ["Emergency stop is set: nothing moves until it is released.", "", "release"]
    : seen.moves_again_in_s != null ? [`It moves again by itself in ${seen.moves_again_in_s.toFixed(1)} s: keep away from it, or stop it.${warning.isHeard ? "" : " No sound: touch this page once."}`, "", ""]
    : seen.phase === "fault" ? [`Fault: ${faultWords(seen, facts)}`, "", "mend"]
    : seen.phase === "quick stopping" ? [`Quick stop: ${faultWords(seen, facts)}`, "", ""]
    : link.isOld ? [`The line is slow (${seconds(link.delay_ms)}): whatever begins a motion is refused. Stops are heard, late.`, "warn", ""]
    : isBlocked ? ["The stick was lost: enable it again to drive.", "", "enable-stick"]
    : seen.joystick === "blocked" ? [JOYSTICK.blocked, "warn", "enable-joystick"]
    : seen.joystick === "lost" ? [JOYSTICK.lost, "warn", ""]
    : ["", "", ""];
  by("banner").hidden = !text;
  by("banner").className = `banner ${kind}`;
  // What is said again isn't announced again.
  write(by("banner-is"), text);
  for (const id of ["release", "mend", "enable-stick", "enable-joystick"]) by(id).hidden = id !== button || me === null;
  by("give-up").hidden = button !== "give-up";
}

/** Why the stick on the page drives or doesn't; and what became of the one at the robot's computer. */
function showStick(seen) {
  const why =
    !me ? "Without the token nobody drives: open the address with its token."
    : link.isOld ? "What is seen is old: nobody drives by it."
    : seen.emergency_stop ? "The emergency stop is set."
    : isBlocked ? "The stick was lost: enable it again."
    : seen.by_stick && seen.commander !== me ? `Now drives: ${seen.commander}.`
    : WHY[seen.phase] ?? "Drag and hold to drive; let go to stop.";
  write(by("why"), why);
  for (const stick of document.querySelectorAll(".stick")) stick.classList.toggle("off", !why.startsWith("Drag"));
  by("joystick-is").hidden = seen.joystick === "absent";
  by("joystick-is").className = `joystick seen ${seen.joystick}`;
  write(by("joystick-is"), JOYSTICK[seen.joystick] ?? "");
}

const WHY = {
  disabled: "The drives are off: enable them first.",
  enabling: "The drives come up.",
  fault: "Acknowledge the fault, then enable the drives.",
  "quick stopping": "The drives brake.",
};

// The floor's friction as slipping wheels found it, and what it leaves of the accelerations.
function floor() {
  const friction = value("estimate/floor_friction"), share = value("traction/share") ?? 1;
  const found = friction === null ? "no slip yet" :
    `friction ${friction.toFixed(3)} ± ${(value("estimate/floor_friction_sigma") ?? 0).toFixed(3)}`;
  return share < 1 ? `${found}, accelerates by ${(100 * share).toFixed(0)} %` : found;
}

// Each sensor, whether it is believed, and by how many sigmas its last reading was off of those beyond which it is left out;
// how well the place is known, three standard deviations; how far odom is from map; and how old what each source said is.
const VERDICTS = ["awaited", "good", "silent", "frozen", "contradicts"];
const GOOD = 1;
function sensor({ name, gate }) {
  const verdict = value(`sensor/${name}_verdict`), off = Math.max(value(`sensor/${name}_nis`) ?? 0, 0);
  const left = verdict === GOOD && off > gate ? ", left out" : "";
  return [name, `${VERDICTS[verdict] ?? "–"}${left}, ${Math.sqrt(off).toFixed(1)} of ${Math.sqrt(gate).toFixed(1)} σ`];
}

function sensors() {
  const heard = [...columns.keys()].filter((name) => name.endsWith("/instant_ns")).map((name, n) => {
    const source = name.slice(0, -11), age = value(`${source}/age_s`), counts = last.sources[n];
    const left = counts ? counts.late + counts.out_of_order : 0;
    const old = age === null || !Number.isFinite(age) ? "nothing heard" : `${Math.round(1000 * age)} ms old`;
    return `${source} ${old}${left ? `, ${left} refused` : ""}`;
  });
  const sources = heard.length ? [["sources", heard.join(", ")]] : [];
  if (!facts.sensors.length) return sources;
  const sigma = (...axes) => Math.sqrt(Math.max(...axes.map((axis) => value(`state/covariance_${axis}`) ?? 0)));
  const map = pose("map"), odom = pose("state");
  const apart = map && odom && Math.hypot(map[0] - odom[0], map[1] - odom[1]);
  return [
    ...facts.sensors.map(sensor),
    ["3 σ", `${(3000 * sigma("xx_m2", "yy_m2")).toFixed(1)} mm, ${(3000 * sigma("hh_rad2")).toFixed(1)} mrad`],
    ["odom from map", apart === null || apart === undefined ? "–" : `${(1000 * apart).toFixed(1)} mm`],
    ...sources,
  ];
}

function showPose(believed) {
  const error = value("error/believed_m");
  const pairs = [
    ["x", believed && `${fixed(believed[0], 4)} m`], ["y", believed && `${fixed(believed[1], 4)} m`],
    ["heading", believed && `${fixed(degrees(believed[2]), 2)}°`],
    ["speed", `${Math.hypot(value("state/twist_in_body_x_m_s") ?? 0, value("state/twist_in_body_y_m_s") ?? 0).toFixed(3)} m/s`],
    ["error", error === null ? "–" : `${fixed(error * 1000, 3)} mm`], ["time", `${last.time_s.toFixed(1)} s`],
    ["held back by", last.limited_by || "nothing"], ["floor", floor()], ...sensors(),
  ];
  const list = by("pose");
  if (list.children.length !== pairs.length) {
    list.replaceChildren(...pairs.map(() => {
      const item = document.createElement("div");
      item.append(document.createElement("dt"), document.createElement("dd"));
      return item;
    }));
  }
  pairs.forEach(([name, text], n) => {
    write(list.children[n].firstChild, name);
    write(list.children[n].lastChild, text ?? "–");
  });
}

function showDrives(seen) {
  const body = by("drives").tBodies[0];
  while (body.rows.length < facts.wheels.length) {
    const row = body.insertRow();
    for (let n = 0; n < 4; n++) row.insertCell();
  }
  facts.wheels.forEach(({ name, device }, n) => {
    const cells = body.rows[n].cells, drive = seen.drives[n];
    write(cells[0], name);
    cells[0].title = device;
    write(cells[1], drive ? drive.error || drive.state : "–");
    cells[1].className = drive && (drive.error || drive.state === "failed") ? "bad" : "";
    write(cells[2], fixed(value(`${name}/speed_rad_s`) ?? value(`wheel_${n + 1}/speed_rad_s`), 2));
    write(cells[3], fixed(value(`${name}/torque_nm`) ?? value(`wheel_${n + 1}/torque_nm`), 2));
  });
  const [cycles, lost, overruns] = seen.counts, [crowded, denied, malformed, oversized, flooding] = seen.server;
  const refused = crowded + denied + malformed + oversized + flooding;
  showTiming(seen.timing);
  write(by("bus"), bus());
  write(by("counts"), `${cycles} cycles, ${lost} frames lost, ${overruns} cycles left out; ${refused} requests refused`);
}

const MEASURES = { wake_up: "wake-up late", round_trip: "round trip", compute: "compute", dc_phase: "DC phase" };

/** How long cycles took so far, and when the worst one was; what isn't measured has no row. */
function showTiming(timing) {
  const body = by("timing").tBodies[0], known = Object.keys(MEASURES).filter((name) => timing[name]);
  while (body.rows.length < known.length) {
    const row = body.insertRow();
    for (let n = 0; n < 5; n++) row.insertCell();
  }
  known.forEach((name, n) => {
    const { p50_ns, p99_ns, max_ns, worst_time_s, worst_cycle, worst_phase, worst_exchange } = timing[name];
    const us = [p50_ns, p99_ns, max_ns].map((ns) => (ns / 1000).toFixed(1));
    [MEASURES[name], ...us, worst_time_s.toFixed(2)].forEach((text, k) => write(body.rows[n].cells[k], text));
    body.rows[n].title = `the worst was cycle ${worst_cycle}: ${worst_phase}, exchange ${worst_exchange}`;
  });
}

/** What the bus counted, in words. */
function bus() {
  const count = (name) => value(`bus/${name}`) ?? 0;
  const not_operational = count("not_operational") ? `${count("not_operational")} not in OP or with an error` : "all devices in OP";
  const counted = ["losses", "recoveries", "drive_faults", "emergencies", "crc_errors", "link_losses"];
  const others = counted.filter((name) => count(name)).map((name) => `${count(name)} ${name.replace("_", " ")}`);
  return `Bus: ${[not_operational, ...others].join(", ")}.`;
}
