// The table of robots. Cells change in place, which keeps selection, scrolling and screen readers undisturbed.

import { colorOf } from "../map/colors.js";
import { nearestOf } from "../history.js";
import { sourceOf, stateOf } from "../losses.js";

export function spanOf(seconds) {
  if (seconds === null || seconds === undefined) return "-";
  if (seconds < 60) return `${seconds} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${seconds % 60} s`;
  return `${Math.floor(seconds / 3600)} h ${Math.floor((seconds % 3600) / 60)} min`;
}

const LIGHTS = {
  "#ff0000": "red", "#00ff00": "green", "#0000ff": "blue", "#ffff00": "yellow",
  "#ff00ff": "magenta", "#00ffff": "cyan", "#ffffff": "white", "#ff6600": "orange",
};

const number = (value, digits, unit) => (value === null ? "-" : `${value.toFixed(digits)}${unit}`);

export const healthOf = (robot) => robot.error || (robot.health[0] > 0 ? robot.health[1] : "");

function stateText(robot, state) {
  const shown = stateOf(robot, state);
  return shown === "READY" && robot.odom === 0 ? "READY, no data" : shown;
}

const speedOf = (robot, state, history) => history.speedOf(robot.name);
const nearestRange = (robot, state) => nearestOf(state.ranges[robot.name]);

/** value: what the table sorts by; text: of a value; lasting: it stays true of a robot that is unknown now. */
const COLUMNS = [
  { title: "Robot", value: (robot) => robot.id, text: (id, robot) => robot.name || robot.address, lasting: true },
  { title: "State", value: stateText, tag: "state", lasting: true },
  { title: "Stop", value: (robot, state) => (stateOf(robot, state) === "UNKNOWN" ? "" : robot.stop), tag: "stop", lasting: true },
  { title: "Light", value: (robot, state) => state.lights[robot.name] || "", text: (light) => LIGHTS[light] || light || "off" },
  { title: "Nearest", value: nearestRange, text: (mm) => number(mm === null ? null : mm / 1000, 2, " m"), isNumber: true },
  { title: "Speed", value: speedOf, text: (speed) => number(speed, 2, " m/s"), isNumber: true },
  { title: "Pose", value: sourceOf, text: (source) => source || "own odometry", tag: "source", lasting: true },
  { title: "Address", value: (robot) => robot.address, details: true, lasting: true },
  { title: "Odom", value: (robot) => robot.odom, text: (rate) => number(rate, 1, " Hz"), details: true, isNumber: true },
  { title: "From robot", value: (robot) => robot.bytes, text: (bytes) => number(bytes / 1000, 1, " kB/s"), details: true, isNumber: true },
  { title: "Clock", value: (robot) => robot.clock, text: (clock) => number(clock === null ? null : clock * 1000, 1, " ms"), details: true, isNumber: true },
  { title: "Firmware", value: (robot) => robot.firmware, details: true, lasting: true },
  { title: "Reconnects", value: (robot) => robot.reconnects, details: true, isNumber: true, lasting: true },
  { title: "Last error", value: healthOf, text: String, details: true, isError: true, lasting: true },
];

function compare(a, b) {
  if (a === b) return 0;
  if (a === null || b === null) return a === null ? -1 : 1;
  return a < b ? -1 : 1;
}

export class FleetTable {
  /** isAdding(): whether clicks choose robots in addition, without Shift, too. */
  constructor({ choose, history, isAdding }) {
    this.choose = choose;
    this.isAdding = isAdding;
    this.history = history;
    this.column = COLUMNS[0];
    this.down = false;
    this.rows = new Map();
    this.table = document.querySelector("#fleet table");
    this.body = this.table.tBodies[0];
    this.heads = COLUMNS.map((column) => this.makeHead(column));
    const details = document.getElementById("details");
    const show = (isShown) => {
      this.table.classList.toggle("detailed", isShown);
      details.setAttribute("aria-pressed", String(isShown));
      localStorage.setItem("details", String(isShown));
    };
    details.addEventListener("click", () => show(details.getAttribute("aria-pressed") !== "true"));
    show(localStorage.getItem("details") === "true");
  }

  makeHead(column) {
    const cell = document.createElement("th");
    cell.scope = "col";
    cell.className = classOf(column);
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = column.title;
    button.addEventListener("click", () => this.sortBy(column));
    cell.append(button);
    this.table.tHead.rows[0].append(cell);
    return cell;
  }

