// A chart of one quantity over the last minute (uPlot, in vendor/): a line for each robot.

import { element } from "../dom.js";
import { colorOf, isDark } from "../map/colors.js";

const KEPT_MS = 60000;
const STEP_MS = 500;
const GAP_MS = 3500; // after a longer pause of the page a line is interrupted
const HEIGHT_PX = 170;
// From zero, and never so narrow that noise fills the chart.
const RANGE = { min: { soft: 0, mode: 1, pad: 0 }, max: { soft: 0.05, mode: 1, pad: 0.05 } };

/** Quantities of a robot; what is no finite number is not known. */
const QUANTITIES = {
  speed: { title: "speed", unit: "m/s", of: (robot) => robot.speed },
  turn: { title: "turn rate", unit: "rad/s", of: (robot) => robot.turn },
  nearest: { title: "nearest obstacle", unit: "m", of: (robot) => robot.nearest },
  odometry: { title: "odometry rate", unit: "Hz", of: (robot) => robot.odom },
};

/** The last minute of all robots. */
export class History {
  steps = []; // of {ms, robots: by name}, oldest first

  /** Take what is known now; robots that are unknown leave a gap. */
  update({ fleet }) {
    const ms = Date.now();
    const last = this.steps[this.steps.length - 1];
    if (last && ms - last.ms < STEP_MS) return;
    if (last && ms - last.ms > GAP_MS) this.steps.push({ ms: last.ms + 1, robots: {} });
    const known = fleet.robots.filter((robot) => robot.known && robot.odom && robot.state === "READY");
    this.steps.push({ ms, robots: Object.fromEntries(known.map((robot) => [robot.name, robot])) });
    while (ms - this.steps[0].ms > KEPT_MS) this.steps.shift();
  }

  /** Times (s, the newest is 0), and for each robot what of(robot) was; null: not known. */
  listSeries(names, of) {
    const now = this.steps.length ? this.steps[this.steps.length - 1].ms : 0;
    const read = (robot) => (robot && Number.isFinite(of(robot)) ? of(robot) : null);
    const times = this.steps.map(({ ms }) => (ms - now) / 1000);
    return [times, ...names.map((name) => this.steps.map(({ robots }) => read(robots[name])))];
  }
}

export class Chart {
  constructor() {
    this.history = new History();
    this.robots = [];
    this.key = "";
    this.plot = null;
    this.select = element("quantity");
    this.addTopics([]);
    this.select.addEventListener("input", () => this.draw());
    setInterval(() => this.draw(), STEP_MS);
  }

  /** Offer the quantities, and from now on each topic [name, unit] of fleet.yaml. */
  addTopics(topics) {
    for (const [name, unit] of topics) QUANTITIES[name] = { title: name, unit, of: ({ values }) => values?.[name] };
    const chosen = this.select.value;
    const options = Object.entries(QUANTITIES).map(([name, { title, unit }]) => new Option(unit ? `${title}, ${unit}` : title, name));
    this.select.replaceChildren(...options);
    if (chosen) this.select.value = chosen;
  }

  /** Show the lines of these robots. */
  show(robots) {
    this.robots = robots;
    this.draw();
  }

  draw() {
    const names = this.robots.map((robot) => robot.name);
    element("charts").hidden = names.length === 0;
    if (names.length === 0 || element("chart").clientWidth === 0) return;
    const quantity = QUANTITIES[this.select.value];
    const [times, ...values] = this.history.listSeries(names, quantity.of);
    const key = `${this.select.value} ${isDark()} ${names}`;
    if (key !== this.key) this.rebuild(key, quantity);
    const width = element("chart").clientWidth;
    if (this.plot.width !== width) this.plot.setSize({ width, height: HEIGHT_PX });
    this.plot.setData([times, ...values]);
    const known = values.map((line) => line[line.length - 1]).filter(Number.isFinite);
    const mean = known.reduce((sum, value) => sum + value, 0) / known.length;
    element("chart_now").textContent = known.length ? `now ${mean.toFixed(2)} ${quantity.unit}` : "unknown now";
  }

  rebuild(key, quantity) {
    this.key = key;
    this.plot?.destroy();
    const style = getComputedStyle(document.documentElement);
    const [ink, grid] = ["--quiet", "--line"].map((name) => style.getPropertyValue(name).trim());
    const axis = { stroke: ink, grid: { stroke: grid, width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif" };
    this.plot = new uPlot(
      {
        width: element("chart").clientWidth,
        height: HEIGHT_PX,
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false, range: [-KEPT_MS / 1000, 0] }, y: { range: RANGE } },
        axes: [
          { ...axis, size: 26, values: (plot, ticks) => ticks.map((tick) => (tick === 0 ? "now" : `${tick} s`)) },
          { ...axis, size: 44 },
        ],
        series: [{}, ...this.robots.map(({ name, id }) => ({ label: name, stroke: colorOf(id), width: 1.5, points: { show: false } }))],
      },
      [[]],
      element("chart"),
    );
    element("chart").setAttribute("aria-label", `${quantity.title} over the last minute, ${quantity.unit}`);
  }
}
