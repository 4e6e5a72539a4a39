// The last minute of all robots, in steps of half a second, as charts and the table need it.

export const KEPT_MS = 60000;
const STEP_MS = 500;
const SPAN = 2; // steps between the two samples: odometry and the network come in steps, too
const GAP_MS = 3500; // across a longer gap nothing is measured
const JUMP_MM = 500; // moved by hand, or its odometry was set

/** Quantities of a robot between two samples of it, the second one newer by `seconds`. */
export const QUANTITIES = {
  speed: { title: "speed", unit: "m/s", of: (from, to, seconds) => distance(from, to) / 1000 / seconds },
  turn: { title: "turn rate", unit: "rad/s", of: (from, to, seconds) => wrap(to.yaw - from.yaw) / seconds },
  nearest: { title: "nearest obstacle", unit: "m", of: (from, to) => (isRange(to.nearest) ? to.nearest / 1000 : null) },
  odometry: { title: "odometry rate", unit: "Hz", of: (from, to) => to.odom },
};

/** Keep a quantity for each topic [name, unit] of fleet.yaml. */
export function addTopics(topics) {
  for (const [name, unit] of topics) {
    QUANTITIES[name] = { title: name, unit, of: (from, to) => (Number.isFinite(to.values?.[name]) ? to.values[name] : null) };
  }
}

const distance = (from, to) => Math.hypot(to.x - from.x, to.y - from.y);
const wrap = (mrad) => Math.atan2(Math.sin(mrad / 1000), Math.cos(mrad / 1000));

const isRange = (range) => Number.isFinite(range) && range >= 0;

/** Nearest range in mm; Infinity: nothing in range; -1: not known, a sensor is not calibrated; null without data. */
export function nearestOf(ranges) {
  if (!ranges || !ranges.length) return null;
  const valid = ranges.filter(isRange);
  if (valid.length) return Math.min(...valid);
  return ranges.includes(-1) ? -1 : Infinity;
}

/** What users read of nearestOf(). */
export function nearestText(mm, digits) {
  if (mm === null) return "-";
  if (mm < 0) return "not calibrated";
  return isRange(mm) ? `${(mm / 1000).toFixed(digits)} m` : "free";
}

export class History {
  constructor() {
    this.steps = []; // of {ms, samples: {name: {x, y, yaw, nearest, odom}}}, oldest first; mm and mrad
  }

  /** Take what is known now; robots that are unknown leave a gap. */
  update(state) {
    const ms = Date.now();
    if (this.steps.length && ms - this.steps[this.steps.length - 1].ms < STEP_MS) return;
    const samples = {};
    for (const robot of state.fleet.robots) {
      const pose = state.poses[robot.name];
      if (!pose || !robot.known || !robot.odom || robot.state !== "READY") continue;
      const [x, y, yaw] = pose;
      samples[robot.name] = { x, y, yaw, nearest: nearestOf(state.ranges[robot.name]), odom: robot.odom, values: robot.values };
    }
    this.steps.push({ ms, samples });
    while (ms - this.steps[0].ms > KEPT_MS) this.steps.shift();
  }

  /** A quantity of a robot at a step; null if it is unknown. */
  valueAt(index, name, quantity) {
    const [before, now] = [this.steps[index - SPAN], this.steps[index]];
    const [from, to] = [before?.samples[name], now?.samples[name]];
    if (!from || !to || now.ms - before.ms > GAP_MS || distance(from, to) > JUMP_MM) return null;
    return quantity.of(from, to, (now.ms - before.ms) / 1000);
  }

  /** Speed of a robot now, m/s; null if it is unknown. */
  speedOf(name) {
    return this.valueAt(this.steps.length - 1, name, QUANTITIES.speed);
  }

  /** Times (s, the newest is 0), and for each robot its values. */
  listSeries(names, quantity) {
    const now = this.steps.length ? this.steps[this.steps.length - 1].ms : 0;
    const times = this.steps.map(({ ms }) => (ms - now) / 1000);
    return [times, ...names.map((name) => this.steps.map((_, index) => this.valueAt(index, name, quantity)))];
  }
}
