// The table of robots. Cells change in place, which keeps selection, scrolling and screen readers undisturbed.

import { colorOf } from "./colors.js";

export function spanOf(seconds) {
  if (seconds === null || seconds === undefined) return "-";
  if (seconds < 60) return `${seconds} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${seconds % 60} s`;
  return `${Math.floor(seconds / 3600)} h ${Math.floor((seconds % 3600) / 60)} min`;
}

const number = (value, digits, unit) => (value === null ? "-" : `${value.toFixed(digits)}${unit}`);

export const healthOf = (robot) => robot.error || (robot.health[0] > 0 ? robot.health[1] : "");

/** Heading, text of a cell, sort key, and whether it is a number. */
const COLUMNS = [
  ["Robot", (robot) => robot.name || robot.address, (robot) => robot.id, false],
  ["State", (robot) => robot.state, (robot) => robot.state, false],
  ["Stop", (robot) => robot.stop, (robot) => robot.stop, false],
  ["Address", (robot) => robot.address, (robot) => robot.address, false],
  ["Odom", (robot) => number(robot.odom, 1, " Hz"), (robot) => robot.odom ?? -1, true],
  ["From robot", (robot) => number(robot.bytes / 1000, 1, " kB/s"), (robot) => robot.bytes, true],
  ["Clock", (robot) => number(robot.clock === null ? null : robot.clock * 1000, 1, " ms"), (robot) => Math.abs(robot.clock ?? 0), true],
  ["Firmware", (robot) => robot.firmware || "-", (robot) => robot.firmware, false],
  ["Reconnects", (robot) => String(robot.reconnects), (robot) => robot.reconnects, true],
  ["Last error", (robot) => healthOf(robot), (robot) => healthOf(robot), false],
];

export class FleetTable {
  constructor(choose) {
    this.choose = choose;
    this.column = 0;
    this.down = false;
    this.rows = new Map();
    this.body = document.querySelector("#fleet tbody");
    const head = document.querySelector("#fleet thead tr");
    this.heads = COLUMNS.map(([title, , , isNumber], index) => {
      const cell = document.createElement("th");
      cell.scope = "col";
      if (isNumber) cell.className = "number";
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = title;
      button.addEventListener("click", () => this.sortBy(index));
      cell.append(button);
      head.append(cell);
      return cell;
    });
  }

  sortBy(index) {
    this.down = this.column === index ? !this.down : false;
    this.column = index;
    if (this.last) this.show(this.last);
  }

  show(state) {
    this.last = state;
    const key = COLUMNS[this.column][2];
    const sign = this.down ? -1 : 1;
    const robots = [...state.fleet.robots].sort((one, other) => {
      const [a, b] = [key(one), key(other)];
      return sign * (a < b ? -1 : a > b ? 1 : 0) || one.id - other.id;
    });
    this.heads.forEach((cell, index) => {
      const order = index !== this.column ? "none" : this.down ? "descending" : "ascending";
      if (cell.getAttribute("aria-sort") !== order) cell.setAttribute("aria-sort", order);
    });
    const left = new Set(this.rows.keys());
    robots.forEach((robot, index) => {
      const id = `${robot.name} ${robot.address} ${robot.state === "REFUSED"}`;
      left.delete(id);
      const row = this.rows.get(id) || this.addRow(id);
      if (this.body.children[index] !== row.line) this.body.insertBefore(row.line, this.body.children[index] || null);
      this.fill(row, robot, state.chosen);
    });
    for (const id of left) {
      this.rows.get(id).line.remove();
      this.rows.delete(id);
    }
  }

  addRow(id) {
    const line = document.createElement("tr");
    const row = { line, cells: [], tags: [], texts: [], robot: null };
    COLUMNS.forEach(([, , , isNumber], index) => {
      const cell = document.createElement(index === 0 ? "th" : "td");
      if (index === 0) {
        cell.scope = "row";
        const button = document.createElement("button");
        button.type = "button";
        const chip = document.createElement("span");
        chip.className = "chip";
        row.chip = chip;
        row.label = document.createElement("span");
        button.append(chip, row.label);
        cell.append(button);
      } else if (index <= 2) {
        const tag = document.createElement("span");
        tag.className = "tag";
        cell.append(tag);
        row.tags.push(tag);
      }
      if (isNumber) cell.className = "number";
      if (index === COLUMNS.length - 1) cell.className = "error";
      line.append(cell);
      row.cells.push(cell);
    });
    line.addEventListener("click", () => row.robot.state !== "REFUSED" && this.choose(row.robot.name));
    this.rows.set(id, row);
    return row;
  }

  fill(row, robot, chosen) {
    row.robot = robot;
    COLUMNS.forEach(([, text], index) => {
      const now = text(robot);
      if (row.texts[index] === now) return;
      row.texts[index] = now;
      const target = index === 0 ? row.label : row.tags[index - 1] || row.cells[index];
      target.textContent = now;
      if (index === COLUMNS.length - 1) target.title = now;
    });
    row.tags[0].dataset.state = robot.state;
    row.tags[1].dataset.stop = robot.stop;
    row.chip.style.background = colorOf(robot.id);
    row.line.classList.toggle("chosen", robot.name === chosen && robot.state !== "REFUSED");
  }
}
