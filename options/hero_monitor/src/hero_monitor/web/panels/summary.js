// The swarm in numbers, shown while no robot is chosen.

import { element } from "../dom.js";
import { countRobots, wordOf } from "../losses.js";

const DRIVING_M_S = 0.01;

/** robots: those that count; gone: how many have not returned. */
export function showSummary(robots, state, gone) {
  const counts = countRobots(robots, state, gone);
  for (const [name, count] of Object.entries(counts)) {
    const shown = element(`count_${name}`);
    if (!shown) continue;
    shown.textContent = count;
    shown.parentElement.classList.toggle("zero", count === 0);
  }
  const ready = robots.filter((robot) => wordOf(robot, state) === "READY");
  const speeds = ready.map((robot) => robot.speed).filter((speed) => speed !== null);
  const driving = speeds.filter((speed) => speed >= DRIVING_M_S).length;
  const mean = speeds.reduce((sum, speed) => sum + speed, 0) / speeds.length;
  element("mean_speed").textContent = speeds.length ? `${driving} driving, mean speed ${mean.toFixed(2)} m/s` : "speeds unknown";
}
