// The last minute of each robot, as charts and the table need it.

export const KEPT_MS = 60000;
const STEP_MS = 200;
const SPEED_MS = 600; // over which a speed is measured: odometry comes in steps of some mm
const JUMP_MM = 500; // moved by hand, or its odometry was set

/** Milliseconds, x and y in mm, nearest range in mm or null, rate of odometry in Hz or null. */
class Sample {
  constructor(ms, pose, nearest, odom, yaw) {
    Object.assign(this, { ms, x: pose[0], y: pose[1], yaw, nearest, odom });
  }
}

export function nearestOf(ranges) {
  const valid = (ranges || []).filter((range) => range !== null && range >= 0);
  return valid.length ? Math.min(...valid) : null;
}

const wrap = (mrad) => Math.atan2(Math.sin(mrad / 1000), Math.cos(mrad / 1000));

export class History {
  constructor() {
    this.samples = new Map(); // by name, oldest first
  }

  /** Take what is known now; what is outdated leaves a gap. */
  update(state) {
    const now = Date.now();
    const odom = new Map(state.fleet.robots.map((robot) => [robot.name, robot.known ? robot.odom : 0]));
    for (const [name, pose] of Object.entries(state.poses)) {
      const samples = this.samples.get(name) || [];
      this.samples.set(name, samples);
      const last = samples[samples.length - 1];
      if (pose === null || !odom.get(name) || (last && now - last.ms < STEP_MS)) continue;
      samples.push(new Sample(now, pose, nearestOf(state.ranges[name]), odom.get(name), pose[2]));
    }
    for (const [name, samples] of this.samples) {
      while (samples.length && now - samples[0].ms > KEPT_MS + SPEED_MS) samples.shift();
      if (!(name in state.poses)) this.samples.delete(name);
    }
  }

  /** Speed in m/s at a sample, and turning in rad/s; null where there is nothing to measure. */
  static motionAt(samples, index) {
    const to = samples[index];
    let first = index;
    while (first > 0 && to.ms - samples[first].ms < SPEED_MS) first -= 1;
    const from = samples[first];
    const seconds = (to.ms - from.ms) / 1000;
    const distance = Math.hypot(to.x - from.x, to.y - from.y);
    if (seconds < 0.3 || seconds > 2 || distance > JUMP_MM) return { speed: null, turn: null };
    return { speed: distance / 1000 / seconds, turn: wrap(to.yaw - from.yaw) / seconds };
  }

  /** Speed of a robot now, m/s; null if it is unknown. */
  speedOf(name) {
    const samples = this.samples.get(name) || [];
    const last = samples[samples.length - 1];
    if (!last || Date.now() - last.ms > 1500) return null;
    return History.motionAt(samples, samples.length - 1).speed;
  }
}
