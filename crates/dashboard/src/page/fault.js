// What a drive's fault is, in words, and what to do about it.

/** What to look for, by the first and last error code of a group (CiA 402-2, "Error codes"). */
const LOOK_FOR = [
  [0x2000, 0x2fff, "Look for a blocked wheel and for a short circuit at the motor and its cable."],
  [0x3000, 0x3fff, "Check the drive's supply."],
  [0x4000, 0x4fff, "Let it cool down, and look why it became hot."],
  [0x5000, 0x5fff, "Check the drive's own supply and its plugs."],
  [0x6000, 0x6fff, "Check the drive's parameters."],
  [0x7000, 0x7fff, "Check the motor's brake and encoder, and their cables."],
  [0x8100, 0x82ff, "Check the bus: its cables and plugs."],
  [0x8300, 0x8fff, "Look what holds the wheel or drives it."],
  [0x9000, 0x90ff, "See what the machine's own safety circuit says."],
];
const MANUAL = "See the drive's manual.";

function advice(error) {
  const code = parseInt(error, 16);
  return LOOK_FOR.find(([first, last]) => first <= code && code <= last)?.[2] ?? MANUAL;
}

/** What ails a drive, and what to do; nothing where nothing does. */
function ailment({ state, error }) {
  if (state === "lost") return ["lost", "Check supply and bus cables."];
  if (error) return [`error ${error}`, advice(error)];
  if (state === "fault") return ["a fault that it tells no code of", "See the drive's display."];
  if (state === "failed") return ["left operation by itself", "See the drive's display and its manual."];
  return null;
}

/** Why the robot stopped: which drives by their names in the robot's file, what they say, what to do. */
export function faultWords({ drives, stop_drive, stop_device, axis_problem, stop_reason }, { wheels, devices }) {
  const name = (n) => `${wheels[n]?.name ?? `drive ${n + 1}`} (${wheels[n]?.device ?? "?"})`;
  // The one about which the robot stopped comes first: others may have followed it.
  const order = drives.map((_, n) => n).sort((a, b) => (b === stop_drive) - (a === stop_drive));
  const said = new Map();
  for (const n of order) {
    const [what, todo] = ailment(drives[n]) ?? [];
    if (what) said.set(what, { names: [...(said.get(what)?.names ?? []), name(n)], todo });
  }
  const reason = stop_reason || "the drives were stopped";
  const beside = axis_problem || (stop_device == null ? "" : `${devices[stop_device]?.name ?? "?"}: ${reason}`);
  const about = stop_drive == null ? "" : `${name(stop_drive)}: `;
  if (!said.size) return `${beside || about + reason}.`;
  const ailing = [...said].map(([what, { names, todo }]) => `${names.join(", ")}: ${what}. ${todo}`);
  return [...(beside ? [`${beside}.`] : []), ...ailing].join(" ");
}
