// What stands beside the wheels: axes that are homed, moved and stopped, and outputs that are set.

import { write } from "./write.js";

/** What an axis does, by its code. */
const STATES = ["off", "holding", "moving", "homing", "stopping", "holding, its home wasn't found", "failed"];
/** Those that a person should look at. */
const BAD = [5, 6];

export class Beside {
  /** `ask` gets a call and when it was pressed, `halt` one that stops; `value` gives what is seen in a column. */
  constructor(panel, { ask, halt, value }) {
    this.panel = panel;
    this.ask = ask;
    this.halt = halt;
    this.value = value;
    this.shown = [];
  }

  /** Builds it for the SubDevices of a robot; what is there already stays, with what was typed. */
  build(devices) {
    if (this.shown.length) return;
    for (const device of devices) {
      if (device.axis) this.shown.push(this.axis(device));
      const outputs = device.outputs.map((output) => this.output(output));
      if (!outputs.length) continue;
      const row = element("div", { className: "row outputs" });
      row.append(element("b", { textContent: device.name }), ...outputs.map(({ item }) => item));
      this.panel.append(row);
      this.shown.push(...outputs);
    }
    this.panel.hidden = !this.shown.length;
  }

  show() {
    for (const one of this.shown) one.show();
  }

  axis({ name, axis: { unit, column, range, modes, finds_home } }) {
    const form = element("form", { className: "axis" });
    form.dataset.axis = name;
    const state = element("span", { className: "state" }), place = element("output", {});
    const head = element("p", { className: "row" });
    head.append(element("b", { textContent: name }), place, state);
    const [home, stop] = ["Home", "Stop"].map((text) => element("button", { type: "button", textContent: text }));
    const move = element("button", { textContent: "Move" });
    home.onclick = ({ timeStamp }) => this.ask({ do: "home_axis", name }, timeStamp);
    stop.onclick = () => this.halt({ do: "stop_axis", name });
    stop.dataset.stopsAxis = name;
    const to = element("input", { type: "number", name: "to", step: "any", required: true });
    [to.min, to.max] = range;
    const label = element("label", { title: `${range[0]} to ${range[1]} ${unit}` });
    label.append("to ", to, ` ${unit}`);
    const mode = ["csp", "pp"].find((one) => modes.includes(one));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.ask({ do: "move_axis", name, position: Number(to.value), mode }, event.timeStamp);
    });
    const tail = element("p", { className: "row" });
    tail.append(...(finds_home ? [home] : []), ...(mode ? [label, move] : []), stop);
    form.append(head, tail);
    this.panel.append(form);
    return {
      show: () => {
        const position = this.value(column), code = this.value(`${name}/state`);
        // Before nobody knows where it is.
        const isHomed = this.value(`${name}/homed`) === 1;
        write(place, position === null ? "–" : isHomed ? `${position.toFixed(4)} ${unit}` : "not homed");
        write(state, STATES[code] ?? "–");
        state.classList.toggle("bad", BAD.includes(code));
      },
    };
  }

  /** A switch is pressed, any other output gets a number. */
  output({ name, unit, column, range, is_switch }) {
    const short = name.slice(name.indexOf(".") + 1);
    const set = (value, pressed_ms) => this.ask({ do: "set_output", name, value }, pressed_ms);
    if (is_switch) {
      const item = element("button", { type: "button", textContent: short });
      item.dataset.output = name;
      const isOn = () => this.value(column) === 1;
      item.onclick = ({ timeStamp }) => set(isOn() ? 0 : 1, timeStamp);
      return { item, show: () => item.setAttribute("aria-pressed", isOn()) };
    }
    const item = element("form", { className: "row" });
    item.dataset.output = name;
    const input = element("input", { type: "number", name: "value", step: "any", required: true });
    if (range) [input.min, input.max] = range;
    const label = element("label", {}), now = element("output", {});
    label.append(`${short} `, input, ` ${unit}`);
    item.append(label, element("button", { textContent: "Set" }), now);
    item.addEventListener("submit", (event) => {
      event.preventDefault();
      set(Number(input.value), event.timeStamp);
    });
    return { item, show: () => write(now, this.value(column)?.toPrecision(4) ?? "–") };
  }
}

function element(kind, properties) {
  return Object.assign(document.createElement(kind), properties);
}
