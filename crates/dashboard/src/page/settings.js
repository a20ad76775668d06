// Settings as a form: changed together, all or none.

/** Settings that are choices, by their codes. */
const CHOICES = { avoidance: ["off", "circulate", "guarded"] };
const JOYSTICK = "joystick.";

export class Settings {
  /** `set` gets {name: value} of what was changed. */
  constructor(form, set) {
    this.form = form;
    this.names = "";
    form.addEventListener("input", ({ target }) => target.classList.add("changed"));
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      const changed = [...form.querySelectorAll(".changed")];
      if (!changed.length) return;
      const said = await set(Object.fromEntries(changed.map((input) => [input.name, Number(input.value)])));
      // What was refused stays, to be mended.
      if (said.done) for (const input of changed) input.classList.remove("changed");
    });
  }

  show(settings, mayChange) {
    const names = settings.map(({ name }) => name).join() + mayChange;
    if (this.names !== names) this.build(settings, mayChange);
    this.names = names;
    for (const { name, value } of settings) {
      const input = this.form.elements[name];
      if (input.classList.contains("changed") || document.activeElement === input) continue;
      const shown = String(Number(value.toPrecision(6)));
      if (input.value !== shown) input.value = shown;
    }
  }

  build(settings, mayChange) {
    const [own, stick] = [0, 1].map(() => document.createElement("fieldset"));
    for (const setting of settings) {
      (setting.name.startsWith(JOYSTICK) ? stick : own).append(...field(setting, mayChange));
    }
    const folded = document.createElement("details"), title = document.createElement("summary");
    title.textContent = "joystick at the robot";
    folded.append(title, stick);
    const button = document.createElement("button");
    button.textContent = "Set what was changed";
    button.disabled = !mayChange;
    this.form.replaceChildren(own, folded, button);
  }
}

function field({ name, range }, mayChange) {
  const choices = CHOICES[name];
  const input = document.createElement(choices ? "select" : "input");
  if (choices) {
    input.append(...choices.map((choice, code) => new Option(choice, code)));
  } else {
    input.type = "number";
    input.step = "any";
    [input.min, input.max] = range;
  }
  input.id = `set-${name}`;
  input.name = name;
  input.disabled = !mayChange;
  const label = document.createElement("label"), bounds = document.createElement("small");
  label.htmlFor = input.id;
  label.textContent = name.startsWith(JOYSTICK) ? name.slice(JOYSTICK.length) : name;
  bounds.textContent = choices ? "" : `${range[0]} to ${Number(range[1].toPrecision(4))}`;
  label.append(bounds);
  return [label, input];
}
