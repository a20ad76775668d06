// The connection to the robot: messages in, calls out. What this page commands ends with this page.

const ALIVE_MS = 100;
const AGAIN_MS = 500;

export class Link extends EventTarget {
  constructor() {
    super();
    this.number = 0;
    this.waiting = new Map();
    this.connect();
    setInterval(() => this.send({ do: "alive" }), ALIVE_MS);
  }

  connect() {
    const socket = new WebSocket(`ws://${location.host}/api/live`);
    this.socket = socket;
    socket.onmessage = (event) => this.hear(JSON.parse(event.data));
    socket.onopen = () => this.tell("open");
    socket.onclose = () => {
      for (const answer of this.waiting.values()) answer({ done: false, text: "the connection was lost" });
      this.waiting.clear();
      this.tell("lost");
      setTimeout(() => this.connect(), AGAIN_MS);
    };
  }

  hear(message) {
    if ("answer" in message) {
      this.waiting.get(message.answer)?.(message);
      this.waiting.delete(message.answer);
    } else if ("you" in message) {
      this.tell("welcome", message);
    } else if ("phase" in message) {
      this.tell("seen", message);
    }
  }

  tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }

  get isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  /** Sends without waiting for an answer. A page whose line is full keeps silent: old wishes must not pile up. */
  send(call) {
    if (this.isOpen && this.socket.bufferedAmount < 65536) this.socket.send(JSON.stringify(call));
  }

  /** Sends, and gives the answer: {done, text}. */
  call(call) {
    if (!this.isOpen) return Promise.resolve({ done: false, text: "there is no connection" });
    const number = ++this.number;
    return new Promise((answer) => {
      this.waiting.set(number, answer);
      this.socket.send(JSON.stringify({ number, ...call }));
    });
  }
}

export async function read(what) {
  const answer = await fetch(`/api/${what}`);
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}
