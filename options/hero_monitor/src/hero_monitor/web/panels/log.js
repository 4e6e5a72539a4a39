// Log lines of nodes and robots, newest at the bottom; a message that comes again, for any robot, stays one line.

import { element, make } from "../dom.js";
import { colorOf } from "../map/colors.js";

const LINES_MAX = 500;
const LEVELS = { 1: "debug", 2: "info", 4: "warn", 8: "error", 16: "fatal" };
const AT_END_PX = 30;
const NUMBER = /\d+(\.\d+)?/g;

const cell = (className, text) => make("span", { className }, text);

export class LogView {
  list; level; mine; words;

  constructor() {
    [this.list, this.level, this.mine, this.words] = ["lines", "level", "mine", "words"].map(element);
    this.chosen = new Set();
    this.ownNode = ""; // of the monitor, whose lines tell who drives and stops
    this.groups = new Map(); // the line that shows a message, by its text without numbers
    for (const input of [this.level, this.mine, this.words]) {
      input.addEventListener("input", () => this.filter());
    }
  }

  clear() {
    this.groups.clear();
    this.list.replaceChildren();
  }

  choose(names) {
    this.chosen = names;
    if (this.mine.checked) this.filter();
  }

  append({ missed, lines }) {
    const atEnd = this.list.scrollHeight - this.list.scrollTop - this.list.clientHeight < AT_END_PX;
    if (missed > 0) this.list.append(make("li", { className: "gap", entry: null }, `${missed} lines left out`));
    for (const [, seconds, level, node, robot, text] of lines) this.add({ seconds, level, node, robot, text });
    while (this.list.childElementCount > LINES_MAX) {
      this.groups.delete(this.list.firstElementChild.entry?.key);
      this.list.firstElementChild.remove();
    }
    if (atEnd) this.list.scrollTop = this.list.scrollHeight;
  }

  /** Show a line; one before that differs from it only in numbers joins it, unless these tell users apart. */
  add({ seconds, level, node, robot, text }) {
    const key = `${level} ${node} ${node === this.ownNode ? text : text.replace(NUMBER, "#")}`;
    const former = this.groups.get(key);
    former?.remove();
    const robots = new Set(former?.entry.robots).add(robot);
    const count = (former?.entry.count ?? 0) + 1;
    const time = new Date(seconds * 1000).toTimeString().slice(0, 8);
    const source = cell("node", robots.size > 1 ? `${robots.size} robots` : robot || node);
    source.title = node;
    if (robot && robots.size === 1) source.style.color = colorOf(Number(robot.slice(robot.indexOf("_") + 1)));
    const said = cell("text", robot && text.startsWith(`${robot}: `) ? text.slice(robot.length + 2) : text);
    if (count > 1) said.append(cell("count", `${count} times`));
    const entry = { key, level, robots, count, words: `${node} ${text}`.toLowerCase() };
    const line = make("li", { className: LEVELS[level] || "info", entry }, cell("time", time), source, said);
    line.hidden = !this.admits(entry);
    this.groups.set(key, line);
    this.list.append(line);
  }

  admits(entry) {
    if (entry === null) return true;
    if (entry.level < Number(this.level.value)) return false;
    if (this.mine.checked && this.chosen.size && ![...entry.robots].some((robot) => this.chosen.has(robot))) return false;
    return entry.words.includes(this.words.value.trim().toLowerCase());
  }

  filter() {
    for (const line of this.list.children) line.hidden = !this.admits(line.entry);
    this.list.scrollTop = this.list.scrollHeight;
  }
}
