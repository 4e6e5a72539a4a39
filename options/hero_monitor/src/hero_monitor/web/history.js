// The last minute of all robots, in steps of half a second, as charts need it.

export const KEPT_MS = 60000;
const STEP_MS = 500;
const GAP_MS = 3500; // after a longer pause of the page a line is interrupted

const finite = (value) => (Number.isFinite(value) ? value : null);

/** Quantities of a robot; null: not known. */
export const QUANTITIES = {
  speed: { title: "speed", unit: "m/s", of: (robot) => robot.speed },
  turn: { title: "turn rate", unit: "rad/s", of: (robot) => robot.turn },
  nearest: { title: "nearest obstacle", unit: "m", of: ({ nearest }) => finite(nearest) },
  odometry: { title: "odometry rate", unit: "Hz", of: (robot) => robot.odom },
};

/** Keep a quantity for each topic [name, unit] of fleet.yaml. */
export function addTopics(topics) {
  for (const [name, unit] of topics) {
    QUANTITIES[name] = { title: name, unit, of: ({ values }) => finite(values?.[name]) };
  }
}

export class History {
  constructor() {
    this.steps = []; // of {ms, samples: {robot: {quantity: value}}}, oldest first
  }

  /** Take what is known now; robots that are unknown leave a gap. */
  update(state) {
    const ms = Date.now();
    const last = this.steps[this.steps.length - 1];
    if (last && ms - last.ms < STEP_MS) return;
    if (last && ms - last.ms > GAP_MS) this.steps.push({ ms: last.ms + 1, samples: {} });
    const samples = {};
    for (const robot of state.fleet.robots) {
      if (!robot.known || !robot.odom || robot.state !== "READY") continue;
      samples[robot.name] = Object.fromEntries(Object.entries(QUANTITIES).map(([name, { of }]) => [name, of(robot)]));
    }
    this.steps.push({ ms, samples });
    while (ms - this.steps[0].ms > KEPT_MS) this.steps.shift();
  }

  /** Times (s, the newest is 0), and for each robot its values of a quantity, by its name in QUANTITIES. */
  listSeries(names, quantity) {
    const now = this.steps.length ? this.steps[this.steps.length - 1].ms : 0;
    const times = this.steps.map(({ ms }) => (ms - now) / 1000);
    return [times, ...names.map((name) => this.steps.map(({ samples }) => samples[name]?.[quantity] ?? null))];
  }
}
