// Live plots of any signals over the last seconds.

import { write } from "./write.js";

const SECONDS = 20;
const COLOURS = ["--s1", "--s2", "--s3", "--s4", "--s5", "--s6"];

export class Plots {
  /** `shown` is how a signal's name is shown. */
  constructor(element, columns, shown) {
    this.element = element;
    this.columns = columns;
    this.shown = shown;
    this.times = [];
    this.rows = [];
    this.plots = [];
  }

  add(names) {
    const plot = new Plot(this, names.filter((name) => this.columns.includes(name)));
    this.plots.push(plot);
    this.element.append(plot.element);
  }

  remove(plot) {
    plot.element.remove();
    this.plots = this.plots.filter((other) => other !== plot);
  }

  take(time, values) {
    if (this.times.length && time <= this.times.at(-1)) {
      if (time < this.times.at(-1)) this.times = this.rows = [];
      else return;
    }
    this.times.push(time);
    this.rows.push(values);
    const old = this.times.findIndex((t) => t > time - SECONDS - 1);
    if (old > 60) {
      this.times.splice(0, old);
      this.rows.splice(0, old);
    }
  }

  draw() {
    for (const plot of this.plots) plot.draw();
  }
}

class Plot {
  constructor(plots, names) {
    this.plots = plots;
    this.names = names;
    this.element = document.createElement("div");
    this.element.className = "plot";
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.keys = document.createElement("div");
    this.keys.className = "keys";
    const bar = document.createElement("div");
    bar.className = "bar";
    const choice = document.createElement("select");
    choice.setAttribute("aria-label", "add a signal to this plot");
    choice.append(new Option("add a signal…", ""), ...plots.columns.map((name) => new Option(plots.shown(name), name)));
    choice.onchange = () => {
      if (choice.value && !this.names.includes(choice.value)) this.names.push(choice.value);
      choice.value = "";
      this.legend();
    };
    const close = document.createElement("button");
    close.textContent = "×";
    close.title = "Remove this plot";
    close.setAttribute("aria-label", "Remove this plot");
    close.onclick = () => plots.remove(this);
    bar.append(choice, close);
    this.element.append(bar, this.canvas, this.keys);
    this.legend();
  }

  legend() {
    const names = this.names.map(this.plots.shown).join(", ");
    this.canvas.setAttribute("aria-label", `Plot of ${names || "no signal yet"} over the last ${SECONDS} s`);
    this.keys.replaceChildren(
      ...this.names.map((name, n) => {
        const key = document.createElement("button");
        key.style.color = `var(${COLOURS[n % COLOURS.length]})`;
        key.title = "Remove from this plot";
        key.onclick = () => {
          this.names = this.names.filter((other) => other !== name);
          this.legend();
        };
        return key;
      }),
    );
  }

  draw() {
    const { canvas, plots: { times, rows, columns } } = this;
    const ratio = devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    const { top, bottom: end_px } = canvas.getBoundingClientRect();
    if (!w || end_px < 0 || top > innerHeight) return;
    if (canvas.width !== Math.round(w * ratio)) [canvas.width, canvas.height] = [Math.round(w * ratio), Math.round(h * ratio)];
    const g = canvas.getContext("2d");
    const style = getComputedStyle(canvas);
    const colour = (name) => style.getPropertyValue(name);
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, w, h);
    const end = times.at(-1) ?? 0, from = times.findIndex((t) => t >= end - SECONDS);
    const places = this.names.map((name) => columns.indexOf(name));
    let low = Infinity, high = -Infinity;
    for (let n = Math.max(0, from); n < rows.length; n++) {
      for (const place of places) {
        const value = rows[n][place];
        if (value !== null && value < low) low = value;
        if (value !== null && value > high) high = value;
      }
    }
    if (low > high) [low, high] = [0, 1];
    // What never changed has no scale of its own.
    const least = low === high ? Math.max(1, 0.2 * Math.abs(low)) : Math.max(1e-6, 1e-3 * Math.max(Math.abs(low), Math.abs(high)));
    if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
    const room = 0.08 * (high - low);
    [low, high] = [low - room, high + room];
    const left = 58, bottom = h - 18;
    const x = (time) => left + ((time - end + SECONDS) / SECONDS) * (w - left - 4);
    const y = (value) => 4 + ((high - value) / (high - low)) * (bottom - 4);
    g.font = "11px system-ui, sans-serif";
    g.fillStyle = colour("--dim");
    g.strokeStyle = colour("--grid");
    g.lineWidth = 1;
    const step = nice((high - low) / 4);
    const digits = Math.max(0, Math.min(9, -Math.floor(Math.log10(step))));
    g.textAlign = "right";
    for (let n = Math.ceil(low / step); n * step <= high; n++) {
      g.beginPath();
      g.moveTo(left, y(n * step));
      g.lineTo(w, y(n * step));
      g.stroke();
      g.fillText(step < 1e-4 || step >= 1e5 ? (n * step).toExponential(1) : (n * step).toFixed(digits), left - 4, y(n * step) + 4);
    }
    g.textAlign = "center";
    for (let s = 0; s <= SECONDS; s += 5) g.fillText(s ? `-${s} s` : "now", Math.min(w - 14, x(end - s)), h - 4);
    places.forEach((place, n) => {
      g.beginPath();
      g.strokeStyle = colour(COLOURS[n % COLOURS.length]);
      g.lineWidth = 1.6;
      let down = false;
      for (let row = Math.max(0, from); row < rows.length; row++) {
        const value = rows[row][place];
        if (value === null) down = false;
        else if (down) g.lineTo(x(times[row]), y(value));
        else (down = true), g.moveTo(x(times[row]), y(value));
      }
      g.stroke();
      const key = this.keys.children[n], now = rows.at(-1)?.[place];
      if (key) write(key, `${this.plots.shown(this.names[n])} ${now === null || now === undefined ? "–" : Number(now.toPrecision(4))}`);
    });
  }
}

/** A step of 1, 2 or 5 times a power of ten. */
function nice(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return power * ([1, 2, 5, 10].find((n) => n * power >= step) ?? 10);
}
