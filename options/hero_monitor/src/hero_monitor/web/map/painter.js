// Paints the map: floor, arena, trails, goals, beams and robots. Lengths in mm, angles in mrad.

import { colorOf, isDark } from "./colors.js";
import { sourceOf, stateOf } from "../losses.js";

export const BODY_MM = 36.85;
export const TRAIL_MS = 60000;
const WHEEL_MM = [24.6, 6, 31.5]; // radius, width, distance from the middle
const SHIELD_MM = 60; // radius of a HeRo+'s bump shield
const MIN_RADIUS_PX = 10; // radius of a robot, however far the view is
const PROJECTED_PX = 26;
const MIN_DIGIT_PX = 11;
const SENSOR_REACH_MM = 236.8;
const TRAIL_INKS = [0.15, 0.28, 0.42, 0.6];

export class MapPainter {
  view; state; width; height;

  constructor(map) {
    this.map = map;
    this.context = map.canvas.getContext("2d");
  }

  paint() {
    const { map, context } = this;
    const { view, shows } = map;
    const state = { ...map.state, poses: map.poses };
    Object.assign(this, { view, state, width: map.width, height: map.height });
    this.isProjected = document.body.classList.contains("projector");
    // On a wall, robots are seen from afar.
    this.enlarged = Math.max(1, (this.isProjected ? PROJECTED_PX : MIN_RADIUS_PX) / (BODY_MM * view.scale));
    const style = getComputedStyle(document.documentElement);
    this.ink = (name) => style.getPropertyValue(name).trim();
    context.save();
    context.fillStyle = this.ink("--floor");
    context.fillRect(0, 0, this.width, this.height);
    context.translate(this.width / 2, this.height / 2);
    context.scale(view.scale, -view.scale);
    context.translate(-view.x, -view.y);
    if (map.picture.shown) this.paintPicture(map.picture.shown);
    this.paintGrid();
    this.paintShapes(state.arena, "--wall");
    this.paintShapes(state.objects, "--object");
    const robots = state.fleet.robots.filter((robot) => robot.state !== "REFUSED" && state.poses[robot.name]);
    if (shows.trails) for (const robot of robots) this.paintTrail(robot);
    if (shows.ghosts) for (const robot of robots) this.paintGhost(robot);
    this.paintPlaces();
    for (const robot of robots) this.paintGoal(robot);
    for (const drawing of state.drawings) if (shows.beams || !drawing.isBeam) this.paintDrawing(drawing);
    if (shows.beams) for (const robot of robots) this.paintBeams(robot);
    for (const robot of robots) this.paintRobot(robot);
    for (const [name, pose] of Object.entries(state.replay)) this.paintBody(pose, { ink: colorOf(Number(name.split("_")[1])) });
    if (map.aim) this.paintAim(map.aim);
    else if (map.onPlace && map.canvas.matches(":focus-visible")) this.paintAim({ from: [view.x, view.y], to: null }); // where Enter puts it
    if (map.lasso) this.paintLasso(map.lasso);
    context.restore();
    if (shows.numbers) this.paintNumbers(robots);
    this.paintScale();
  }

  /** Paint with a pose as the origin; texts and images with y down. */
  at([x, y, yaw = 0], paint, isFlipped = false) {
    const { context } = this;
    context.save();
    context.translate(x, y);
    context.rotate(yaw / 1000);
    if (isFlipped) context.scale(1, -1);
    paint();
    context.restore();
  }

  /** Take a pen; its width is that in px, but not less than that in mm. */
  pen(ink, px, mm = 0) {
    this.context.strokeStyle = this.context.fillStyle = ink;
    this.context.lineWidth = Math.max(mm, px / this.view.scale);
  }

  circle(x, y, radius) {
    this.context.beginPath();
    this.context.arc(x, y, radius, 0, 2 * Math.PI);
    return this.context;
  }

  path(...points) {
    this.context.beginPath();
    for (const [x, y] of points) this.context.lineTo(x, y);
    return this.context;
  }

  dashed(lengths, paint) {
    this.context.setLineDash(lengths);
    paint();
    this.context.setLineDash([]);
  }

  paintPicture({ image, box: [left, low, right, high] }) {
    this.at([left, high], () => this.context.drawImage(image, 0, 0, right - left, high - low), true);
  }

