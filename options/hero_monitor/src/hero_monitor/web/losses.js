// What is unknown at present, with cause and remedy, in one banner; and what of a robot may be shown as known.

import { element, make } from "./dom.js";

/** The state of a robot as shown: unknown while the page or the robot's driver is not up to date. */
export function stateOf(robot, state) {
  return state.isFresh && robot.known ? robot.state : "UNKNOWN";
}

/** A robot's state in the words of all programs: as stateOf(), or STOPPED while all robots are. */
export function wordOf(robot, state) {
  const shown = stateOf(robot, state);
  return shown === "READY" && state.fleet.stopped ? "STOPPED" : shown;
}

/** How many robots are ready, stopped, joining, lost or unknown. */
export const countsOf = (state) => (state.isFresh ? state.fleet.counts : "robots unknown");

/** What a robot's place on the map is known by. */
export function sourceOf(robot, state) {
  return stateOf(robot, state) === "UNKNOWN" ? "unknown" : robot.source;
}

const time = (ms) => new Date(ms).toTimeString().slice(0, 8);

/** What is lost, worst first: the page's own link to the monitor hides all behind it. */
function listLosses(state, connection) {
  if (!connection.isFresh) {
    const cause = connection.isOpen ? "No answer from the monitor" : "No connection to the monitor";
    const since = connection.heardMs ? ` since ${time(connection.heardMs)}: this view is outdated` : "";
    const remedy = "Start it again: roslaunch hero_bringup monitor.launch; STOP ALL is sent once it answers. Until then: rosservice call /hero_driver/stop true";
    return [{ cause: cause + since, remedy }];
  }
  return state.losses;
}

/** Show what is lost; dismiss() is called for the robots that have not returned. */
export function showLosses(state, connection, dismiss) {
  const losses = listLosses(state, connection);
  const banner = element("losses");
  banner.hidden = losses.length === 0;
  const lines = losses.map(({ source, cause, remedy }) => {
    const line = make("span", {}, make("b", {}, `${cause}. `), `${remedy}\n`);
    if (source !== "robots") return line;
    const button = make("button", { type: "button" }, "Dismiss");
    button.addEventListener("click", dismiss);
    return make("span", {}, button, line);
  });
  const text = lines.map((line) => line.textContent).join("");
  if (banner.textContent !== text) banner.replaceChildren(...lines);
}
