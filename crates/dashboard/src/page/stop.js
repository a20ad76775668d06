// STOP: it says itself what became of it, and is tried over both ways until it is heard or the person gives it up.

import { post } from "./link.js";

const STOP = { do: "emergency_stop" };
const LOOK_MS = 50;
/** Without an answer for so long the second way is tried too. */
const SECOND_WAY_MS = 150;
/** Without an answer for so long the person must know. */
const UNHEARD_MS = 500;
/** A request that was lost is sent again after so long, one that failed after less. */
const AGAIN_MS = 2000;
const FAILED_MS = 300;
/** A slow line may still carry a request after so long. */
const PATIENCE_MS = 10000;
/** What was seen may be so much older than the answer. */
const SETTLE_MS = 300;
const OTHERWISE = "use the emergency stop on the machine";

export class StopButton {
  constructor(button, link) {
    this.button = button;
    this.word = button.querySelector("b");
    this.more = button.querySelector("small");
    this.link = link;
    /** When it was pressed; nothing where nobody waits for it to be heard. */
    this.pressed_ms = null;
    this.heard_ms = null;
    this.isSet = false;
    this.refusal = "";
    /** The connection on which it was said; said once, it stays in there until it arrives or the connection ends. */
    this.saidOn = null;
    this.nextPost_ms = 0;
    button.addEventListener("pointerdown", () => this.press());
    // The keyboard's click; that of a pointer was its pointerdown.
    button.addEventListener("click", (event) => event.detail === 0 && this.press());
    setInterval(() => this.look(), LOOK_MS);
    this.show();
  }

  press() {
    this.pressed_ms ??= performance.now();
    this.refusal = "";
    this.saidOn = null;
    this.nextPost_ms = 0;
    this.look();
  }

  /** The person lets it go: it isn't tried any more. */
  giveUp() {
    this.pressed_ms = null;
    this.show();
  }

  get isUnheard() {
    return this.pressed_ms !== null && (this.link.isSilent || this.waited_ms > UNHEARD_MS || this.refusal !== "");
  }

  get waited_ms() {
    return performance.now() - this.pressed_ms;
  }

  look() {
    if (this.pressed_ms !== null) this.try();
    this.show();
  }

  try() {
    if (this.link.isOpen && this.saidOn !== this.link.socket) {
      this.saidOn = this.link.socket;
      this.link.say(STOP).then((said) => this.answered(said));
    }
    const now_ms = performance.now(), isDue = this.link.isSilent || this.waited_ms > SECOND_WAY_MS;
    if (!isDue || now_ms < this.nextPost_ms) return;
    this.nextPost_ms = now_ms + AGAIN_MS;
    post(STOP, PATIENCE_MS).then((said) => {
      this.nextPost_ms = Math.min(this.nextPost_ms, performance.now() + FAILED_MS);
      this.answered(said);
    });
  }

  answered({ done, text }) {
    if (done) this.heard();
    else if (text.startsWith("refused")) this.refusal = text;
    this.show();
  }

  heard() {
    if (this.pressed_ms !== null) this.heard_ms = performance.now();
    this.pressed_ms = null;
  }

  /** What the robot says of it. */
  see(isSet) {
    if (isSet) this.heard();
    if (isSet || performance.now() - this.heard_ms > SETTLE_MS) this.isSet = isSet;
    if (!isSet && !this.isSet) this.heard_ms = null;
    this.show();
  }

  show() {
    const [state, word, more] = this.state();
    if (this.button.dataset.state === state && this.more.textContent === more) return;
    this.button.dataset.state = state;
    this.word.textContent = word;
    this.more.textContent = more;
    this.button.dispatchEvent(new Event("said"));
  }

  state() {
    const { link } = this;
    if (this.pressed_ms !== null && !this.isUnheard) return ["stopping", "STOPPING", ""];
    if (this.pressed_ms !== null) {
      const why = this.refusal || (link.isSilent ? "no connection" : "no answer");
      return ["unheard", "NOT SENT", `${why} – ${OTHERWISE}`];
    }
    if (link.isSilent && this.heard_ms !== null) {
      const ago_s = (performance.now() - this.heard_ms) / 1000;
      return ["stopped", "STOPPED", `heard ${ago_s.toFixed(0)} s ago; no connection`];
    }
    if (link.isSilent) return ["silent", "STOP", "no connection"];
    return this.isSet || this.heard_ms !== null ? ["stopped", "STOPPED", ""] : ["ready", "STOP", ""];
  }
}
