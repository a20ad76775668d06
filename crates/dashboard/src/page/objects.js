// The SubDevices' own objects: names at once, types and values where somebody looks. A few questions at a time, beside the cycle.

/** CoE data types by their codes: a name, and what bytes are. */
const TYPES = {
  1: ["bool", number(false)], 2: ["i8", number(true)], 3: ["i16", number(true)], 4: ["i32", number(true)], 0x15: ["i64", number(true)],
  5: ["u8", number(false)], 6: ["u16", number(false)], 7: ["u32", number(false)], 0x1b: ["u64", number(false)],
  8: ["f32", (bytes) => new DataView(bytes.buffer).getFloat32(0, true)],
  9: ["string", text],
};
/** Questions of this page that are under way: a SubDevice answers one after the other, and none of them waits for this page. */
const AT_ONCE = 3;
const READABLE = 7, WRITABLE = 0x38, VARIABLE = 7;

function number(isSigned) {
  return (bytes) => {
    const whole = bytes.reduceRight((sum, byte) => (sum << 8n) | BigInt(byte), 0n);
    return String(isSigned ? BigInt.asIntN(8 * bytes.length, whole) : whole);
  };
}

/** Nothing where the bytes are no UTF-8: they are shown as they are then. */
function text(bytes) {
  try {
    return JSON.stringify(new TextDecoder("utf-8", { fatal: true }).decode(bytes).replace(/\0+$/, ""));
  } catch {
    return null;
  }
}

/** The states in which something is allowed, where these aren't all. */
function only(what, bits) {
  const states = ["PRE-OP", "SAFE-OP", "OP"].filter((_, at) => bits & (1 << at));
  return states.length % 3 ? ` (${what} in ${states.join(" and ")} only)` : "";
}

const hex = (value, digits) => value.toString(16).padStart(digits, "0");

export class Objects {
  /** `ask` gives the answer to a call. */
  constructor(panel, ask) {
    this.ask = ask;
    this.panel = panel;
    this.of = panel.querySelector("select");
    this.list = panel.querySelector("ul");
    this.turn = 0;
    panel.addEventListener("toggle", () => (panel.open ? this.open() : this.turn++));
    this.of.onchange = () => this.show();
  }

  /** The first time asks who is there. */
  async open() {
    if (this.of.length) return this.show();
    const turn = ++this.turn;
    const { done, text, data } = await this.ask({ do: "scan" });
    if (turn !== this.turn) return;
    if (!done) return this.say(text);
    for (const { position, name, drive } of data.subdevices) {
      this.of.append(new Option(`${position} ${drive || name}`, position));
    }
    return this.show();
  }

  say(text) {
    this.list.replaceChildren(Object.assign(document.createElement("li"), { textContent: text }));
  }

  /** All objects of the chosen one, by name; whoever chooses another or closes it ends that. */
  async show() {
    const turn = ++this.turn, subdevice = Number(this.of.value);
    this.say("…");
    const { done, text, data } = await this.ask({ do: "sdo_list", subdevice });
    if (turn !== this.turn) return;
    if (!done) return this.say(text);
    this.list.replaceChildren();
    const asked = (index) => this.ask({ do: "sdo_object", subdevice, object: hex(index, 4) });
    const under_way = data.indices.slice(0, AT_ONCE).map(asked);
    for (const [at, index] of data.indices.entries()) {
      const found = await under_way.shift();
      if (turn !== this.turn) return;
      // Who is away for a moment has objects all the same.
      if (!found.done && !found.data?.refused_by_subdevice) return this.list.append(this.again(found.text));
      this.list.append(this.object(subdevice, index, found));
      const next = data.indices[at + AT_ONCE];
      if (next !== undefined) under_way.push(asked(next));
    }
  }

  /** What kept names from coming, and a button that asks for them anew. */
  again(text) {
    const item = document.createElement("li"), button = Object.assign(document.createElement("button"), { type: "button", textContent: "Ask again" });
    button.addEventListener("click", () => this.show());
    item.append(text, " ", button);
    return item;
  }

  object(subdevice, index, { done, text, data }) {
    const item = document.createElement("li"), details = document.createElement("details");
    details.dataset.object = hex(index, 4);
    const summary = document.createElement("summary"), entries = document.createElement("ul");
    summary.textContent = `${hex(index, 4)} ${done ? data.name : text}`;
    details.append(summary, entries);
    let turn = 0;
    details.addEventListener("toggle", async () => {
      const mine = ++turn;
      if (!details.open || !done) return;
      entries.replaceChildren();
      const last = data.object_code === VARIABLE ? 0 : data.max_subindex;
      for (let subindex = 0; subindex <= last && mine === turn && details.isConnected; subindex++) {
        const entry = await this.entry(subdevice, `${hex(index, 4)}:${hex(subindex, 2)}`);
        if (entry && mine === turn) entries.append(Object.assign(document.createElement("li"), { textContent: entry }));
      }
    });
    item.append(details);
    return item;
  }

  /** An entry in words; nothing where the object has a hole. */
  async entry(subdevice, object) {
    const { done, text, data } = await this.ask({ do: "sdo_type", subdevice, object });
    // A hole is what the SubDevice itself refuses.
    if (!done) return data?.refused_by_subdevice ? null : `${object} ${text}`;
    const { name, data_type, bit_length, access, unit } = data;
    const [type, words] = TYPES[data_type] ?? [`${bit_length} bits`, null];
    const rights = (access & READABLE ? "r" : "-") + (access & WRITABLE ? "w" : "-");
    const states = only("read", access & READABLE) + only("written", (access & WRITABLE) >> 3);
    const head = `${object} ${rights} ${name} ${type}${states}`;
    if (!(access & READABLE)) return head;
    const read = await this.ask({ do: "sdo_read", subdevice, object });
    if (!read.done) return `${head} = ${read.text}`;
    const bytes = Uint8Array.from(read.data.data.match(/../g) ?? [], (two) => parseInt(two, 16));
    const fits = words && bytes.length && bytes.length === (type === "string" ? bytes.length : Math.ceil(bit_length / 8));
    const value = fits ? words(bytes) : null;
    return `${head} = ${value ?? read.data.data}${fits && unit ? ` ${unit}` : ""}`;
  }
}
