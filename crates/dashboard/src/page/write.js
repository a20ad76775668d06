// Text goes to its place where it changed: what is written again is laid out again, many times a second.

export function write(element, text) {
  text = String(text);
  if (element.textContent !== text) element.textContent = text;
}