  paintGrid() {
    const { context, view } = this;
    const steps = [10, 100, 1000, 10000];
    const fine = steps.find((step) => step * view.scale >= 14) || 100000;
    const [left, low] = this.map.toMap(0, this.height);
    const [right, high] = this.map.toMap(this.width, 0);
    for (const { step, ink } of [{ step: fine, ink: "--grid" }, { step: fine * 10, ink: "--grid-bold" }]) {
      this.pen(this.ink(ink), 1);
      context.beginPath();
      for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
        context.moveTo(x, low);
        context.lineTo(x, high);
      }
      for (let y = Math.ceil(low / step) * step; y <= high; y += step) {
        context.moveTo(left, y);
        context.lineTo(right, y);
      }
      context.stroke();
    }
  }

  /** Paint what stands on the floor in an ink, and its painted areas in their colors. */
  paintShapes({ boxes, circles }, ink) {
    const { context, view } = this;
    const isArea = (shape) => shape.at(-1) !== null;
    for (const shape of [...boxes, ...circles].sort((one, other) => Number(isArea(other)) - Number(isArea(one)))) {
      const [x, y, yaw, length, width] = shape;
      context.fillStyle = isArea(shape) ? shape.at(-1) : this.ink(ink);
      const thick = Math.max(width, 3 / view.scale);
      if (shape.length === 4) this.circle(x, y, shape[2]).fill();
      else this.at([x, y, yaw], () => context.fillRect(-length / 2, -thick / 2, length, thick));
    }
  }

  paintTrail(robot) {
    const trail = this.map.trails.get(robot.name);
    if (!trail || trail.length < 2) return;
    const { context } = this;
    const now = Date.now();
    context.lineJoin = context.lineCap = "round";
    // In a few pieces, older ones fainter.
    const pieces = TRAIL_INKS.map(() => new Path2D());
    const pose = this.state.poses[robot.name];
    [...trail, [pose[0], pose[1], now]].forEach(([x, y, time], index, points) => {
      if (index === 0) return;
      const age = Math.min(0.999, (now - time) / TRAIL_MS);
      const piece = pieces[Math.floor((1 - age) * (TRAIL_INKS.length - 0.001))];
      piece.moveTo(points[index - 1][0], points[index - 1][1]);
      piece.lineTo(x, y);
    });
    pieces.forEach((piece, index) => {
      this.pen(colorOf(robot.id, TRAIL_INKS[index]), 1.5, 5);
      context.stroke(piece);
    });
  }

  /** Where odometry or localization has a robot that is drawn where it is. */
  paintGhost(robot) {
    const pose = this.map.state.poses[robot.name];
    if (!this.state.ground_truth[robot.name]) return;
    const { scale } = this.view;
    this.pen(colorOf(robot.id), 1.5);
    this.at(pose, () =>
      this.dashed([4 / scale, 3 / scale], () => {
        this.circle(0, 0, BODY_MM).stroke();
        this.path([0, 0], [BODY_MM * 1.35, 0]).stroke();
      }),
    );
  }

  paintGoal(robot) {
    const goal = this.state.goals[robot.name];
    if (!goal) return;
    const { scale } = this.view;
    this.pen(colorOf(robot.id), 1.5, 3);
    this.dashed([14, 12], () => this.path(this.state.poses[robot.name], goal).stroke());
    this.circle(goal[0], goal[1], Math.max(26, 6.5 / scale)).stroke();
    this.circle(goal[0], goal[1], Math.max(11, 2.75 / scale)).fill();
  }

  /** Where robots of a formation go. */
  paintPlaces() {
    this.pen(this.ink("--accent"), 1.5, 3);
    const places = this.state.programs.flatMap((program) => program.places);
    for (const [x, y] of places) this.circle(x, y, BODY_MM * this.enlarged).stroke();
  }

  /** Beams of a behavior's sensors, or its metric: lines over time and a text. */
  paintDrawing({ lines = [], text, at, color, isBeam }) {
    const { context, view } = this;
    this.pen(color, 1.5);
    context.globalAlpha = isBeam ? 0.5 : 1;
    context.beginPath();
    for (const line of lines) line.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
    context.globalAlpha = 1;
    if (text === undefined) return;
    const [x, y, height] = at;
    context.font = `600 ${Math.max(height, 12 / view.scale)}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    this.at([x, y], () => context.fillText(text, 0, 0), true);
  }

  paintLasso(points) {
    const { scale } = this.view;
    this.pen(this.ink("--accent"), 2);
    this.dashed([6 / scale, 4 / scale], () => this.path(...points, points[0]).stroke());
  }

  paintBeams(robot) {
    const ranges = this.state.ranges[robot.name];
    if (!ranges || stateOf(robot, this.state) !== "READY") return;
    const { context, view } = this;
    this.at(this.state.poses[robot.name], () => {
      ranges.forEach((range, index) => {
        const turn = (index * 2 * Math.PI) / ranges.length;
        const along = (distance) => [distance * Math.cos(turn), distance * Math.sin(turn)];
        if (range === null || range < 0) {
          // Nothing in range: a tick shows the sensor's direction.
          this.pen(this.ink("--beam-free"), 1);
          this.path(along(BODY_MM), along(BODY_MM + 14)).stroke();
          return;
        }
        const near = Math.min(1, Math.max(0, (range - BODY_MM) / (SENSOR_REACH_MM - BODY_MM)));
        const end = along(Math.max(range, BODY_MM));
        this.pen(`hsl(${(near * 48).toFixed(0)} 90% ${isDark() ? 58 : 44}%)`, 1, 2.5);
        context.globalAlpha = 0.45;
        this.path(along(BODY_MM), end).stroke();
        context.globalAlpha = 1;
        this.circle(...end, Math.max(5, 2 / view.scale)).fill();
      });
    });
  }

  paintRobot(robot) {
    const { state } = this;
    const here = stateOf(robot, state) === "READY";
    const isPlaced = here && sourceOf(robot, state) !== "unknown";
    const ink = here ? colorOf(robot.id) : this.ink("--quiet");
    const light = here ? state.lights[robot.name] : null;
    const isChosen = state.chosen.has(robot.name);
    this.paintBody(state.poses[robot.name], { ink, light, isPlaced, isChosen, hasShield: robot.model === "hero_plus" });
  }

  paintBody(pose, { ink, light = null, isPlaced = true, isChosen = false, hasShield = false }) {
    const { context, view } = this;
    this.at(pose, () => {
      context.scale(this.enlarged, this.enlarged);
      context.globalAlpha = isPlaced ? 1 : 0.4;
      context.fillStyle = context.strokeStyle = this.ink("--tyre");
      for (const side of [-1, 1]) {
        context.fillRect(-WHEEL_MM[0], side * WHEEL_MM[2] - WHEEL_MM[1] / 2, 2 * WHEEL_MM[0], WHEEL_MM[1]);
      }
      context.lineWidth = 3;
      if (hasShield) this.circle(0, 0, SHIELD_MM).stroke();
      // From the rim to the middle: identity, a dark gap, and the light, which glows only within the gap.
      context.fillStyle = this.ink("--shell");
      context.strokeStyle = ink;
      context.lineWidth = 7;
      if (!isPlaced) context.setLineDash([12, 9]);
      this.circle(0, 0, BODY_MM - 3.5).fill();
      context.stroke();
      context.setLineDash([]);
      // An arrowhead marks the front.
      context.fillStyle = ink;
      this.path([BODY_MM * 1.38, 0], [BODY_MM * 0.92, BODY_MM * 0.4], [BODY_MM * 0.92, -BODY_MM * 0.4]).fill();
      context.fillStyle = light || this.ink("--dark-light");
      this.circle(0, 0, BODY_MM * (light ? 0.7 : 0.3)).fill();
      context.globalAlpha = 1;
      if (isChosen) {
        this.pen(this.ink("--accent"), 2.5 / this.enlarged);
        this.circle(0, 0, BODY_MM * 1.5 + 4 / view.scale / this.enlarged).stroke();
      }
    });
  }

  paintAim({ from, to }) {
    this.pen(this.ink("--accent"), 2);
    this.circle(...from, 6 / this.view.scale).fill();
    if (to) this.path(from, to).stroke();
  }

  /** Write each robot's number into it, where it covers no other. */
  paintNumbers(robots) {
    const { context, state } = this;
    const radius = BODY_MM * this.view.scale * this.enlarged;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 2;
    context.strokeStyle = "#000";
    for (const robot of robots) {
      const text = robot.id < 0 ? robot.name : String(robot.id);
      const [x, y] = this.map.toScreen(...state.poses[robot.name]);
      context.font = `700 ${Math.max(MIN_DIGIT_PX, Math.round(radius * (text.length < 3 ? 0.95 : 0.7)))}px system-ui, sans-serif`;
      context.strokeText(text, x, y);
      context.fillStyle = stateOf(robot, state) === "READY" ? "#fff" : "#ff9d9d";
      context.fillText(text, x, y);
    }
  }

  paintScale() {
    const { context, view } = this;
    const length = [10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000].find((mm) => mm * view.scale > 60) || 10000;
    const [x, y] = [14, this.height - 14];
    const end = x + length * view.scale;
    context.strokeStyle = context.fillStyle = this.ink("--quiet");
    context.lineWidth = 1.5;
    this.path([x, y - 5], [x, y], [end, y], [end, y - 5]).stroke();
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.fillText(length < 1000 ? `${length / 10} cm` : `${length / 1000} m`, x + 5, y - 3);
  }
}
