// Obstacles on the floor: put, dragged, changed and taken away.

const RADIUS_M = 0.2;
/** Often enough to look smooth, and no flood. */
const DRAG_MS = 50;
/** So long after a drop what is seen may be older than the drop. */
const STALE_MS = 500;

const change = ({ index, x, y, radius, velocity }) =>
  ({ do: "set_obstacle", index, centre_m: [x, y], radius_m: radius, velocity_m_s: velocity });

export class Obstacles {
  constructor(view, bar, { ask, send, refuse }) {
    this.view = view;
    this.bar = bar;
    this.ask = ask;
    this.refuse = refuse;
    this.all = [];
    let draggedAt = 0;
    view.onDrag = (obstacle) => {
      if (performance.now() - draggedAt < DRAG_MS) return;
      draggedAt = performance.now();
      send(change(obstacle));
    };
    this.dropped = null;
    view.onDrop = (obstacle) => {
      const { index, x, y } = obstacle;
      this.dropped = { index, x, y, until: performance.now() + STALE_MS };
      ask(change(obstacle));
    };
    view.onRemove = ({ index }) => ask({ do: "remove_obstacle", index });
    view.onSelect = ({ index }) => this.select(index);
    const { radius, vx, vy, remove, close } = bar.elements;
    bar.addEventListener("submit", (event) => event.preventDefault());
    bar.addEventListener("change", () => {
      const velocity = [Number(vx.value), Number(vy.value)];
      if (this.chosen) ask(change({ ...this.chosen, radius: Number(radius.value), velocity }));
    });
    remove.onclick = () => this.chosen && ask({ do: "remove_obstacle", index: this.chosen.index });
    close.onclick = () => this.select(null);
  }

  get chosen() {
    const found = this.all.find(({ index }) => index === this.view.selected) ?? null;
    // One that was dropped a moment ago must not jump back to where it was seen last.
    const { index, until, x, y } = this.dropped ?? {};
    return found && found.index === index && performance.now() < until ? { ...found, x, y } : found;
  }

  put([x, y], places) {
    const taken = new Set(this.all.map(({ index }) => index));
    const free = [...Array(places).keys()].find((index) => !taken.has(index));
    if (free === undefined) this.refuse("there is no place for another obstacle");
    else this.ask(change({ index: free, x, y, radius: RADIUS_M, velocity: [0, 0] }));
  }

  select(index) {
    this.view.selected = index;
    this.fill();
  }

  show(all) {
    this.all = all;
    if (!this.view.dragged) this.view.obstacles = all;
    this.fill();
  }

  fill() {
    const { bar, chosen } = this;
    bar.hidden = !chosen;
    if (!chosen || bar.contains(document.activeElement)) return;
    const { radius, vx, vy } = bar.elements;
    [radius.value, vx.value, vy.value] = [chosen.radius, ...chosen.velocity].map((n) => Number(n.toFixed(3)));
  }
}
