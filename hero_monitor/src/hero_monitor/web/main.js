// The page: one socket to the monitor, the state that it sends, and the panels that show it.
//
// Names and texts come from robots, programs and the network: they are inserted as text, never as markup.

import { FleetTable } from "./fleet.js";
import { FleetMap } from "./map.js";
import { LogView } from "./log.js";
import { RobotPanel } from "./robot.js";
import { StopPanel } from "./stop.js";

const RETRY_MS = 1000;
const SILENT_MS = 5000; // the driver reports once a second
const NOTICE_MS = 6000;

const element = (id) => document.getElementById(id);

/** The sections as received, and the name of the chosen robot. */
const state = {
  hello: { control: false },
  fleet: { driver: false, listening: "", stopped: false, robots: [] },
  poses: {},
  ranges: {},
  lights: {},
  goals: {},
  ground_truth: {},
  picture: null,
  arena: { boxes: [], circles: [] },
  chosen: null,
};

let socket = null;
let lastMs = 0;

const isOpen = () => socket !== null && socket.readyState === WebSocket.OPEN;

/** Send a request; false without a connection. */
function send(request) {
  if (!isOpen()) return false;
  socket.send(JSON.stringify(request));
  return true;
}

/** Whether requests queue up on a stalled network: commands of a held button must not. */
function congested() {
  return socket !== null && socket.bufferedAmount > 0;
}

function choose(name) {
  state.chosen = name;
  table.show(state);
  panel.show(state);
  map.draw();
  log.choose(name);
}

function notice(level, text) {
  const box = element("notices");
  const last = box.lastElementChild;
  if (last !== null && last.textContent === text) return;
  const line = document.createElement("p");
  line.className = level;
  line.textContent = text;
  box.append(line);
  while (box.childElementCount > 4) box.firstElementChild.remove();
  setTimeout(() => line.remove(), NOTICE_MS);
}

const map = new FleetMap(state, { choose, send, notice });
const table = new FleetTable(choose);
const log = new LogView();
const panel = new RobotPanel({ send, congested, map });
const stop = new StopPanel({ send, isOpen, releaseRobot: () => panel.release(), notice });

function showHead() {
  const open = isOpen();
  const link = element("link");
  const { driver, robots, listening, frame } = state.fleet;
  link.textContent = !open ? "no connection to the monitor" : driver ? "live" : "no driver";
  link.className = "pill " + (open && driver ? "good" : "bad");
  const ready = robots.filter((robot) => robot.state === "READY").length;
  element("ready").textContent = `${ready} of ${robots.length} ready`;
  element("listening").textContent = driver && listening ? `driver on ${listening}` : "";
  element("frame").textContent = frame ? `frame ${frame}, by localization` : "";
  document.body.classList.toggle("stale", !open);
  const empty = element("empty");
  empty.hidden = open && robots.length > 0;
  empty.textContent = !open
    ? "No connection to the monitor. This view is outdated."
    : driver
      ? "No robots. Robots appear here when they connect to the driver."
      : "No driver: roslaunch hero_bringup hero_bringup.launch";
}

function receive(updates) {
  for (const name of ["hello", "fleet", "poses", "ranges", "lights", "goals", "ground_truth", "picture", "arena"]) {
    if (name in updates) state[name] = updates[name];
  }
  stop.receive(updates);
  if ("notice" in updates) notice(updates.notice.level, updates.notice.text);
  if ("log" in updates) log.append(updates.log);
  if ("fleet" in updates || "hello" in updates) {
    if (state.chosen !== null && !state.fleet.robots.some((robot) => robot.name === state.chosen)) choose(null);
    table.show(state);
    showHead();
  }
  if ("poses" in updates || "fleet" in updates || "hello" in updates) panel.show(state);
  map.update(updates);
}

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  const own = socket;
  let opened = false;
  own.addEventListener("open", () => {
    opened = true;
    lastMs = Date.now();
    log.clear();
    stop.open();
    map.requestShown();
    showHead();
  });
  own.addEventListener("message", (event) => {
    lastMs = Date.now();
    receive(JSON.parse(event.data));
  });
  own.addEventListener("close", async () => {
    panel.release();
    socket = null;
    showHead();
    stop.show();
    if (!opened) {
      // A restarted monitor may have another token: then this page becomes the login page.
      try {
        const page = await (await fetch(".", { cache: "no-store" })).text();
        if (page.includes("login.js")) location.reload();
      } catch {
        // It does not answer; keep trying.
      }
    }
    setTimeout(connect, RETRY_MS);
  });
}

setInterval(() => {
  if (isOpen() && Date.now() - lastMs > SILENT_MS) socket.close();
}, 1000);

// Small screens show one panel at a time.
for (const button of document.querySelectorAll("#tabs button")) {
  button.addEventListener("click", () => {
    document.body.dataset.panel = button.dataset.panel;
    for (const other of document.querySelectorAll("#tabs button")) {
      other.setAttribute("aria-pressed", String(other === button));
    }
  });
}
document.body.dataset.panel = "fleet";

const THEMES = ["", "light", "dark"];
function setTheme(theme) {
  if (theme) document.documentElement.dataset.theme = theme;
  else delete document.documentElement.dataset.theme;
  map.draw();
}
setTheme(localStorage.getItem("theme") || "");
element("theme").addEventListener("click", () => {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const now = document.documentElement.dataset.theme || (dark ? "dark" : "light");
  const next = THEMES[now === "dark" ? 1 : 2];
  localStorage.setItem("theme", next);
  setTheme(next);
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => map.draw());

showHead();
connect();
