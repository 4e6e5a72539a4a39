// The table of robots. Cells change in place, which keeps selection, scrolling and screen readers undisturbed.

import { Lines, element, isPressed, make, setPressed } from "../dom.js";
import { colorOf } from "../map/colors.js";
import { nearestOf, nearestText } from "../history.js";
import { sourceOf, stateOf, wordOf } from "../losses.js";

function spanOf(seconds) {
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
  const shown = wordOf(robot, state);
  return shown === "READY" && robot.odom === 0 ? "READY, no data" : shown;
}

/** Coordinates on the map, and what they are known by unless that is odometry. */
function poseText(robot, state) {
  const source = sourceOf(robot, state) || "own odometry";
  const pose = source === "unknown" ? null : state.poses[robot.name];
  const place = pose ? `${(pose[0] / 1000).toFixed(2)} ${(pose[1] / 1000).toFixed(2)} m` : "";
  return source === "odometry" && place ? place : `${place} ${source}`.trim();
}

const versionsOf = ({ firmware, hardware, config }) => [firmware, hardware, config].filter(Boolean).join(", ");
const lossesOf = ({ dropped, bad }) => `${dropped} messages, ${bad} bad packets`;
const nearestRange = (robot, state) => nearestOf(state.ranges[robot.name]);

/**
 * value: what the table sorts by; text: of a value; lasting: it stays true of a robot that is unknown now;
 * byName: it comes from topics of the robot's name, which of a refused robot are another one's.
 */
const COLUMNS = [
  { title: "Robot", value: (robot) => robot.id, text: (id, robot) => robot.name || robot.address, lasting: true },
  { title: "State", value: stateText, tag: "state", lasting: true },
  { title: "Stop", value: (robot, state) => (stateOf(robot, state) === "UNKNOWN" ? "" : robot.stop), tag: "stop", className: "stop", lasting: true },
  { title: "Light", value: (robot, state) => state.lights[robot.name] || "", text: (light) => LIGHTS[light] || light || "off", byName: true },
  { title: "Nearest", value: nearestRange, text: (mm) => nearestText(mm, 2), className: "number", byName: true },
  { title: "Speed", value: (robot) => robot.speed, text: (speed) => number(speed, 2, " m/s"), className: "number", byName: true },
  { title: "Pose", value: poseText, text: String, className: "pose", lasting: true, byName: true },
  { title: "Note", value: (robot) => robot.note ?? "", className: "details", lasting: true },
  { title: "Address", value: (robot) => robot.address, className: "details", lasting: true },
  { title: "Odom", value: (robot) => robot.odom, text: (rate) => number(rate, 1, " Hz"), className: "details number" },
  { title: "From robot", value: (robot) => robot.bytes, text: (bytes) => number(bytes / 1000, 1, " kB/s"), className: "details number" },
  { title: "Clock", value: (robot) => robot.clock, text: (clock) => number(clock === null ? null : clock * 1000, 1, " ms"), className: "details number" },
  { title: "Distance", value: (robot) => robot.distance, text: (meters) => number(meters, 2, " m"), className: "details number" },
  { title: "Model", value: (robot) => robot.model ?? "", className: "details", lasting: true },
  { title: "Versions", value: versionsOf, className: "details", lasting: true },
  { title: "Up for", value: (robot) => robot.uptime, text: (seconds) => (seconds ? spanOf(seconds) : "-"), className: "details" },
  { title: "State since", value: (robot) => robot.since, text: spanOf, className: "details", lasting: true },
  { title: "Reconnects", value: (robot) => robot.reconnects, className: "details number", lasting: true },
  { title: "Dropped", value: lossesOf, text: String, className: "details", lasting: true },
  { title: "Last error", value: healthOf, text: String, className: "details error", lasting: true },
];

/**
 * Text of a robot in a column; now: its value there.
 * @param {any} column
 */
function textOf(column, robot, state, now = column.value(robot, state)) {
  const { text, tag, lasting, byName } = column;
  const shownState = stateOf(robot, state);
  const isOutdated = shownState !== "READY" && shownState !== "JOINING";
  if ((isOutdated && !lasting) || (robot.state === "REFUSED" && byName)) return "-";
  return text ? text(now, robot) : now === "" && !tag ? "-" : String(now);
}

const SHOWN_ABOVE = ["Robot", "State", "Pose", "Last error"]; // of the facts

/** What the table has of a robot, as [title, text]. */
export function listFacts(robot, state) {
  const columns = COLUMNS.filter(({ title }) => !SHOWN_ABOVE.includes(title));
  return columns.map((column) => [column.title.toLowerCase(), textOf(column, robot, state) || "-"]);
}

function compare(a, b) {
  if (a === b) return 0;
  if (a === null || b === null) return a === null ? -1 : 1;
  return a < b ? -1 : 1;
}

export class FleetTable {
  choose; isAdding;

