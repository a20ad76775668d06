// The sticks on the page and the browser's gamepads: the same kind of source.

import { write } from "./write.js";

const SEND_MS = 33;
const DEAD_ZONE = 0.12;

/** Arrow keys, as x and y. */
const KEYS = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };

/** A place to drag in, or to hold arrow keys at; gives x and y from -1 to 1, up is positive, while it is held. */
class Knob {
  constructor(element, axes) {
    this.element = element;
    this.knob = element.querySelector("i");
    this.axes = axes;
    this.x = 0;
    this.y = 0;
    this.pointer = null;
    this.keys = new Set();
    this.mayHold = false;
    element.addEventListener("keydown", (event) => {
      if (!KEYS[event.key]) return;
      event.preventDefault();
      if (event.repeat || !this.mayHold || this.pointer !== null) return;
      this.keys.add(event.key);
      this.press();
    });
    element.addEventListener("keyup", (event) => this.keys.delete(event.key) && this.press());
    // A key that is let go elsewhere isn't heard here.
    element.addEventListener("blur", () => this.keys.size && this.let_go());
    addEventListener("blur", () => this.keys.size && this.let_go());
    element.addEventListener("pointerdown", (event) => {
      if (this.held || !this.mayHold) return;
      this.pointer = event.pointerId;
      // Where it was taken hold of: what makes way on the page meanwhile doesn't move it.
      this.box = element.getBoundingClientRect();
      element.setPointerCapture(event.pointerId);
      this.move(event);
    });
    element.addEventListener("pointermove", (event) => event.pointerId === this.pointer && this.move(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(end, (event) => event.pointerId === this.pointer && this.let_go());
    }
    element.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  get held() {
    return this.pointer !== null || this.keys.size > 0;
  }

  /** How far the knob may be moved, pixels. */
  static reach(box, axes) {
    return axes === "x" ? box.width / 2 - box.height / 2 : box.width / 2 - 20;
  }

  press() {
    let [x, y] = [0, 0];
    for (const key of this.keys) [x, y] = [x + KEYS[key][0], y + (this.axes === "x" ? 0 : KEYS[key][1])];
    const far = Math.max(1, Math.hypot(x, y));
    this.show(x / far, y / far, Knob.reach(this.element.getBoundingClientRect(), this.axes));
  }

  move(event) {
    const { box } = this;
    const reach = Knob.reach(box, this.axes);
    let x = (event.clientX - box.left - box.width / 2) / reach;
    let y = this.axes === "x" ? 0 : -(event.clientY - box.top - box.height / 2) / reach;
    const far = Math.max(1, Math.hypot(x, y));
    this.show(x / far, y / far, reach);
  }

  let_go() {
    this.pointer = null;
    this.keys.clear();
    this.show(0, 0, 1);
  }

  show(x, y, reach) {
    this.x = x;
    this.y = y;
    this.element.classList.toggle("held", this.held);
    this.knob.style.transform = `translate(${x * reach}px, ${-y * reach}px)`;
  }
}

/** Full speed is full speed in every direction: many gamepads reach further in their corners. */
function within({ x, y, turn }) {
  const far = Math.max(1, Math.hypot(x, y));
  return { x: x / far, y: y / far, turn };
}

export class Sticks {
  constructor(link, { stick, turn, share, odom, gamepad }) {
    this.link = link;
    this.stick = new Knob(stick, "xy");
    this.turn = new Knob(turn, "x");
    this.share = share;
    this.odom = odom;
    this.gamepad = gamepad;
    this.was_held = false;
    this.may = false;
    this.couldDrive = false;
    /** Something is in hand that was so when nobody could drive: it must be let go before it counts. */
    this.mustLetGo = false;
    this.gamepadDrove = false;
    setInterval(() => this.tick(), SEND_MS);
  }

  get mayDrive() {
    return this.may && !document.hidden;
  }

  /** Who may not drive holds nothing. */
  set mayDrive(may) {
    this.may = may;
    for (const knob of [this.stick, this.turn]) {
      knob.mayHold = may;
      if (!may && knob.held) knob.let_go();
    }
  }

  /** Left stick: move, right stick: turn; a shoulder button is the dead-man button. */
  readGamepad() {
    const gamepad = [...(navigator.getGamepads?.() ?? [])].find((gamepad) => gamepad?.connected);
    write(this.gamepad, gamepad
      ? `${gamepad.id.slice(0, 40)}: hold a shoulder button to drive.`
      : "A gamepad at this device drives too, while its shoulder button is held.");
    this.hasGamepad = Boolean(gamepad);
    if (!gamepad || ![4, 5, 6, 7].some((button) => gamepad.buttons[button]?.pressed)) return null;
    const axis = (number) => {
      const value = gamepad.axes[number] ?? 0;
      const far = Math.max(0, Math.abs(value) - DEAD_ZONE) / (1 - DEAD_ZONE);
      return Math.sign(value) * Math.min(1, far);
    };
    return within({ x: -axis(1), y: -axis(0), turn: -axis(2) });
  }

  wish() {
    const gamepad = this.readGamepad();
    // One that goes while it drives is lost, as any other stick.
    const isLost = this.gamepadDrove && !this.hasGamepad;
    this.gamepadDrove = gamepad !== null;
    if (isLost) return "lost";
    if (gamepad) return gamepad;
    if (!this.stick.held && !this.turn.held) return null;
    return { x: this.stick.y, y: -this.stick.x, turn: -this.turn.x };
  }

  tick() {
    const wished = this.wish();
    const letsGo = this.mustLetGo && wished === null;
    this.mustLetGo = wished !== null && (this.mustLetGo || !this.mayDrive);
    const wish = this.mayDrive && !this.mustLetGo ? wished : null;
    if (wish === "lost") {
      this.link.send({ do: "lose_stick" });
    } else if (wish) {
      const share = Number(this.share.value) / 100;
      const clamp = (value) => Math.max(-1, Math.min(1, value * share));
      const frame = this.odom.checked ? "odom" : "body";
      this.link.send({ do: "stick", x: clamp(wish.x), y: clamp(wish.y), turn: clamp(wish.turn), frame });
    } else if (this.was_held || (this.mayDrive && wished === null && (letsGo || !this.couldDrive))) {
      // Let go; or enabled again, or a new session, with nothing in hand: the robot waits for that word.
      this.link.send({ do: "release_stick" });
    }
    this.was_held = wish !== null && wish !== "lost";
    this.couldDrive = this.mayDrive;
  }
}
