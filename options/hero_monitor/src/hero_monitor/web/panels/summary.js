// The chosen robots in numbers, or all of them.

import { element } from "../dom.js";
import { describeCounts, wordOf } from "../losses.js";

const DRIVING_M_S = 0.01;

/** robots: those that count; gone: how many have not returned. */
export function showSummary(robots, state, gone) {
  const ready = robots.filter((robot) => wordOf(robot, state) === "READY");
  const speeds = ready.map((robot) => robot.speed).filter((speed) => speed !== null);
  const driving = speeds.filter((speed) => speed >= DRIVING_M_S).length;
  const mean = speeds.reduce((sum, speed) => sum + speed, 0) / speeds.length;
  const motion = speeds.length ? `${driving} driving, mean speed ${mean.toFixed(2)} m/s` : "speeds unknown";
  element("summary").textContent = `${describeCounts(robots, state, gone)}; ${motion}`;
}
