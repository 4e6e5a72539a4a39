// The chosen robots: data of one, and controls for driving them if the monitor allows that.
//
// Dead man's switch: while a button or key is held, the page sends a command every 100 ms. It stops sending when the
// button is let go, the page is hidden or loses focus, was suspended, or the network stalls. The monitor stops robots
// on "end_drive", after 0.4 s of silence, or when the socket closes. A stop or release ends the hold: each command tells
// when the button was pressed, and the monitor takes those of a press after the stop only.

import { Lines, element, isPressed, make, setPressed, setText } from "../dom.js";
import { colorOf } from "../map/colors.js";
import { isLate } from "../connection.js";
import { listenToHold } from "../hold.js";
import { healthOf, listFacts } from "./fleet.js";
import { mayDrive, roleOf } from "./lesson.js";
import { countsOf, stateOf, wordOf } from "../losses.js";

const VIEW_ONLY = "View only. control:=true lets the monitor drive robots.";
const HOLD_MS = 100;
const GAP_MS = 400; // after such a pause of this page, a button that was held may have been let go
const KEYS = {
  ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1],
  KeyW: [1, 0], KeyS: [-1, 0], KeyA: [0, 1], KeyD: [0, -1],
};

export class RobotPanel {
  connection; map; notice;

  constructor({ connection, map, notice }) {
    Object.assign(this, { connection, map, notice });
    this.names = [];
    this.driving = null;
    this.timer = null;
    this.keys = new Set();
    this.facts = new Lines(element("facts"), (title) => this.makeFact(title));
    const pad = element("pad");
    for (const button of pad.querySelectorAll("button")) {
      const direction = button.dataset.direction.split(" ").map(Number);
      const begin = (event) => {
        event.preventDefault();
        if (isLate(event)) return;
        if ("pointerId" in event) {
          pad.focus();
          button.setPointerCapture(event.pointerId);
        }
        button.classList.add("down");
        this.hold(direction);
      };
      // A button that is reached with Tab is held with the space bar.
      listenToHold(button, ["Space"], begin, () => this.endDrive());
    }
    pad.addEventListener("keydown", (event) => this.pressKey(event));
    pad.addEventListener("keyup", (event) => this.liftKey(event));
    pad.addEventListener("focusout", () => this.endDrive());
    addEventListener("blur", () => this.endDrive());
    addEventListener("pagehide", () => this.endDrive());
    document.addEventListener("visibilitychange", () => document.hidden && this.endDrive());
    for (const [id, unit] of [["linear", "m/s"], ["angular", "rad/s"]]) {
      const show = () => (element(`${id}_value`).textContent = `${Number(element(id).value).toFixed(2)} ${unit}`);
      element(id).addEventListener("input", show);
      show();
    }
    element("goto").addEventListener("click", () => this.setGoing(!isPressed(element("goto"))));
    addEventListener("keydown", (event) => event.key === "Escape" && this.setGoing(false));
  }

  setGoing(going) {
    const count = this.names.length;
    const whose = count === 1 ? `the goal of ${this.names[0]}` : `where the middle of these ${count} goes, as they stand`;
    this.map.askPlace(going ? `Click ${whose}; drag to set the final heading.` : null, (place) => this.sendGoals(place));
    setPressed(element("goto"), going);
    element("goto").textContent = going ? "Choosing a goal" : "Go to goal";
  }

  /** Send each robot to its place around {x, y}: that which it has now around the middle of all. */
  sendGoals({ x, y, ...heading }) {
    const placed = this.names.filter((name) => this.map.poses[name]);
    const mean = (axis) => placed.reduce((sum, name) => sum + this.map.poses[name][axis], 0) / placed.length;
    const middle = [mean(0), mean(1)];
    for (const name of placed) {
      const [right, up] = this.map.poses[name].map((value, axis) => (value - middle[axis]) / 1000);
      const sent = this.connection.send({ do: "goal", robots: [name], x: x + right, y: y + up, ...heading });
      if (!sent) return this.notice("error", "no connection to the monitor: the goal was not sent");
    }
  }

