// The table of robots. Cells change in place, which keeps selection, scrolling and screen readers undisturbed.

import { Lines, element, isPressed, make, setPressed } from "../dom.js";
import { colorOf } from "../map/colors.js";
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

function lightText(robot, state) {
  const light = state.lights[robot.name] || "off";
  return LIGHTS[light] || light;
}

/** Coordinates on the map, and what they are known by unless that is odometry. */
function poseText(robot, state) {
  const source = sourceOf(robot, state) || "own odometry";
  const pose = source === "unknown" ? null : state.poses[robot.name];
  const place = pose ? `${(pose[0] / 1000).toFixed(2)} ${(pose[1] / 1000).toFixed(2)} m` : "";
  return source === "odometry" && place ? place : `${place} ${source}`.trim();
}

/**
 * text: of a robot, empty if there is nothing to say; lasting: it stays true of a robot that is unknown now;
 * byName: it comes from topics of the robot's name, which of a refused robot are another one's.
 */
const COLUMNS = [
  { title: "Robot", text: (robot) => robot.name || robot.address, lasting: true },
  { title: "State", text: stateText, tag: "state", lasting: true },
  { title: "Stop", text: (robot, state) => (stateOf(robot, state) === "UNKNOWN" ? "" : robot.stop), tag: "stop", className: "stop", lasting: true },
  { title: "Light", text: lightText, byName: true },
  { title: "Nearest", text: ({ nearest }) => (Number.isFinite(nearest) ? number(nearest, 2, " m") : nearest), className: "number", byName: true },
  { title: "Speed", text: ({ speed }) => number(speed, 2, " m/s"), className: "number", byName: true },
  { title: "Pose", text: poseText, className: "pose", lasting: true, byName: true },
  { title: "Note", text: ({ note }) => note, className: "details", lasting: true },
  { title: "Address", text: ({ address }) => address, className: "details", lasting: true },
  { title: "Odom", text: ({ odom }) => number(odom, 1, " Hz"), className: "details number" },
  { title: "From robot", text: ({ bytes }) => number(bytes / 1000, 1, " kB/s"), className: "details number" },
  { title: "Clock", text: ({ clock }) => number(clock === null ? null : clock * 1000, 1, " ms"), className: "details number" },
  { title: "Distance", text: ({ distance }) => number(distance, 2, " m"), className: "details number" },
  { title: "Model", text: ({ model }) => model, className: "details", lasting: true },
  { title: "Versions", text: ({ firmware, hardware, config }) => [firmware, hardware, config].filter(Boolean).join(", "), className: "details", lasting: true },
  { title: "Up for", text: ({ uptime }) => spanOf(uptime || null), className: "details" },
  { title: "State since", text: ({ since }) => spanOf(since), className: "details", lasting: true },
  { title: "Reconnects", text: ({ reconnects }) => String(reconnects), className: "details number", lasting: true },
  { title: "Dropped", text: ({ dropped, bad }) => `${dropped} messages, ${bad} bad packets`, className: "details", lasting: true },
  { title: "Last error", text: healthOf, className: "details error", lasting: true },
];

/** @param {any} column */
function textOf(column, robot, state) {
  const shownState = stateOf(robot, state);
  const isOutdated = shownState !== "READY" && shownState !== "JOINING";
  if ((isOutdated && !column.lasting) || (robot.state === "REFUSED" && column.byName)) return "-";
  return column.text(robot, state) || (column.tag ? "" : "-");
}

const SHOWN_ABOVE = ["Robot", "State", "Pose", "Last error"]; // of the facts

/** What the table has of a robot, as [title, text]. */
export function listFacts(robot, state) {
  const columns = COLUMNS.filter(({ title }) => !SHOWN_ABOVE.includes(title));
  return columns.map((column) => [column.title.toLowerCase(), textOf(column, robot, state) || "-"]);
}

export class FleetTable {
  choose; isAdding;

  /** isAdding(): whether clicks choose robots in addition, without Shift, too. */
  constructor({ choose, isAdding }) {
    Object.assign(this, { choose, isAdding });
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
    const heads = COLUMNS.map(({ title, className = "" }) => make("th", { scope: "col", className }, title));
    this.table.tHead.rows[0].replaceChildren(...heads);
  }

  /** Add a column for each topic [name, unit] of fleet.yaml, behind the pose. */
  addTopics(topics) {
    const columns = topics.map(([name, unit]) => {
      const describe = (value) => `${typeof value === "number" ? value.toFixed(2) : value} ${unit}`.trim();
      const text = ({ values }) => (values?.[name] === undefined ? "" : describe(values[name]));
      return { title: name, text, className: "number", byName: true };
    });
    COLUMNS.splice(COLUMNS.findIndex(({ title }) => title === "Note"), 0, ...columns);
    this.build();
  }

  /** Show the robots by their numbers, as the monitor lists them. */
  show(state) {
    const { robots } = state.fleet;
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
    const row = { line, button, chip, targets, robot: null };
    const choose = (isAdded) => row.robot.state !== "REFUSED" && this.choose([row.robot.name], isAdded);
    line.addEventListener("click", (event) => choose(this.isAdding() || event.shiftKey || event.ctrlKey || event.metaKey));
    return row;
  }

  fill(row, robot, state) {
    row.robot = robot;
    COLUMNS.forEach((column, index) => {
      const [shown, target] = [textOf(column, robot, state), row.targets[index]];
      if (target.textContent === shown) return;
      target.textContent = shown;
      if (column.tag) target.dataset[column.tag] = shown;
      if (column.title === "Light") target.style.setProperty("--light", shown === "-" ? "transparent" : state.lights[robot.name] || "transparent");
      if (column.title === "Last error") target.title = shown;
    });
    row.chip.style.background = colorOf(robot.id);
    row.line.classList.toggle("unknown", stateOf(robot, state) === "UNKNOWN");
    const isChosen = state.chosen.has(robot.name) && robot.state !== "REFUSED";
    row.line.classList.toggle("chosen", isChosen);
    setPressed(row.button, isChosen);
  }
}
