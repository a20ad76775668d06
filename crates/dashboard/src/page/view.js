// The top view: where the platform shall be, believes to be, and is.

const TRAIL = 6000;
const COLOURS = ["planned", "believed", "truth", "grid", "line", "ink", "dim", "bad", "card", "warn"];

/** What keys do in the view: steps along x and y, and by how much it grows. */
const KEYS = {
  ArrowLeft: [-1, 0, 1], ArrowRight: [1, 0, 1], ArrowUp: [0, 1, 1], ArrowDown: [0, -1, 1], "+": [0, 0, 1.25], "=": [0, 0, 1.25], "-": [0, 0, 0.8],
};

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.centre = [0, 0];
    this.scale = 120;
    this.follow = true;
    this.planned = [];
    /** The speed at each of its places, m/s. */
    this.speeds = [];
    /** The room: a picture of its cells, and where that lies. */
    this.map = null;
    this.walls = [];
    /** Walls that were drawn here. */
    this.drawn = [];
    /** The fence or wall that is being drawn or changed: its corners, which of them is chosen, and who is told. */
    this.edit = null;
    /** Where it goes by the straight way. */
    this.goal = null;
    this.trail = [];
    this.obstacles = [];
    this.wheels = [];
    this.footprint = [];
    this.pose = null;
    this.truth = null;
    /** The pose that was drawn last. */
    this.shown = null;
    this.fence = [];
    /** What the footprint keeps from the fence now, m. */
    this.kept = null;
    this.onPick = null;
    this.onDrag = null;
    this.onDrop = null;
    this.onRemove = null;
    this.onSelect = null;
    /** The obstacle that is being changed. */
    this.selected = null;
    this.pointers = new Map();
    this.listen();
    new ResizeObserver(() => this.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.colours = null;
      this.draw();
    });
    this.resize();
  }

  resize() {
    // Kept: to ask the canvas for each point of a line has the browser lay out the page anew.
    ({ clientWidth: this.width, clientHeight: this.height } = this.canvas);
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.max(1, this.width * ratio);
    this.canvas.height = Math.max(1, this.height * ratio);
    this.ratio = ratio;
    this.draw();
  }

  robot(facts) {
    this.wheels = facts.wheels;
    this.fence = facts.fence;
    this.footprint = facts.footprint;
    const reach = Math.max(0.2, ...this.footprint.map(([x, y]) => Math.hypot(x, y)));
    this.scale = Math.min(this.canvas.clientWidth, this.canvas.clientHeight) / (8 * reach);
  }

  /** The map's cells as a picture, made once; rows come from below. */
  room({ size: [width, height], cell_m, odom_from_grid, rows, blocked_m, walls_m }) {
    this.walls = blocked_m;
    this.drawn = walls_m;
    this.map = null;
    if (width) {
      const picture = new OffscreenCanvas(width, height), g = picture.getContext("2d");
      for (const [row, runs] of rows.entries()) {
        let at = 0;
        for (const [n, count] of runs.entries()) {
          if (n % 2) g.fillRect(at, height - 1 - row, count, 1);
          at += count;
        }
      }
      this.map = { picture, width, height, cell_m, pose: odom_from_grid, colour: null };
    }
    this.draw();
  }

  add(pose, truth) {
    const last = this.trail.at(-1);
    this.pose = pose;
    this.truth = truth;
    if (!last || Math.hypot(last[0][0] - pose[0], last[0][1] - pose[1]) > 0.004) {
      this.trail.push([pose, truth]);
      if (this.trail.length > TRAIL) this.trail.splice(0, TRAIL / 10);
    }
    if (this.follow && !this.pointers.size) {
      const [x, y] = this.toScreen(pose);
      const { width: w, height: h } = this;
      if (x < w * 0.2 || x > w * 0.8 || y < h * 0.2 || y > h * 0.8) {
        this.centre = [lerp(this.centre[0], pose[0], 0.15), lerp(this.centre[1], pose[1], 0.15)];
      }
    }
  }

  /** Whether the platform has moved by a pixel since it was drawn. */
  get hasMoved() {
    if (!this.pose || !this.shown) return this.pose !== this.shown;
    const [x, y, heading] = this.pose.map((value, n) => value - this.shown[n]);
    const reach = Math.max(...this.footprint.map(([x, y]) => Math.hypot(x, y)), 0.1);
    return (Math.hypot(x, y) + reach * Math.abs(heading)) * this.scale >= 1;
  }

  fit() {
    const points = [...this.planned, ...this.fence, ...this.mapCorners(), ...this.walls.flat(), ...this.trail.map(([pose]) => pose), this.pose ?? [0, 0]];
    const reach = Math.max(0.5, ...this.footprint.map(([x, y]) => Math.hypot(x, y)));
    const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    this.centre = [(left + right) / 2, (low + high) / 2];
    const { width: w, height: h } = this;
    this.scale = Math.min(w / (right - left + 2.6 * reach), (h - 60) / (high - low + 2.6 * reach));
    this.follow = false;
    this.draw();
  }

  toScreen([x, y]) {
    const { width: w, height: h } = this;
    return [w / 2 + (x - this.centre[0]) * this.scale, h / 2 - (y - this.centre[1]) * this.scale];
  }

  toWorld(px, py) {
    const { width: w, height: h } = this;
    return [(px - w / 2) / this.scale + this.centre[0], (h / 2 - py) / this.scale + this.centre[1]];
  }

  listen() {
    const at = (event) => {
      const area = this.canvas.getBoundingClientRect();
      return [event.clientX - area.left, event.clientY - area.top];
    };
    const touched = (event) => {
      const [x, y] = this.toWorld(...at(event));
      return this.obstacles.find((o) => Math.hypot(o.x - x, o.y - y) <= Math.max(o.radius, 12 / this.scale));
    };
    const corner = (event) => {
      const [x, y] = at(event), reach = event.pointerType === "touch" ? 24 : 12;
      const far = (this.edit?.corners ?? []).map((place) => Math.hypot(...this.toScreen(place).map((v, n) => v - [x, y][n])));
      const nearest = far.indexOf(Math.min(...far));
      return far[nearest] <= reach ? nearest : null;
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, at(event));
      this.moved = false;
      this.held = this.pointers.size === 1 ? corner(event) : null;
      this.dragged = this.pointers.size === 1 && !this.edit ? touched(event) : null;
    });
    this.canvas.addEventListener("pointermove", (event) => {
      const before = this.pointers.get(event.pointerId);
      if (!before) return;
      const now = at(event);
      if (Math.hypot(now[0] - before[0], now[1] - before[1]) > 3) this.moved = true;
      if (!this.moved) return;
      if (this.held !== null && this.edit) {
        this.edit.onMove(this.held, this.toWorld(...now));
      } else if (this.dragged) {
        [this.dragged.x, this.dragged.y] = this.toWorld(...now);
        this.onDrag?.(this.dragged);
      } else if (this.pointers.size === 1) {
        this.centre[0] -= (now[0] - before[0]) / this.scale;
        this.centre[1] += (now[1] - before[1]) / this.scale;
        this.setFollow(false);
      } else {
        const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
        const far = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
        this.zoom(far(now) / Math.max(1, far(before)));
      }
      this.pointers.set(event.pointerId, now);
      this.draw();
    });
    const end = (event) => {
      if (!this.pointers.delete(event.pointerId)) return;
      if (this.dragged && event.type === "pointerup") (this.moved ? this.onDrop : this.onSelect)?.(this.dragged);
      if (event.type === "pointerup" && !this.moved && !this.dragged) this.tap(at(event), event.timeStamp);
      this.dragged = this.held = null;
    };
    this.canvas.addEventListener("pointerup", end);
    this.canvas.addEventListener("pointercancel", end);
    this.canvas.addEventListener("dblclick", (event) => {
      const obstacle = this.edit ? null : touched(event);
      if (obstacle) this.onRemove?.(obstacle);
    });
    this.canvas.addEventListener("keydown", (event) => {
      const step = 40 / this.scale;
      const [x, y, by] = KEYS[event.key] ?? [];
      if (by === undefined) return;
      event.preventDefault();
      this.centre = [this.centre[0] + x * step, this.centre[1] + y * step];
      this.setFollow(false);
      this.zoom(by);
    });
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
  }

  /** A tap that isn't on an obstacle. */
  tap(at, pressed_ms) {
    const place = this.toWorld(...at);
    if (this.edit) return this.held !== null ? this.edit.onChoose(this.held) : this.edit.onAdd(place);
    if (this.onPick) return this.onPick(place, pressed_ms);
    const wall = this.drawn.findIndex((corners) => holds(corners, place));
    if (wall >= 0) this.onSelectWall?.(wall);
  }

  zoom(by) {
    this.scale = Math.max(5, Math.min(4000, this.scale * by));
    this.draw();
  }

  setFollow(on) {
    this.follow = on;
    this.onFollow?.(on);
  }

  draw() {
    const g = this.context;
    this.shown = this.pose;
    this.canvas.dataset.scale = this.scale.toFixed(3);
    this.canvas.dataset.centre_m = this.centre.map((metres) => metres.toFixed(4)).join(" ");
    this.colours ??= Object.fromEntries(
      COLOURS.map((name) => [name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`)]),
    );
    const c = this.colours;
    g.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    g.clearRect(0, 0, this.width, this.height);
    this.drawMap(g, c);
    this.drawGrid(g, c);
    if (this.fence.length) this.drawLine(g, [...this.fence, this.fence[0]], c.bad, 2);
    g.setLineDash([7, 5]);
    if (this.fence.length && this.kept > 0) this.drawLine(g, inset(this.fence, this.kept), c.bad, 1);
    this.drawLine(g, this.planned, c.planned, 2);
    g.setLineDash([]);
    this.drawSpeeds(g);
    g.setLineDash([7, 5]);
    if (this.goal && this.pose) this.drawLine(g, [this.pose, this.goal], c.planned, 2);
    g.setLineDash([]);
    if (this.goal) this.drawGoal(g, c);
    this.drawLine(g, this.trail.map(([, truth]) => truth).filter(Boolean), c.truth, 4);
    this.drawLine(g, this.trail.map(([pose]) => pose), c.believed, 2);
    for (const o of this.obstacles) {
      const [x, y] = this.toScreen([o.x, o.y]);
      g.beginPath();
      g.arc(x, y, Math.max(3, o.radius * this.scale), 0, 2 * Math.PI);
      g.fillStyle = c.warn;
      g.globalAlpha = 0.45;
      g.fill();
      g.globalAlpha = 1;
      g.strokeStyle = o.index === this.selected ? c.ink : c.warn;
      g.lineWidth = o.index === this.selected ? 3 : 1.5;
      g.stroke();
      // Where it will be in a second.
      if (Math.hypot(...o.velocity) > 0) line(g, x, y, ...this.toScreen([o.x + o.velocity[0], o.y + o.velocity[1]]));
    }
    if (this.truth) this.drawRobot(g, this.truth, c.truth, c);
    if (this.pose) this.drawRobot(g, this.pose, c.believed, c);
    if (this.edit) this.drawEdit(g, c);
  }

  /** What is being drawn or changed: its sides, its corners to hold, the chosen one filled. */
  drawEdit(g, c) {
    const { corners, chosen } = this.edit;
    g.setLineDash([7, 5]);
    if (corners.length) this.drawLine(g, [...corners, corners[0]], c.ink, 2);
    g.setLineDash([]);
    for (const [n, corner] of corners.entries()) {
      g.beginPath();
      g.arc(...this.toScreen(corner), 7, 0, 2 * Math.PI);
      g.fillStyle = n === chosen ? c.believed : c.card;
      g.fill();
      g.strokeStyle = c.ink;
      g.lineWidth = 2;
      g.stroke();
    }
  }

  mapCorners() {
    if (!this.map) return [];
    const { width, height, cell_m, pose: [x, y, turn] } = this.map;
    const place = (u, v) => [x + Math.cos(turn) * u - Math.sin(turn) * v, y + Math.sin(turn) * u + Math.cos(turn) * v];
    return [[0, 0], [width, 0], [width, height], [0, height]].map(([u, v]) => place(u * cell_m, v * cell_m));
  }

  drawMap(g, c) {
    g.fillStyle = c.line;
    for (const wall of this.walls) {
      g.beginPath();
      for (const corner of wall) g.lineTo(...this.toScreen(corner));
      g.fill();
    }
    g.fillStyle = c.planned;
    for (const wall of this.drawn) {
      g.beginPath();
      for (const corner of wall) g.lineTo(...this.toScreen(corner));
      g.fill();
    }
    if (!this.map) return;
    const { picture, width, height, cell_m, pose } = this.map;
    if (this.map.colour !== c.line) {
      const ink = picture.getContext("2d");
      ink.globalCompositeOperation = "source-in";
      ink.fillStyle = c.line;
      ink.fillRect(0, 0, width, height);
      this.map.colour = c.line;
    }
    g.save();
    g.translate(...this.toScreen(pose));
    g.rotate(-pose[2]);
    const scale = cell_m * this.scale;
    g.imageSmoothingEnabled = scale < 1;
    g.drawImage(picture, 0, -height * scale, width * scale, height * scale);
    g.restore();
  }

  /** How fast it is planned to be, from the slow colour to the fast one. */
  drawSpeeds(g) {
    const most = Math.max(...this.speeds, 0);
    if (most <= 0 || this.speeds.length !== this.planned.length) return;
    g.lineCap = "round";
    const places = this.planned.map((place) => this.toScreen(place));
    // What binds it, as a border around its speed.
    const { limits = [], at = [] } = this.binds ?? {};
    g.lineWidth = 10;
    for (let n = 1; n < places.length; n++) {
      if (at[n] == null) continue;
      g.strokeStyle = limits[at[n]].colour;
      line(g, ...places[n - 1], ...places[n]);
    }
    g.lineWidth = 4;
    for (let n = 1; n < places.length; n++) {
      g.strokeStyle = `hsl(${230 - 230 * (this.speeds[n] / most)} 75% 50%)`;
      line(g, ...places[n - 1], ...places[n]);
    }
    g.lineCap = "butt";
  }

  drawGrid(g, c) {
    const { width: w, height: h } = this;
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20].find((step) => step * this.scale >= 45) ?? 50;
    const [left, top] = this.toWorld(0, 0), [right, low] = this.toWorld(w, h);
    g.lineWidth = 1;
    g.font = "11px system-ui, sans-serif";
    g.fillStyle = c.dim;
    const label = (value) => `${Number(value.toFixed(2))} m`;
    for (let n = Math.ceil(left / step); n * step <= right; n++) {
      const x = this.toScreen([n * step, 0])[0];
      g.strokeStyle = n === 0 ? c.line : c.grid;
      line(g, x, 0, x, h);
      g.fillText(label(n * step), x + 3, h - 5);
    }
    for (let n = Math.ceil(low / step); n * step <= top; n++) {
      const y = this.toScreen([0, n * step])[1];
      g.strokeStyle = n === 0 ? c.line : c.grid;
      line(g, 0, y, w, y);
      if (y > 60 && y < h - 20) g.fillText(label(n * step), 4, y - 3);
    }
  }

  drawLine(g, points, colour, width) {
    if (points.length < 2) return;
    g.beginPath();
    for (const point of points) g.lineTo(...this.toScreen(point));
    g.strokeStyle = colour;
    g.lineWidth = width;
    g.lineJoin = "round";
    g.stroke();
  }

  drawGoal(g, c) {
    const [x, y] = this.toScreen(this.goal);
    g.strokeStyle = c.planned;
    g.lineWidth = 2;
    line(g, x - 8, y, x + 8, y);
    line(g, x, y - 8, x, y + 8);
    g.beginPath();
    g.arc(x, y, 5, 0, 2 * Math.PI);
    g.stroke();
  }

  drawRobot(g, [x, y, heading], colour, c) {
    const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
    const place = ([u, v]) => this.toScreen([x + cos * u - sin * v, y + sin * u + cos * v]);
    const shape = (points, fill, alpha) => {
      g.beginPath();
      for (const point of points) g.lineTo(...place(point));
      g.closePath();
      g.globalAlpha = alpha;
      g.fillStyle = fill;
      g.fill();
      g.globalAlpha = 1;
      g.strokeStyle = colour;
      g.lineWidth = 1.5;
      g.stroke();
    };
    shape(this.footprint, colour, 0.15);
    for (const wheel of this.wheels) shape(corners(wheel), c.ink, 0.35);
    const reach = Math.max(...this.footprint.map(([u, v]) => Math.hypot(u, v)), 0.1);
    g.strokeStyle = colour;
    g.lineWidth = 2.5;
    line(g, ...place([0, 0]), ...place([0.7 * reach, 0]));
    line(g, ...place([0.7 * reach, 0]), ...place([0.55 * reach, 0.09 * reach]));
    line(g, ...place([0.7 * reach, 0]), ...place([0.55 * reach, -0.09 * reach]));
  }
}

function line(g, x0, y0, x1, y1) {
  g.beginPath();
  g.moveTo(x0, y0);
  g.lineTo(x1, y1);
  g.stroke();
}

/** Whether a place lies inside a polygon: a ray from it crosses its sides an odd number of times. */
function holds(corners, [x, y]) {
  return corners.filter(([a, b], n) => {
    const [c, d] = corners[(n + 1) % corners.length];
    return (b > y) !== (d > y) && x < a + ((y - b) / (d - b)) * (c - a);
  }).length % 2 === 1;
}

const lerp = (a, b, share) => a + (b - a) * share;

/** The corners of a wheel seen from above. */
function corners({ position_m: [x, y], rolling: [u, v], radius_m: radius }) {
  const length = Math.hypot(u, v) || 1;
  const [a, b] = [(u / length) * radius, (v / length) * radius];
  const [p, q] = [-b * 0.35, a * 0.35];
  return [[x + a + p, y + b + q], [x - a + p, y - b + q], [x - a - p, y - b - q], [x + a - p, y + b - q]];
}

/** A closed polygon whose sides lie further inside by a distance; its corners where those sides meet. */
function inset(polygon, distance) {
  const count = polygon.length;
  const at = (n) => polygon[(n + count) % count];
  const area = polygon.reduce((sum, [x, y], n) => sum + x * at(n + 1)[1] - y * at(n + 1)[0], 0);
  const inwards = (n) => {
    const [[x, y], [u, v]] = [at(n), at(n + 1)];
    const size = Math.sign(area) * Math.hypot(u - x, v - y);
    return [(y - v) / size, (u - x) / size];
  };
  const corners = polygon.map(([x, y], n) => {
    const [[a, b], [c, d]] = [inwards(n - 1), inwards(n)];
    const part = distance / Math.max(0.1, 1 + a * c + b * d);
    return [x + part * (a + c), y + part * (b + d)];
  });
  return [...corners, corners[0]];
}
