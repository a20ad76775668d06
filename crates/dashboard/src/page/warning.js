// The sound of a robot that will move again by itself: a tone each second until it does, or until somebody ends it.

const EACH_MS = 1000;
const LOOK_MS = 250;
const TONE_HZ = 1000;
const TONE_S = 0.2;
const LOUD = 0.5;

export class Warning {
  constructor() {
    this.context = null;
    this.timer = null;
    /** When the robot moves, by this page's clock. */
    this.moves_ms = -Infinity;
    this.next_ms = 0;
    // Browsers allow no sound before somebody touched the page.
    for (const gesture of ["pointerdown", "pointerup", "keydown"]) addEventListener(gesture, () => this.unlock(), true);
  }

  unlock() {
    try {
      this.context ??= new AudioContext();
      if (this.context.state !== "running") this.context.resume().catch(() => {});
    } catch {
      // A browser without sound: the banner says so.
    }
  }

  get isHeard() {
    return this.context?.state === "running";
  }

  /** In how many seconds the robot said that it moves; nothing where it won't. After its last word the tone goes on until then. */
  see(moves_in_s) {
    this.moves_ms = performance.now() + 1000 * (moves_in_s ?? -Infinity);
    if (moves_in_s != null) this.timer ??= setInterval(() => this.look(), LOOK_MS);
    this.look();
  }

  look() {
    const now_ms = performance.now();
    if (now_ms > this.moves_ms) {
      clearInterval(this.timer);
      this.timer = null;
    } else if (now_ms >= this.next_ms) {
      this.next_ms = now_ms + EACH_MS;
      this.unlock();
      if (this.isHeard) this.sound();
    }
  }

  sound() {
    const { context } = this, begin_s = context.currentTime, end_s = begin_s + TONE_S;
    const tone = new OscillatorNode(context, { frequency: TONE_HZ }), gain = new GainNode(context, { gain: 0 });
    // Up and down within 10 ms, without a click.
    gain.gain.setValueAtTime(0, begin_s).linearRampToValueAtTime(LOUD, begin_s + 0.01);
    gain.gain.setValueAtTime(LOUD, end_s - 0.01).linearRampToValueAtTime(0, end_s);
    tone.connect(gain).connect(context.destination);
    tone.start(begin_s);
    tone.stop(end_s);
  }
}