  /** isAdding(): whether clicks choose robots in addition, without Shift, too. */
  constructor({ choose, isAdding }) {
    Object.assign(this, { choose, isAdding });
    this.column = COLUMNS[0];
    this.down = false;
    this.table = /** @type {HTMLTableElement} */ (document.querySelector("#fleet table"));
    this.build();
    const details = element("details");
    const show = (isShown) => {
      this.table.classList.toggle("detailed", isShown);
      setPressed(details, isShown);
      localStorage.setItem("details", String(isShown));
    };
    details.addEventListener("click", () => show(!isPressed(details)));
    show(localStorage.getItem("details") === "true");
  }

  build() {
    this.table.tBodies[0].replaceChildren();
    this.rows = new Lines(this.table.tBodies[0], () => this.makeRow());
    this.heads = COLUMNS.map((column) => this.makeHead(column));
    this.table.tHead.rows[0].replaceChildren(...this.heads);
  }

  /** Add a column for each topic [name, unit] of fleet.yaml, behind the pose. */
  addTopics(topics) {
    const text = (value, unit) => (value === null ? "-" : `${typeof value === "number" ? value.toFixed(2) : value} ${unit}`.trim());
    const columns = topics.map(([name, unit]) => ({
      title: name, value: (robot) => robot.values?.[name] ?? null, text: (value) => text(value, unit), className: "number", byName: true,
    }));
    COLUMNS.splice(COLUMNS.findIndex(({ title }) => title === "Note"), 0, ...columns);
    this.build();
  }

  makeHead(column) {
    const button = make("button", { type: "button" }, column.title);
    button.addEventListener("click", () => this.sortBy(column));
    return make("th", { scope: "col", className: column.className || "" }, button);
  }

  sortBy(column) {
    this.down = this.column === column ? !this.down : false;
    this.column = column;
    if (this.last) this.show(this.last);
  }

  show(state) {
    this.last = state;
    const sign = this.down ? -1 : 1;
    const valueOf = (robot) => this.column.value(robot, state);
    const robots = [...state.fleet.robots].sort(
      (one, other) => sign * compare(valueOf(one), valueOf(other)) || one.id - other.id,
    );
    this.heads.forEach((cell, index) => {
      const order = COLUMNS[index] !== this.column ? "none" : this.down ? "descending" : "ascending";
      if (cell.getAttribute("aria-sort") !== order) cell.setAttribute("aria-sort", order);
    });
    this.table.classList.toggle("stopping", robots.some((robot) => robot.stop));
    const keyOf = (robot) => `${robot.name} ${robot.address} ${robot.state === "REFUSED"}`;
    this.rows.show(robots, keyOf, (row, robot) => this.fill(row, robot, state));
  }

  makeRow() {
    const targets = COLUMNS.map(({ tag, title }) => make("span", { className: tag ? "tag" : title === "Light" ? "light" : "" }));
    const chip = make("span", { className: "chip" });
    const button = make("button", { type: "button" }, chip, targets[0]);
    const cells = COLUMNS.slice(1).map(({ className = "" }, index) => make("td", { className }, targets[index + 1]));
    const line = make("tr", {}, make("th", { scope: "row" }, button), ...cells);
    const row = { line, button, chip, targets, texts: [], robot: null };
    const choose = (isAdded) => row.robot.state !== "REFUSED" && this.choose([row.robot.name], isAdded);
    line.addEventListener("click", (event) => choose(this.isAdding() || event.shiftKey || event.ctrlKey || event.metaKey));
    // The loop of the keyboard: arrows go from row to row, with Shift they add robots on their way.
    line.addEventListener("keydown", (event) => {
      const next = { ArrowDown: line.nextElementSibling, ArrowUp: line.previousElementSibling }[event.key];
      if (!next) return;
      event.preventDefault();
      if (event.shiftKey && !isPressed(button)) choose(true);
      next.querySelector("button").focus();
      if (event.shiftKey && next.querySelector("[aria-pressed=false]")) next.dispatchEvent(new MouseEvent("click", { shiftKey: true }));
    });
    return row;
  }

  fill(row, robot, state) {
    row.robot = robot;
    COLUMNS.forEach((column, index) => {
      const now = column.value(robot, state);
      const shown = textOf(column, robot, state, now);
      if (row.texts[index] === shown) return;
      row.texts[index] = shown;
      const target = row.targets[index];
      target.textContent = shown;
      if (column.tag) target.dataset[column.tag] = shown;
      if (column.title === "Light") target.style.setProperty("--light", shown === "-" || !now ? "transparent" : now);
      if (column.title === "Last error") target.title = shown;
    });
    row.chip.style.background = colorOf(robot.id);
    row.line.classList.toggle("unknown", stateOf(robot, state) === "UNKNOWN");
    const isChosen = state.chosen.has(robot.name) && robot.state !== "REFUSED";
    row.line.classList.toggle("chosen", isChosen);
    setPressed(row.button, isChosen);
  }
}
