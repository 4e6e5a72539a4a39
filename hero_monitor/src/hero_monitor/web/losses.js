// What is unknown at present, with cause and remedy, in one banner; and what of a robot may be shown as known.

const element = (id) => document.getElementById(id);

/** The state of a robot as shown: unknown while the page or the robot's driver is not up to date. */
export function stateOf(robot, state) {
  return state.isFresh && robot.known ? robot.state : "UNKNOWN";
}

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
    return [
      {
        cause: cause + since,
        remedy: "Start it again: roslaunch hero_bringup monitor.launch; STOP ALL is sent once it answers. Until then: rosservice call /hero_driver/stop true",
      },
    ];
  }
  if (!connection.served) {
    return [
      {
        cause: "Too many pages are open: this one shows no robots",
        remedy: "STOP ALL works here, too; close or hide another page to see the robots here",
      },
    ];
  }
  return state.losses;
}

export function showLosses(state, connection) {
  const losses = listLosses(state, connection);
  const banner = element("losses");
  banner.hidden = losses.length === 0;
  const lines = losses.map(({ cause, remedy }) => {
    const line = document.createElement("span");
    const bold = document.createElement("b");
    bold.textContent = `${cause}. `;
    line.append(bold, `${remedy}\n`);
    return line;
  });
  const text = lines.map((line) => line.textContent).join("");
  if (banner.textContent !== text) banner.replaceChildren(...lines);
}
