// Which button can bring something about now; one that can't says why.

const HOLDING = (seen) =>
  seen.phase === "holding" ? ""
  : seen.phase === "tracking" ? "It moves: pause or stop it first."
  : seen.phase === "fault" ? "Acknowledge the fault first."
  : seen.phase === "disabled" ? "Enable the drives first."
  : "Wait until it holds.";

/** What a motion may go over into: for whoever asked for it; the robot refuses others. */
const LED = (seen) => (seen.phase === "tracking" && !seen.by_stick ? "" : HOLDING(seen));

/** A way that drive_to planned: it is planned anew, never gone on with. */
const PLANNED = "It was planned for what was in the way then: drive there again.";

const WHY_NOT = {
  enable: (seen) => (seen.phase === "disabled" ? "" : seen.phase === "fault" ? "Acknowledge the fault first." : "The drives are enabled."),
  acknowledge: (seen) => (seen.phase === "fault" ? "" : "There is no fault."),
  track: (seen) => HOLDING(seen) || (seen.of_drive_to[1] ? PLANNED : ""),
  go: LED,
  "drive-to": LED,
  go_to_start: LED,
  pause: (seen) => (seen.phase === "tracking" && !seen.by_stick ? "" : "It follows no path."),
  resume: (seen) => HOLDING(seen) || (!seen.reference_begun ? "No path was left." : seen.of_drive_to[0] ? PLANNED : ""),
};

/** What comes next, in green. */
const NEXT = { disabled: "enable", fault: "acknowledge" };

function nextOf(seen) {
  if (seen.emergency_stop) return "";
  if (seen.phase !== "holding") return NEXT[seen.phase];
  if (seen.drive_to?.under_way) return "";
  const canResume = seen.reference_begun && !seen.of_drive_to[0];
  return canResume ? "resume" : seen.of_drive_to[1] ? "drive-to" : "track";
}

/** Shows at all buttons what they can do. */
export function showActions(seen, isAllowed) {
  const next = nextOf(seen);
  for (const button of document.querySelectorAll(".buttons [data-do], #go, #drive-to")) {
    const name = button.dataset.do ?? button.id;
    const why = !isAllowed ? "Without the token one may look, and stop."
      : seen.emergency_stop ? "Release the emergency stop first."
      : WHY_NOT[name]?.(seen) ?? "";
    button.classList.toggle("go", name === next);
    button.disabled = Boolean(why);
    button.dataset.title ??= button.title;
    button.title = why || button.dataset.title;
  }
}