  pressKey(event) {
    if (!(event.code in KEYS) || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (event.repeat || isLate(event)) return;
    this.keys.add(event.code);
    this.holdKeys();
  }

  liftKey(event) {
    if (!this.keys.delete(event.code)) return;
    if (this.keys.size) this.holdKeys(this.driving.pressedMs);
    else this.endDrive();
  }

  holdKeys(pressedMs) {
    const sum = [0, 0];
    for (const key of this.keys) KEYS[key].forEach((value, index) => (sum[index] += value));
    this.hold(sum.map(Math.sign), pressedMs);
  }

  /** pressedMs: the monitor's clock at the press, if it is not a new one. */
  hold(direction, pressedMs = this.connection.nowMs) {
    if (!this.names.length) return;
    this.driving = { robots: this.names, direction, pressedMs };
    this.sentMs = Date.now();
    this.sendCommand();
    if (this.timer === null) this.timer = setInterval(() => this.sendCommand(), HOLD_MS);
  }

  sendCommand() {
    const now = Date.now();
    if (document.hidden || !document.hasFocus()) return this.endDrive();
    if (now - this.sentMs > GAP_MS) {
      this.endDrive();
      this.notice("info", "This page was busy or suspended: press again to drive.");
      return;
    }
    this.sentMs = now;
    if (this.connection.isCongested) return;
    const { robots, direction, pressedMs } = this.driving;
    // Backwards the turn is inverted, as in a car.
    const angular = direction[1] * (direction[0] < 0 ? -1 : 1) * Number(element("angular").value);
    const linear = direction[0] * Number(element("linear").value);
    this.connection.send({ do: "drive", robots, linear, angular, pressed_ms: pressedMs });
  }

  /** The monitor takes no more commands of this press. */
  endHold(pressedMs) {
    if (this.driving !== null && this.driving.pressedMs === pressedMs) this.endDrive();
  }

  endDrive() {
    this.keys.clear();
    for (const button of element("pad").querySelectorAll(".down")) button.classList.remove("down");
    if (this.timer !== null) clearInterval(this.timer);
    this.timer = null;
    if (this.driving !== null) this.connection.send({ do: "end_drive", robots: this.driving.robots });
    this.driving = null;
  }

  /** robots: those that are chosen. */
  show(state, robots) {
    const robot = robots.length === 1 ? robots[0] : null;
    const names = robots.map(({ name }) => name);
    if (String(names) !== String(this.names)) {
      this.endDrive();
      this.names = names;
      this.setGoing(false);
    }
    const chip = /** @type {HTMLElement} */ (document.querySelector("#robot .chip"));
    chip.hidden = robot === null;
    if (robot) chip.style.background = colorOf(robot.id);
    element("name").textContent = robot ? robot.name : robots.length ? `${robots.length} robots` : "All robots";
    const shown = robot ? wordOf(robot, state) : robots.length ? "" : countsOf(state);
    element("state").textContent = shown;
    element("state").dataset.state = shown;
    const isKnown = robots.some((one) => stateOf(one, state) !== "UNKNOWN");
    const isAllowed = mayDrive(state, names);
    element("control").hidden = !isKnown || !state.hello.control || !isAllowed;
    element("advice").hidden = robots.length === 0 || (state.hello.control && isAllowed);
    setText(element("advice"), !state.hello.control ? VIEW_ONLY : `You are ${state.user.title === "driver" ? "the" : "a"} ${roleOf({ ...state.user, name: "" })}: others drive these robots.`);
    const problem = robot ? healthOf(robot) : "";
    element("problem").hidden = !problem;
    element("problem").textContent = problem;
    const facts = robot === null ? [] : this.listFacts(robot, state);
    this.facts.show(facts, ([title]) => title, ({ value }, [, text]) => setText(value, text));
  }

  listFacts(robot, state) {
    if (stateOf(robot, state) === "UNKNOWN") return [["all data", "unknown"]];
    const [pose, truth] = [state.poses[robot.name], state.ground_truth[robot.name]];
    const meters = (value) => (value / 1000).toFixed(3);
    const facts = [["pose", pose ? `${meters(pose[0])} ${meters(pose[1])} m, ${((pose[2] / 1000) * (180 / Math.PI)).toFixed(0)}°` : "-"]];
    if (pose && truth) {
      const error = Math.hypot(pose[0] - truth[0], pose[1] - truth[1]);
      facts.push([state.fleet.localized ? "error of the pose" : "odometry error", `${error.toFixed(0)} mm`]);
    }
    facts.push(["pose source", robot.source || "own odometry: position on the map unknown"]);
    facts.push(["frame", robot.source ? state.fleet.frame : "-"]);
    return [...facts, ...listFacts(robot, state), ["diagnostics", robot.health[1] || "-"]];
  }

  makeFact(title) {
    const value = make("dd");
    return { line: make("div", {}, make("dt", {}, title), value), value };
  }
}
