// The page on which a robot is set up: what is asked is answered here, and a drive turns only while the button is held.

import { write } from "./write.js";

/** How often a held button is told. */
const BEAT_MS = 50;
const AGAIN_MS = 500;
/** A connection on which nothing came for so long is given up for a new one. */
const DEAD_MS = 3000;
/** What is said of a held button that the robot hears nothing of. */
const UNHEARD_MS = 400;

const at = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";

class Link {
  constructor(hear) {
    this.hear = hear;
    this.stamp = null;
    this.heard_ms = 0;
    this.connect();
    setInterval(() => this.watch(), BEAT_MS);
  }

  connect() {
    const socket = new WebSocket(`ws://${location.host}/api/setup/live`);
    this.socket = socket;
    this.since_ms = performance.now();
    socket.onmessage = (event) => {
      this.heard_ms = performance.now();
      this.hear(JSON.parse(event.data));
    };
    socket.onclose = () => this.leave();
  }

  leave() {
    this.socket.onmessage = this.socket.onclose = null;
    this.socket.close();
    button.letGo();
    // Another program may be at the other end, and ask something else by the same number.
    answered = null;
    delete at("question").dataset.number;
    isLeaving = false;
    setTimeout(() => this.connect(), AGAIN_MS);
  }

  get isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  get silent_ms() {
    return performance.now() - Math.max(this.heard_ms, this.since_ms);
  }

  watch() {
    const isLost = !this.isOpen || this.silent_ms > UNHEARD_MS;
    at("link").classList.toggle("lost", isLost);
    write(at("link"), over !== null ? "it is over" : isLost ? `nothing was heard for ${(this.silent_ms / 1000).toFixed(1)} s: nothing moves` : "connected");
    if (this.silent_ms > DEAD_MS && over === null && this.socket.readyState !== WebSocket.CLOSED) this.leave();
  }

  say(what) {
    // A line that is full or silent: what is said into it would come late.
    if (this.isOpen && this.socket.bufferedAmount === 0) this.socket.send(JSON.stringify(what));
  }
}

/** The button that is held: for one motion, by one press. */
class Button {
  constructor() {
    this.number = null;
    this.pressed = null;
    this.pressed_ms = 0;
    const element = at("hold");
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      element.setPointerCapture(event.pointerId);
      this.press();
    });
    element.addEventListener("pointermove", (event) => {
      const { left, right, top, bottom } = element.getBoundingClientRect();
      const isOn = event.clientX >= left && event.clientX <= right && event.clientY >= top && event.clientY <= bottom;
      if (!isOn) this.letGo();
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture", "contextmenu"]) element.addEventListener(end, () => this.letGo());
    addEventListener("keydown", (event) => {
      if (this.number === null || at("holding").hidden) return;
      event.preventDefault();
      // Any other key ends it, as at a terminal.
      if (event.code !== "Space") this.letGo();
      else if (!event.repeat) this.press();
    });
    addEventListener("keyup", (event) => event.code === "Space" && this.letGo());
    for (const end of ["blur", "pagehide"]) addEventListener(end, () => this.letGo());
    document.addEventListener("visibilitychange", () => document.hidden && this.letGo());
    setInterval(() => this.beat(), BEAT_MS);
  }

  /** Now it is this motion's, or nobody's: who still presses it for the one before presses nothing. */
  belongsTo(number) {
    if (number !== this.number) this.letGo();
    this.number = number;
  }

  press() {
    if (this.number === null) return;
    this.pressed = this.number;
    this.pressed_ms = performance.now();
    at("hold").classList.add("pressed");
    this.beat();
  }

  letGo() {
    if (this.pressed === null) return;
    this.pressed = null;
    at("hold").classList.remove("pressed", "unheard");
    // Whatever waits before it: a beat that is late counts for nothing.
    if (link.isOpen) link.socket.send(JSON.stringify({ let_go: true }));
  }

  beat() {
    if (this.pressed !== null && link.stamp !== null) link.say({ beat: this.pressed, stamp: link.stamp });
  }

  see({ held, delay_ms }) {
    const isUnheard = this.pressed !== null && !held && performance.now() - this.pressed_ms > UNHEARD_MS;
    at("hold").classList.toggle("unheard", isUnheard);
    write(at("held"), isUnheard
      ? `not heard in time${delay_ms === null ? "" : ` (${delay_ms} ms late)`}: nothing moves`
      : this.pressed === null ? "it moves only while you hold this button, or the space bar" : "held; let go to stop");
  }
}

