// A chart of one quantity over the last minute (uPlot, in vendor/): a line for each robot.

import { element } from "../dom.js";
import { KEPT_MS, QUANTITIES } from "../history.js";
import { colorOf, isDark } from "../map/colors.js";

const PERIOD_MS = 500;
const HEIGHT_PX = 170;
// From zero, and never so narrow that noise fills the chart.
const RANGE = { min: { soft: 0, mode: 1, pad: 0 }, max: { soft: 0.05, mode: 1, pad: 0.05 } };

export class Chart {
  constructor(history) {
    this.history = history;
    this.key = "";
    this.plot = null;
    this.select = element("quantity");
    this.listQuantities();
    this.select.addEventListener("input", () => this.show(this.robots || []));
    setInterval(() => this.draw(), PERIOD_MS);
  }

  listQuantities() {
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
    const names = (this.robots || []).map((robot) => robot.name);
    element("charts").hidden = names.length === 0;
    if (names.length === 0 || element("chart").clientWidth === 0) return;
    const quantity = QUANTITIES[this.select.value];
    const [times, ...values] = this.history.listSeries(names, this.select.value);
    const key = `${this.select.value} ${isDark()} ${names}`;
    if (key !== this.key) this.rebuild(key, quantity);
    const width = element("chart").clientWidth;
    if (this.plot.width !== width) this.plot.setSize({ width, height: HEIGHT_PX });
    this.plot.setData([times, ...values]);
    const known = values.map((line) => line[line.length - 1]).filter((value) => value !== null && value !== undefined);
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
