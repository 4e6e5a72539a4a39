// Elements of the page, and changes that leave alone what is right already: selection and screen readers stay undisturbed.

/** @returns {any} */
export const element = (id) => document.getElementById(id);

/** Return a new element with these properties and children, which are elements or texts. */
export function make(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

export function setText(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

export const isPressed = (button) => button.getAttribute("aria-pressed") === "true";
export const setPressed = (button, isOn) => button.setAttribute("aria-pressed", String(isOn));

/** Lines of a list by key: those that are new are made, those that have gone are removed, all others stay. */
export class Lines {
  list; makeLine; lines;

  /** makeLine(key) returns an object whose `line` is the element. */
  constructor(list, makeLine) {
    Object.assign(this, { list, makeLine, lines: new Map() });
  }

  /** Show a line for each item, in their order, and fill(line, item). */
  show(items, keyOf, fill) {
    const keys = new Set(items.map(keyOf));
    for (const [key, { line }] of this.lines) {
      if (keys.has(key)) continue;
      line.remove();
      this.lines.delete(key);
    }
    items.forEach((item, index) => {
      const key = keyOf(item);
      if (!this.lines.has(key)) this.lines.set(key, this.makeLine(key));
      const made = this.lines.get(key);
      const place = this.list.children[index] || null;
      if (place !== made.line) this.list.insertBefore(made.line, place);
      fill(made, item);
    });
  }
}
