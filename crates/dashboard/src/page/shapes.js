// Fence and walls: drawn corner by corner, changed, and taken by the robot as a whole.

/** Corners of a fence, and of a wall, at most. */
const MOST = { fence: 32, wall: 100 };

const rounded = (corners) => corners.map((corner) => corner.map((at) => Number(at.toFixed(3))));
const words = (corners) => `[${corners.map(([x, y]) => `[${x}, ${y}]`).join(", ")}]`;

export class Shapes {
  constructor(view, bar, { ask, refuse, buttons }) {
    this.view = view;
    this.bar = bar;
    this.ask = ask;
    this.refuse = refuse;
    this.buttons = buttons;
    /** The fence of the robot's file. */
    this.file = [];
    const { corner, x, y, less, take, remove, save, close } = bar.elements;
    bar.addEventListener("submit", (event) => event.preventDefault());
    corner.onchange = () => this.choose(Number(corner.value));
    for (const field of [x, y]) field.onchange = () => this.move(this.edit.chosen, [Number(x.value), Number(y.value)]);
    less.onclick = () => this.removeCorner();
    take.onclick = () => this.take();
    remove.onclick = () => this.removeWall();
    save.onclick = () => this.save();
    close.onclick = () => this.close();
    bar.addEventListener("keydown", (event) => event.key === "Escape" && this.close());
    buttons.fence.onclick = () => (this.kind === "fence" ? this.close() : this.open("fence", this.view.fence));
    buttons.wall.onclick = () => (this.kind === "wall" ? this.close() : this.open("wall", []));
    view.onSelectWall = (number) => this.open("wall", view.drawn[number], number);
  }

  get edit() {
    return this.view.edit;
  }

  get kind() {
    return this.edit?.kind;
  }

  /** Begins with these corners; a new shape has none. */
  open(kind, corners, number = null) {
    this.onOpen?.();
    const edit = { kind, number, corners: corners.map((corner) => [...corner]), chosen: corners.length - 1, isNew: !corners.length };
    edit.onMove = (chosen, place) => this.move(chosen, place);
    edit.onAdd = (place) => this.add(place);
    edit.onChoose = (chosen) => this.choose(chosen);
    this.view.edit = edit;
    this.fill();
    this.bar.elements.corner.focus({ preventScroll: true });
  }

  close() {
    const button = this.buttons[this.kind];
    this.view.edit = null;
    this.fill();
    button?.focus({ preventScroll: true });
  }

  choose(chosen) {
    this.edit.chosen = chosen;
    this.fill();
  }

  move(chosen, place) {
    if (!place.every(Number.isFinite) || !this.edit.corners[chosen]) return this.fill();
    this.edit.chosen = chosen;
    [this.edit.corners[chosen]] = rounded([place]);
    this.fill();
  }

  /** A new shape goes on from corner to corner; of one that is there the side that is nearest gets another corner. */
  add(place) {
    const { corners, isNew, kind } = this.edit;
    if (corners.length >= MOST[kind]) return this.refuse(`a ${kind} has at most ${MOST[kind]} corners`);
    const at = isNew ? corners.length : nearestSide(corners, place) + 1;
    corners.splice(at, 0, ...rounded([place]));
    this.choose(at);
  }

  removeCorner() {
    const { corners, chosen } = this.edit;
    corners.splice(chosen, 1);
    this.choose(Math.min(chosen, corners.length - 1));
  }

  /** The walls that are drawn, with this one among them. */
  drawn() {
    const { number, corners } = this.edit;
    const walls = [...this.view.drawn];
    walls.splice(number ?? walls.length, 1, corners);
    return walls;
  }

  async take() {
    const { kind, corners } = this.edit;
    if (corners.length < 3) return this.refuse(`a ${kind} has at least three corners`);
    const said = await this.ask(kind === "fence" ? { do: "set_fence", corners_m: corners } : { do: "set_walls", polygons_m: this.drawn() });
    if (said.done && this.edit?.corners === corners) this.close();
  }

  removeWall() {
    const { number } = this.edit;
    if (number !== null) this.ask({ do: "set_walls", polygons_m: this.view.drawn.filter((_, n) => n !== number) });
    this.close();
  }

  /** The lines of the robot's file that would change. */
  change() {
    const { kind, corners } = this.edit;
    const blocked = (all) => (all.length ? [`blocked_m = [${all.map((wall) => words(rounded(wall))).join(", ")}]`] : []);
    const { walls } = this.view;
    if (kind === "wall") return { table: "map", before: blocked(walls), after: blocked([...walls, ...this.drawn()]) };
    const before = this.file.length ? [`polygon_m = ${words(rounded(this.file))}`] : [];
    return { table: "fence", before, after: [`polygon_m = ${words(corners)}`] };
  }

  save() {
    const { table, after } = this.change();
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`[${table}]\n${after.join("\n")}\n`], { type: "application/toml" }));
    link.download = `${table}.toml`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  fill() {
    const { bar, edit, view } = this;
    view.draw();
    bar.hidden = !edit;
    for (const [kind, button] of Object.entries(this.buttons)) button.setAttribute("aria-pressed", this.kind === kind);
    view.canvas.style.cursor = edit ? "crosshair" : "";
    if (!edit) return;
    const { corner, x, y, less, take, remove, save } = bar.elements;
    if (corner.length !== edit.corners.length) corner.replaceChildren(...edit.corners.map((_, n) => new Option(n + 1, n)));
    corner.value = edit.chosen;
    const chosen = edit.corners[edit.chosen];
    [x.value, y.value] = chosen ?? ["", ""];
    for (const field of [corner, x, y, less]) field.disabled = !chosen;
    take.disabled = save.disabled = edit.corners.length < 3;
    take.textContent = edit.kind === "fence" ? "Take this fence" : "Take this wall";
    remove.hidden = edit.number === null;
    bar.setAttribute("aria-label", `The ${edit.kind}'s corners`);
    const { table, before, after } = this.change();
    const line = (sign, text) => Object.assign(document.createElement("div"), { className: sign === "+" ? "more" : "less", textContent: `${sign}${text}` });
    const isSame = before.join() === after.join();
    const lines = isSame ? ["as in the robot's file"] : [`[${table}]`, ...before.map((text) => line("-", text)), ...after.map((text) => line("+", text))];
    bar.querySelector(".diff").replaceChildren(...lines);
  }
}

/** The side of a polygon, by its first corner, that is nearest to a place. */
function nearestSide(corners, [x, y]) {
  const far = corners.map(([a, b], n) => {
    const [c, d] = corners[(n + 1) % corners.length];
    const square = (c - a) ** 2 + (d - b) ** 2 || 1;
    const part = Math.max(0, Math.min(1, ((x - a) * (c - a) + (y - b) * (d - b)) / square));
    return Math.hypot(x - a - part * (c - a), y - b - part * (d - b));
  });
  return far.indexOf(Math.min(...far));
}
