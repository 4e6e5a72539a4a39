// The swarm in numbers, shown while no robot is chosen.

import { element } from "../dom.js";
import { stateOf } from "../losses.js";

const DRIVING_M_S = 0.01;

/** Each robot counts once: lost before stopped, stopped before driving; one that still joins does not count yet. */
function classify(robot, state, history) {
  const shown = stateOf(robot, state);
  if (shown !== "READY") return shown === "JOINING" ? null : "lost";
  if (robot.stop) return "stopped";
  return (history.speedOf(robot.name) ?? 0) >= DRIVING_M_S ? "driving" : "ready";
}

export function showSummary(state, history) {
  const counts = { ready: 0, driving: 0, stopped: 0, lost: 0 };
  for (const robot of state.fleet.robots) {
    const name = classify(robot, state, history);
    if (name) counts[name] += 1;
  }
  for (const [name, count] of Object.entries(counts)) {
    element(`count_${name}`).textContent = count;
    element(`count_${name}`).parentElement.classList.toggle("zero", count === 0);
  }
  const known = state.fleet.robots.filter((robot) => stateOf(robot, state) === "READY");
  const speeds = known.map((robot) => history.speedOf(robot.name)).filter((speed) => speed !== null);
  const mean = speeds.reduce((sum, speed) => sum + speed, 0) / speeds.length;
  element("mean_speed").textContent = speeds.length ? `mean speed ${mean.toFixed(2)} m/s` : "mean speed unknown";
}
