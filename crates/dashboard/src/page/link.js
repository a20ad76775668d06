// The connection to the robot: messages in, calls out. What this page commands ends with this page.

const ALIVE_MS = 100;
export const AGAIN_MS = 500;
const WATCH_MS = 100;
/** What was seen longer ago is old. */
export const OLD_MS = 500;
/** A connection on which nothing came for so long is given up for a new one; one that is being made, after longer. */
const DEAD_MS = 3000;
const CONNECTING_MS = 10000;
/** Stamps of the robot that are remembered: those of some seconds. */
const STAMPS = 128;
/** What may be said into a line on which nothing is heard: it begins nothing. */
const HARMLESS = ["alive", "release_stick", "lose_stick"];

export class Link extends EventTarget {
  constructor() {
    super();
    this.number = 0;
    this.waiting = new Map();
    /** The robot's stamps, and when each came. */
    this.stamps = [];
    this.delay_ms = null;
    this.message_ms = null;
    this.heard_ms = null;
    this.connect();
    setInterval(() => this.send({ do: "alive" }), ALIVE_MS);
    setInterval(() => this.watch(), WATCH_MS);
  }

  connect() {
    const socket = new WebSocket(`ws://${location.host}/api/live`);
    this.socket = socket;
    this.since_ms = performance.now();
    socket.onmessage = (event) => this.hear(JSON.parse(event.data));
    socket.onopen = () => {
      this.since_ms = performance.now();
      this.tell("open");
    };
    socket.onclose = () => this.leave();
  }

  /** Gives the connection up; what waits for its answer is told so, and nothing of it is ever sent again. */
  leave() {
    this.socket.onmessage = this.socket.onopen = this.socket.onclose = null;
    this.socket.close();
    this.delay_ms = null;
    for (const answer of this.waiting.values()) answer({ done: false, text: "the connection was lost before an answer came" });
    this.waiting.clear();
    this.tell("lost");
    setTimeout(() => this.connect(), AGAIN_MS);
  }

  watch() {
    const since_ms = performance.now() - this.since_ms;
    if (this.isOpen && Math.min(since_ms, this.silent_ms) > DEAD_MS) this.leave();
    else if (this.socket.readyState === WebSocket.CONNECTING && since_ms > CONNECTING_MS) this.leave();
    this.tell("watched");
  }

  hear(message) {
    this.message_ms = performance.now();
    if ("stamp" in message) this.remember(message.stamp);
    if ("answer" in message) {
      this.waiting.get(message.answer)?.(message);
      this.waiting.delete(message.answer);
    } else if ("you" in message) {
      this.tell("welcome", message);
    } else if ("phase" in message) {
      // A robot whose clock stands says nothing new.
      if (message.time_s !== this.time_s) this.heard_ms = performance.now();
      this.time_s = message.time_s;
      this.delay_ms = message.delay_ms ?? null;
      this.tell("seen", message);
    }
  }

  remember(stamp) {
    this.stamps.push({ stamp, at_ms: performance.now() });
    if (this.stamps.length > STAMPS) this.stamps.shift();
  }

  /** The last stamp that was there at a moment of this page's clock. */
  stampAt(at_ms) {
    const known = this.stamps.findLast((one) => one.at_ms <= at_ms) ?? this.stamps[0];
    return known?.stamp;
  }

  tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  get isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  /** How long no message came, whatever it says. */
  get silent_ms() {
    return performance.now() - this.message_ms;
  }

  /** How old what is seen is; nothing where nothing was seen yet. */
  get age_ms() {
    return this.heard_ms === null ? null : performance.now() - this.heard_ms;
  }

  /** Nothing is heard: nobody knows whether what is said arrives. */
  get isSilent() {
    return !this.isOpen || this.age_ms === null || this.age_ms > OLD_MS;
  }

  /** What is seen is no longer true, because nothing came or because all of it comes late. */
  get isOld() {
    return this.isSilent || this.delay_ms > OLD_MS;
  }

  get whySilent() {
    if (!this.isOpen) return "there is no connection";
    return this.age_ms === null ? "nothing was heard of the robot yet" : `nothing was heard of the robot for ${(this.age_ms / 1000).toFixed(1)} s`;
  }

  /** Sends without waiting for an answer. A page whose line is full or silent keeps silent: wishes must not pile up. */
  send(call) {
    if (this.isSilent && !HARMLESS.includes(call.do)) return;
    if (this.isOpen && this.socket.bufferedAmount < 65536) this.write(call, performance.now());
  }

  /** Sends what was pressed then, and gives the answer: {done, text}. What can't be sent at once is never sent. */
  call(call, pressed_ms = performance.now()) {
    if (this.isSilent) return Promise.resolve({ done: false, text: `not sent: ${this.whySilent}` });
    return this.say(call, pressed_ms);
  }

  /** As a call, however silent the line is: for stops. */
  say(call, pressed_ms = performance.now()) {
    if (!this.isOpen) return Promise.resolve({ done: false, text: "there is no connection" });
    const number = ++this.number;
    return new Promise((answer) => {
      this.waiting.set(number, answer);
      this.write({ number, ...call }, pressed_ms);
    });
  }

  write(call, pressed_ms) {
    this.socket.send(JSON.stringify({ stamp: this.stampAt(pressed_ms), ...call }));
  }
}

/** The second way: a request of its own. Gives the answer as a call does. */
export async function post(call, patience_ms) {
  try {
    const body = JSON.stringify(call), signal = AbortSignal.timeout(patience_ms);
    const answer = await fetch("/api/call", { method: "POST", body, signal, cache: "no-store" });
    const text = await answer.text();
    try {
      const { done, text: words } = JSON.parse(text);
      return { done: done === true, text: String(words) };
    } catch {
      return { done: false, text };
    }
  } catch {
    return { done: false, text: "there is no connection" };
  }
}

export async function read(what) {
  const answer = await fetch(`/api/${what}`, { signal: AbortSignal.timeout(CONNECTING_MS) });
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}
