// The page as a whole: one socket to the monitor, what came over it, and who shows it.
//
// Names and texts come from robots, programs and the network: they only ever become text, never markup.

import { FleetTable } from "./fleet.js";
import { FleetMap } from "./map.js";
import { LogView } from "./log.js";
import { RobotPanel } from "./robot.js";
import { StopPanel } from "./stop.js";

const RETRY_MS = 1000;
const SILENT_MS = 5000; // the driver reports once a second, so something new comes at least so often
const NOTICE_MS = 6000;

const element = (id) => document.getElementById(id);

/** What is known of the fleet, and which robot is chosen. */
const state = {
  hello: { control: false, limits: { linear: 0.2, turn: 8 } },
  fleet: { driver: false, listening: "", stopped: false, robots: [] },
  poses: {},
  ranges: {},
  lights: {},
  goals: {},
  truth: {},
  arena: { boxes: [], circles: [] },
  chosen: null,
};

let socket = null;
let lastMs = 0;

const isOpen = () => socket !== null && socket.readyState === WebSocket.OPEN;

/** Send a request; false where there is nobody to send it to. */
function send(request) {
  if (!isOpen()) return false;
  socket.send(JSON.stringify(request));
  return true;
}

/** Whether requests pile up on a network that carries nothing: then a button that is held must not be sent. */
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
const stop = new StopPanel({ send, isOpen, letGo: () => panel.letGo(), notice });

function showHead() {
  const open = isOpen();
  const link = element("link");
  const { driver, robots, listening } = state.fleet;
  link.textContent = !open ? "no connection to the monitor" : driver ? "live" : "no driver";
  link.className = "pill " + (open && driver ? "good" : "bad");
  const ready = robots.filter((robot) => robot.state === "READY").length;
  element("ready").textContent = `${ready} of ${robots.length} ready`;
  element("listening").textContent = driver && listening ? `driver on ${listening}` : "";
  document.body.classList.toggle("stale", !open);
  const empty = element("empty");
  empty.hidden = open && robots.length > 0;
  empty.textContent = !open
    ? "No connection to the monitor. What you see is old."
    : driver
      ? "No robot yet. Robots appear here when they reach the driver."
      : "No driver: roslaunch hero_bringup hero_bringup.launch";
}

function receive(news) {
  for (const name of ["hello", "fleet", "poses", "ranges", "lights", "goals", "truth", "arena"]) {
    if (name in news) state[name] = news[name];
  }
  stop.receive(news);
  if ("notice" in news) notice(news.notice.level, news.notice.text);
  if ("log" in news) log.append(news.log);
  if ("fleet" in news || "hello" in news) {
    if (state.chosen !== null && !state.fleet.robots.some((robot) => robot.name === state.chosen)) choose(null);
    table.show(state);
    showHead();
  }
  if ("poses" in news || "fleet" in news || "hello" in news) panel.show(state);
  map.update(news);
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
    send({ do: "look", truth: map.shows.truth });
    showHead();
  });
  own.addEventListener("message", (event) => {
    lastMs = Date.now();
    receive(JSON.parse(event.data));
  });
  own.addEventListener("close", async () => {
    panel.letGo();
    socket = null;
    showHead();
    stop.show();
    if (!opened) {
      // The monitor may have been started anew, with another token: then this page is the login page.
      try {
        const page = await (await fetch(".", { cache: "no-store" })).text();
        if (page.includes("login.js")) location.reload();
      } catch {
        // It does not answer; go on trying.
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
