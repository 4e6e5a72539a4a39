// The page: one socket to the monitor, the state that it sends, and the panels that show it.
//
// Names and texts come from robots, programs and the network: they are inserted as text, never as markup.

import { element, make, setPressed, setText } from "./dom.js";
import { Connection } from "./connection.js";
import { onTheme } from "./map/colors.js";
import { FleetTable } from "./panels/fleet.js";
import { countsOf, showLosses } from "./losses.js";
import { FleetMap } from "./map/map.js";
import { LogView } from "./panels/log.js";
import { RobotPanel } from "./panels/robot.js";
import { ProgramPanel } from "./panels/programs.js";
import { Chart } from "./panels/chart.js";
import { LessonPanel } from "./panels/lesson.js";
import { Projector } from "./projector.js";
import { StopPanel } from "./stop.js";

const NOTICE_MS = 6000;

/** As received, whether it is up to date, and the names of the chosen robots. */
const state = {
  hello: { control: false },
  fleet: { driver: false, listening: "", stopped: false, counts: "", frame: "", localized: false, robots: [] },
  losses: [],
  poses: {},
  ranges: {},
  lights: {},
  goals: {},
  ground_truth: {},
  replay: {},
  picture: null,
  arena: { boxes: [], circles: [], extent: null },
  objects: { boxes: [], circles: [] },
  drawings: [],
  isFresh: false,
  offers: { programs: [], record: false },
  programs: [],
  chosen: new Set(),
  user: { name: "", title: "teacher", robots: [] },
  lesson: null,
};
const SHOWN_BY_ALL = ["fleet", "hello", "losses", "offers", "programs", "user", "lesson"];
const RECEIVED = Object.keys(state).filter((name) => name !== "isFresh" && name !== "chosen");

const connection = new Connection({
  onOpen() {
    log.clear();
    stop.open();
    map.requestShown();
  },
  onUpdates: receive,
  onChange() {
    if (!connection.isOpen) panel.endDrive();
    showAll();
    stop.show();
  },
  onPause() {
    panel.endDrive();
    notice("info", "This page was suspended: press again to drive.");
  },
});

/** Choose these robots alone, or in addition; one that is chosen already is then left out again. */
function choose(names, isAdded) {
  const chosen = new Set(isAdded ? state.chosen : []);
  for (const name of names) {
    if (names.length === 1 && chosen.has(name)) chosen.delete(name);
    else chosen.add(name);
  }
  state.chosen = chosen;
  table.show(state);
  showPanel();
  map.draw();
  log.choose(chosen);
}

function notice(level, text) {
  const box = element("notices");
  const last = box.lastElementChild;
  if (last !== null && last.textContent === text) return;
  const line = make("p", { className: level }, text);
  box.append(line);
  while (box.childElementCount > 4) box.firstElementChild.remove();
  setTimeout(() => line.remove(), NOTICE_MS);
}

const map = new FleetMap(state, { choose, connection });
const table = new FleetTable({ choose, isAdding: () => map.shows.select });
const log = new LogView();
const chart = new Chart();
new Projector(() => map.draw());
const panel = new RobotPanel({ connection, map, notice });
const programs = new ProgramPanel({ connection, map, notice });
const lesson = new LessonPanel({ connection });
const stop = new StopPanel({ connection, endDrive: () => panel.endDrive(), notice });

const listPresent = () => state.fleet.robots.filter((robot) => robot.state !== "REFUSED");

/** The chosen robot, or several of them; and their chart, without a choice that of all. */
function showPanel() {
  const present = listPresent();
  const chosen = present.filter((robot) => state.chosen.has(robot.name));
  panel.show(state, chosen);
  programs.show(state, [...state.chosen]);
  lesson.show(state, [...state.chosen]);
  chart.show(chosen.length ? chosen : present);
}

function showHead() {
  const { driver, robots, listening, frame, localized } = state.fleet;
  const isLive = state.isFresh && driver;
  const link = element("link");
  link.textContent = isLive && state.losses.length === 0 ? "live" : isLive ? state.losses[0].source + " lost" : "unknown";
  link.className = "pill " + (isLive && state.losses.length === 0 ? "good" : "quiet");
  element("ready").textContent = countsOf(state);
  element("listening").textContent = isLive && listening ? `driver on ${listening}` : "";
  const source = localized ? "localized" : "odometry drifts";
  element("frame").textContent = robots.length ? `frame ${frame}, ${source}` : "";
  document.body.classList.toggle("stale", !state.isFresh);
  const isLocal = /^(127\.|localhost|\[?::1)/.test(listening);
  const place = listening.replace(/^(0\.0\.0\.0|\[?::\]?):/, "this PC, port ");
  const more = "simulated ones: roslaunch hero_sim hero_sim.launch count:=4";
  setText(element("empty"), isLocal ? `No robots. Start ${more}` : `No robots. Switch some on: they connect to ${place}. Or start ${more}`);
  element("empty").hidden = robots.length > 0 || !isLive || Object.keys(state.replay).length > 0;
  showLosses(state, connection, () => connection.send({ do: "dismiss" }));
}

/** Show the state in all panels. */
function showAll() {
  state.isFresh = connection.isFresh;
  const present = [...state.chosen].filter((name) => state.fleet.robots.some((robot) => robot.name === name));
  if (present.length < state.chosen.size) choose(present);
  table.show(state);
  showPanel();
  showHead();
  map.draw();
}

let hasTopics = false; // those of fleet.yaml have their columns and quantities

function receive(updates) {
  for (const name of RECEIVED) {
    if (name in updates) state[name] = updates[name];
  }
  if ("user" in updates) stop.mayRelease = updates.user.title === "teacher";
  if ("hello" in updates) log.ownNode = updates.hello.node;
  if (updates.hello?.topics?.length && !hasTopics) {
    hasTopics = true;
    for (const shown of [table, chart]) shown.addTopics(updates.hello.topics);
  }
  stop.receive(updates);
  chart.history.update(state);
  if ("notice" in updates) notice(updates.notice.level, updates.notice.text);
  if ("hold_over" in updates) panel.endHold(updates.hold_over);
  if ("log" in updates) log.append(updates.log);
  if (SHOWN_BY_ALL.some((name) => name in updates)) showAll();
  else if ("poses" in updates || "ground_truth" in updates) panel.show(state, listPresent().filter((robot) => state.chosen.has(robot.name)));
  if ("user" in updates && !state.chosen.size) choose(state.user.robots); // a driver's own
  if (RECEIVED.some((name) => name in updates)) map.update(updates); // most carry the clock alone
}

element("all").addEventListener("click", () => {
  const names = listPresent().map((robot) => robot.name);
  choose(state.chosen.size < names.length ? names : []);
});

// Phones show the map's buttons on request.
element("layers").addEventListener("click", () => {
  const isOpen = element("tools").classList.toggle("open");
  element("layers").setAttribute("aria-expanded", String(isOpen));
});

// Small screens show one panel at a time.
const tabs = /** @type {HTMLElement[]} */ ([...document.querySelectorAll("#tabs button")]);
for (const button of tabs) {
  button.addEventListener("click", () => {
    document.body.dataset.panel = button.dataset.panel;
    for (const other of tabs) setPressed(other, other === button);
  });
}
document.body.dataset.panel = "fleet";

onTheme(() => map.draw());

showHead();
connection.open();