  sortBy(column) {
    this.down = this.column === column ? !this.down : false;
    this.column = column;
    if (this.last) this.show(this.last);
  }

  show(state) {
    this.last = state;
    const sign = this.down ? -1 : 1;
    const valueOf = (robot) => this.column.value(robot, state, this.history);
    const robots = [...state.fleet.robots].sort(
      (one, other) => sign * compare(valueOf(one), valueOf(other)) || one.id - other.id,
    );
    this.heads.forEach((cell, index) => {
      const order = COLUMNS[index] !== this.column ? "none" : this.down ? "descending" : "ascending";
      if (cell.getAttribute("aria-sort") !== order) cell.setAttribute("aria-sort", order);
    });
    this.table.classList.toggle("stopping", robots.some((robot) => robot.stop));
    const left = new Set(this.rows.keys());
    robots.forEach((robot, index) => {
      const id = `${robot.name} ${robot.address} ${robot.state === "REFUSED"}`;
      left.delete(id);
      const row = this.rows.get(id) || this.addRow(id);
      if (this.body.children[index] !== row.line) this.body.insertBefore(row.line, this.body.children[index] || null);
      this.fill(row, robot, state);
    });
    for (const id of left) {
      this.rows.get(id).line.remove();
      this.rows.delete(id);
    }
  }

  addRow(id) {
    const line = document.createElement("tr");
    const row = { line, targets: [], texts: [], robot: null };
    COLUMNS.forEach((column, index) => {
      const cell = document.createElement(index === 0 ? "th" : "td");
      cell.className = classOf(column);
      let target = cell;
      if (index === 0) {
        cell.scope = "row";
        const button = (row.button = document.createElement("button"));
        button.type = "button";
        row.chip = document.createElement("span");
        row.chip.className = "chip";
        target = document.createElement("span");
        button.append(row.chip, target);
        cell.append(button);
      } else if (column.tag || column.title === "Light") {
        target = document.createElement("span");
        target.className = column.tag ? "tag" : "light";
        cell.append(target);
      }
      line.append(cell);
      row.targets.push(target);
    });
    const choose = (isAdded) => row.robot.state !== "REFUSED" && this.choose([row.robot.name], isAdded);
    line.addEventListener("click", (event) => choose(this.isAdding() || event.shiftKey || event.ctrlKey || event.metaKey));
    // The loop of the keyboard: arrows go from row to row, with Shift they add robots on their way.
    line.addEventListener("keydown", (event) => {
      const next = { ArrowDown: line.nextElementSibling, ArrowUp: line.previousElementSibling }[event.key];
      if (!next) return;
      event.preventDefault();
      if (event.shiftKey && row.button.getAttribute("aria-pressed") === "false") choose(true);
      next.querySelector("button").focus();
      if (event.shiftKey && next.querySelector("[aria-pressed=false]")) next.dispatchEvent(new MouseEvent("click", { shiftKey: true }));
    });
    this.rows.set(id, row);
    return row;
  }

  fill(row, robot, state) {
    row.robot = robot;
    const shownState = stateOf(robot, state);
    const isOutdated = shownState !== "READY" && shownState !== "JOINING";
    const isRefused = robot.state === "REFUSED"; // then topics of its name are those of another robot
    COLUMNS.forEach(({ title, value, text, tag, lasting }, index) => {
      const now = value(robot, state, this.history);
      const isHidden = (isOutdated && !lasting) || (isRefused && ["Light", "Nearest", "Speed", "Pose"].includes(title));
      const shown = isHidden ? "-" : text ? text(now, robot) : now === "" && !tag ? "-" : String(now);
      if (row.texts[index] === shown) return;
      row.texts[index] = shown;
      const target = row.targets[index];
      target.textContent = shown;
      if (tag) target.dataset[tag] = shown;
      if (title === "Light") target.style.setProperty("--light", isHidden || !now ? "transparent" : now);
      if (title === "Last error") target.title = shown;
    });
    row.chip.style.background = colorOf(robot.id);
    row.line.classList.toggle("unknown", shownState === "UNKNOWN");
    const isChosen = state.chosen.has(robot.name) && robot.state !== "REFUSED";
    row.line.classList.toggle("chosen", isChosen);
    row.button.setAttribute("aria-pressed", String(isChosen));
  }
}

function classOf({ details, isNumber, isError, title }) {
  return [details && "details", isNumber && "number", isError && "error", title === "Stop" && "stop"].filter(Boolean).join(" ");
}