let over = null;
let shown = null;
/** What was answered on this connection, until something else is asked: said again, for a line that was full took nothing. */
let answered = null;
/** Whoever leaves on this connection says so until it is over, for the same reason. */
let isLeaving = false;
const button = new Button();
const link = new Link((message) => ("stamp" in message ? tick(message) : "steps" in message && show(message)));

function tick(message) {
  link.stamp = message.stamp;
  button.see(message);
  Object.assign(at("moves").dataset, { enabled: message.enabled, travel: message.travel, late: message.late });
  write(at("moves"), message.enabled ? `the drive is enabled; ${message.travel.toLocaleString("en")} since it began` : "the drive is not enabled");
}

function show(message) {
  shown = message;
  over = message.over;
  at("robot").textContent = message.robot;
  at("steps").replaceChildren(...message.steps.map(({ words, is_done, is_passed_over, is_now }) => {
    const item = document.createElement("li");
    item.textContent = words;
    item.className = is_now ? "now" : is_passed_over ? "passed" : is_done ? "done" : "";
    if (is_now) item.setAttribute("aria-current", "step");
    return item;
  }));
  at("said").replaceChildren(...message.said.toReversed().map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  at("last").textContent = message.hold ? "" : (message.said.at(-1) ?? "");
  button.belongsTo(message.hold?.number ?? null);
  at("holding").hidden = !message.hold;
  at("what").textContent = message.hold?.text ?? "";
  at("over").hidden = over === null;
  at("over").textContent = over ?? "";
  at("leave").disabled = over !== null;
  at("busy").hidden = Boolean(message.hold || message.question || over !== null);
  ask(message.question);
  draw(message.platform, message.question?.choices ?? []);
}

function ask(question) {
  const form = at("question"), number = question?.number ?? null;
  if (number !== answered?.question) answered = null;
  form.hidden = !question;
  // What somebody types isn't taken from them by a line that was said meanwhile.
  if (!question || form.dataset.number === String(number)) return;
  form.dataset.number = number;
  form.dataset.id = question.id;
  at("asked").textContent = question.text;
  at("choices").replaceChildren(...question.choices.map((choice) => {
    const one = Object.assign(document.createElement("button"), { type: "button", textContent: choice });
    one.dataset.choice = choice;
    one.addEventListener("click", () => answer(choice));
    return one;
  }));
  const isFree = question.choices.length === 0;
  at("free").hidden = !isFree;
  at("value").value = question.default ?? "";
  if (isFree) at("value").focus();
}

function answer(text) {
  if (!shown?.question) return;
  answered = { question: shown.question.number, answer: text };
  link.say(answered);
}

setInterval(() => {
  if (answered !== null) link.say(answered);
  if (isLeaving && over === null) link.say({ leave: true });
}, AGAIN_MS);

at("question").addEventListener("submit", (event) => {
  event.preventDefault();
  if (!at("free").hidden) answer(at("value").value);
});
at("leave").addEventListener("click", () => {
  isLeaving = true;
  link.say({ leave: true });
});

function element(name, attributes, ...children) {
  const one = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
  one.append(...children);
  return one;
}

/** The platform from above: its x up, its y to the left. */
function draw({ footprint_m, wheels }, choices) {
  const size = 300, points = [...footprint_m, ...wheels.map(({ position_m }) => position_m)];
  const most_m = Math.max(0.05, ...points.flat().map(Math.abs)), scale = (size / 2 - 45) / most_m;
  const place = ([x, y]) => [size / 2 - scale * y, size / 2 - scale * x];
  const drawn = wheels.map(({ name, position_m, rolls, radius_m }) => {
    const [x, y] = place(position_m), length = Math.max(2 * radius_m * scale, 24), angle = (Math.atan2(-rolls[0], -rolls[1]) * 180) / Math.PI;
    const wheel = element("rect", { class: "wheel", x: -length / 2, y: -length / 5, width: length, height: (2 * length) / 5, rx: 3 });
    const end = length / 2 + 16, arrow = element("path", { class: "rolls", d: `M${length / 2} 0H${end}m-7-6l7 6l-7 6` });
    const turned = element("g", { transform: `rotate(${angle})` }, wheel, arrow), words = element("text", { y: length / 2 + 14 });
    words.textContent = name;
    const isChoice = choices.includes(name), group = element("g", { transform: `translate(${x} ${y})`, class: isChoice ? "choice" : "" }, turned, words);
    if (isChoice) group.addEventListener("click", () => answer(name));
    return group;
  });
  const body = element("polygon", { class: "body", points: footprint_m.map((corner) => place(corner).join()).join(" ") });
  at("platform").setAttribute("viewBox", `0 0 ${size} ${size}`);
  at("platform").replaceChildren(body, ...drawn);
}
