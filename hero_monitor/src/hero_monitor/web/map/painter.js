// Paints the map: grid, arena, trails, goals, beams and robots. Lengths in mm, angles in mrad.

import { colorOf } from "./colors.js";
import { placeLabels } from "./labels.js";
import { Occupancy } from "./occupancy.js";
import { sourceOf, stateOf } from "../losses.js";
import { isDark } from "../theme.js";

export const BODY_MM = 36.85;
export const TRAIL_MS = 60000;
const WHEEL_MM = [24.6, 6, 31.5]; // radius, width, distance from the middle
const SHIELD_MM = 60; // radius of a HeRo+'s bump shield
const MIN_RADIUS_PX = 9; // radius of a robot, however far the view is
const PROJECTED_PX = 26;
const SENSOR_REACH_MM = 236.8;
const UNKNOWN_ALPHA = 70;
const TRAIL_INKS = [0.15, 0.28, 0.42, 0.6];

export class MapPainter {
  constructor(map) {
    this.map = map;
    this.context = map.canvas.getContext("2d");
    this.occupancy = new Occupancy();
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
    this.paintOccupancy();
    if (map.picture.box) this.paintPicture(map.picture);
    this.paintGrid();
    this.paintArena();
    const robots = state.fleet.robots.filter((robot) => robot.state !== "REFUSED" && state.poses[robot.name]);
    if (shows.trails) for (const robot of robots) this.paintTrail(robot);
    if (shows.ground_truth) for (const robot of robots) this.paintGroundTruth(robot);
    this.paintPlaces();
    for (const robot of robots) this.paintGoal(robot);
    for (const drawing of state.drawings) if (shows.beams || !drawing.isBeam) this.paintDrawing(drawing);
    if (shows.beams) for (const robot of robots) this.paintBeams(robot);
    for (const robot of robots) this.paintRobot(robot);
    for (const [name, pose] of Object.entries(state.replay)) this.paintBody(pose, { ink: colorOf(Number(name.split("_")[1])) });
    if (map.aim) this.paintAim(map.aim);
    else if (map.onPlace && map.canvas.matches(":focus-visible")) this.paintAim({ from: [view.x, view.y] }); // where Enter puts it
    if (map.lasso) this.paintLasso(map.lasso);
    context.restore();
    if (shows.names) this.paintNames(robots);
    this.paintScale();
  }

  at(pose, paint) {
    const { context } = this;
    context.save();
    context.translate(pose[0], pose[1]);
    context.rotate(pose[2] / 1000);
    paint(context);
    context.restore();
  }

  paintOccupancy() {
    const read = (name, alpha) => [...this.ink(name).match(/[0-9a-f]{2}/gi).map((part) => parseInt(part, 16)), alpha];
    const colors = { unknown: read("--wall", UNKNOWN_ALPHA), free: [0, 0, 0, 0], occupied: read("--wall", 255) };
    this.occupancy.paint(this.context, this.state.grid, colors);
  }

  paintPicture({ image, box: [left, low, right, high] }) {
    const { context } = this;
    context.save();
    context.translate(left, high);
    context.scale(1, -1);
    context.drawImage(image, 0, 0, right - left, high - low);
    context.restore();
  }

  paintGrid() {
    const { context, view } = this;
    const steps = [10, 100, 1000, 10000];
    const fine = steps.find((step) => step * view.scale >= 14) || 100000;
    const [left, low] = this.map.toMap(0, this.height);
    const [right, high] = this.map.toMap(this.width, 0);
    for (const [step, ink] of [[fine, "--grid"], [fine * 10, "--grid-bold"]]) {
      context.strokeStyle = this.ink(ink);
      context.lineWidth = 1 / view.scale;
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

  paintArena() {
    this.paintShapes(this.state.arena, "--wall");
    this.paintShapes(this.state.objects, "--object");
  }

  paintShapes({ boxes, circles }, ink) {
    const { context, view } = this;
    context.fillStyle = this.ink(ink);
    for (const [x, y, yaw, length, width] of boxes) {
      const thick = Math.max(width, 3 / view.scale);
      this.at([x, y, yaw], () => context.fillRect(-length / 2, -thick / 2, length, thick));
    }
    for (const [x, y, radius] of circles) {
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fill();
    }
  }

  paintTrail(robot) {
    const trail = this.map.trails.get(robot.name);
    if (!trail || trail.length < 2) return;
    const { context, view } = this;
    const now = Date.now();
    context.lineWidth = Math.max(5, 1.5 / view.scale);
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
      context.strokeStyle = colorOf(robot.id, TRAIL_INKS[index]);
      context.stroke(piece);
    });
  }

  paintGroundTruth(robot) {
    const pose = this.state.ground_truth[robot.name];
    if (!pose) return;
    const { context, view } = this;
    context.strokeStyle = this.ink("--ink");
    context.lineWidth = 1.2 / view.scale;
    context.setLineDash([4 / view.scale, 3 / view.scale]);
    this.at(pose, () => {
      context.beginPath();
      context.arc(0, 0, BODY_MM, 0, 2 * Math.PI);
      context.moveTo(0, 0);
      context.lineTo(BODY_MM * 1.35, 0);
      context.stroke();
    });
    context.setLineDash([]);
  }

  paintGoal(robot) {
    const goal = this.state.goals[robot.name];
    if (!goal) return;
    const { context, view, state } = this;
    const pose = state.poses[robot.name];
    context.strokeStyle = context.fillStyle = colorOf(robot.id);
    context.lineWidth = Math.max(3, 1.5 / view.scale);
    context.setLineDash([14, 12]);
    context.beginPath();
    context.moveTo(pose[0], pose[1]);
    context.lineTo(goal[0], goal[1]);
    context.stroke();
    context.setLineDash([]);
    for (const radius of [26, 11]) {
      context.beginPath();
      context.arc(goal[0], goal[1], Math.max(radius, (radius / 4) / view.scale), 0, 2 * Math.PI);
      if (radius === 11) context.fill();
      else context.stroke();
    }
  }

  /** Where robots of a formation go. */
  paintPlaces() {
    const { context, view } = this;
    context.strokeStyle = this.ink("--accent");
    context.lineWidth = Math.max(3, 1.5 / view.scale);
    for (const [x, y] of this.state.programs.flatMap(({ places }) => places)) {
      context.beginPath();
      context.arc(x, y, BODY_MM * this.enlarged, 0, 2 * Math.PI);
      context.stroke();
    }
  }

  /** Beams of a behavior's sensors, or its metric: lines over time and a text. */
  paintDrawing({ lines = [], text, at, color, isBeam }) {
    const { context, view } = this;
    context.strokeStyle = context.fillStyle = color;
    context.lineWidth = 1.5 / view.scale;
    context.globalAlpha = isBeam ? 0.5 : 1;
    context.beginPath();
    for (const line of lines) line.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
    context.globalAlpha = 1;
    if (text === undefined) return;
    const [x, y, height] = at;
    context.save();
    context.translate(x, y);
    context.scale(1, -1);
    context.font = `600 ${Math.max(height, 12 / view.scale)}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(text, 0, 0);
    context.restore();
  }

  paintLasso(points) {
    const { context, view } = this;
    context.strokeStyle = this.ink("--accent");
    context.lineWidth = 2 / view.scale;
    context.setLineDash([6 / view.scale, 4 / view.scale]);
    context.beginPath();
    for (const [x, y] of points) context.lineTo(x, y);
    context.closePath();
    context.stroke();
    context.setLineDash([]);
  }

  paintBeams(robot) {
    const ranges = this.state.ranges[robot.name];
    if (!ranges || stateOf(robot, this.state) !== "READY") return;
    const { context, view } = this;
    this.at(this.state.poses[robot.name], () => {
      ranges.forEach((range, index) => {
        const turn = -Math.PI + (index * 2 * Math.PI) / ranges.length;
        const [cosine, sine] = [Math.cos(turn), Math.sin(turn)];
        if (range === null || range < 0) {
          // Nothing in range: a tick shows the sensor's direction.
          context.strokeStyle = this.ink("--beam-free");
          context.lineWidth = 1 / view.scale;
          context.beginPath();
          context.moveTo(BODY_MM * cosine, BODY_MM * sine);
          context.lineTo((BODY_MM + 14) * cosine, (BODY_MM + 14) * sine);
          context.stroke();
          return;
        }
        const near = Math.min(1, Math.max(0, (range - BODY_MM) / (SENSOR_REACH_MM - BODY_MM)));
        const reach = Math.max(range, BODY_MM);
        const ink = `hsl(${(near * 48).toFixed(0)} 90% ${isDark() ? 58 : 44}%)`;
        context.strokeStyle = context.fillStyle = ink;
        context.lineWidth = Math.max(2.5, 1 / view.scale);
        context.globalAlpha = 0.45;
        context.beginPath();
        context.moveTo(BODY_MM * cosine, BODY_MM * sine);
        context.lineTo(reach * cosine, reach * sine);
        context.stroke();
        context.globalAlpha = 1;
        context.beginPath();
        context.arc(reach * cosine, reach * sine, Math.max(5, 2 / view.scale), 0, 2 * Math.PI);
        context.fill();
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
      context.fillStyle = this.ink("--tyre");
      for (const side of [-1, 1]) {
        context.fillRect(-WHEEL_MM[0], side * WHEEL_MM[2] - WHEEL_MM[1] / 2, 2 * WHEEL_MM[0], WHEEL_MM[1]);
      }
      if (hasShield) {
        context.strokeStyle = this.ink("--tyre");
        context.lineWidth = 3;
        context.beginPath();
        context.arc(0, 0, SHIELD_MM, 0, 2 * Math.PI);
        context.stroke();
      }
      // From the rim to the middle: identity, a dark gap, and the light, which glows only within the gap.
      context.fillStyle = this.ink("--shell");
      context.strokeStyle = ink;
      context.lineWidth = 7;
      if (!isPlaced) context.setLineDash([12, 9]);
      context.beginPath();
      context.arc(0, 0, BODY_MM - 3.5, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
      context.setLineDash([]);
      // An arrowhead marks the front.
      context.fillStyle = ink;
      context.beginPath();
      context.moveTo(BODY_MM * 1.38, 0);
      context.lineTo(BODY_MM * 0.92, BODY_MM * 0.4);
      context.lineTo(BODY_MM * 0.92, -BODY_MM * 0.4);
      context.closePath();
      context.fill();
      context.fillStyle = light || this.ink("--dark-light");
      context.beginPath();
      context.arc(0, 0, BODY_MM * (light ? 0.58 : 0.3), 0, 2 * Math.PI);
      context.fill();
      context.globalAlpha = 1;
      if (isChosen) {
        context.strokeStyle = this.ink("--accent");
        context.lineWidth = 2.5 / view.scale / this.enlarged;
        context.beginPath();
        context.arc(0, 0, BODY_MM * 1.5 + 4 / view.scale / this.enlarged, 0, 2 * Math.PI);
        context.stroke();
      }
    });
  }

  paintAim({ from, to }) {
    const { context, view } = this;
    context.strokeStyle = context.fillStyle = this.ink("--accent");
    context.lineWidth = 2 / view.scale;
    context.beginPath();
    context.arc(from[0], from[1], 6 / view.scale, 0, 2 * Math.PI);
    context.fill();
    if (!to) return;
    context.beginPath();
    context.moveTo(from[0], from[1]);
    context.lineTo(to[0], to[1]);
    context.stroke();
  }

  paintNames(robots) {
    const { context, state } = this;
    const radius = BODY_MM * this.view.scale * this.enlarged;
    const isCrowded = robots.length > 12 && radius < 22;
    const size = this.isProjected ? 26 : 12;
    context.font = `600 ${size}px system-ui, sans-serif`;
    context.textAlign = "left";
    context.textBaseline = "top";
    context.lineWidth = 3;
    context.strokeStyle = this.ink("--floor");
    const labels = robots.map((robot) => {
      const [x, y] = this.map.toScreen(...state.poses[robot.name]);
      // Numbers alone where names would be too many, and for an audience.
      const isChosen = state.chosen.has(robot.name);
      const isShort = robot.id >= 0 && !(isChosen && state.chosen.size === 1) && (isCrowded || this.isProjected);
      const text = isShort ? String(robot.id) : robot.name;
      const isNeeded = isChosen || stateOf(robot, state) !== "READY";
      return { x, y, radius: isChosen ? radius * 1.5 + 6 : radius * 1.15, width: context.measureText(text).width, height: size, isNeeded, text, robot };
    });
    placeLabels(labels, this.map.listCovered()).forEach((corner, index) => {
      if (!corner) return;
      const { text, robot } = labels[index];
      context.strokeText(text, ...corner);
      context.fillStyle = this.ink({ READY: "--ink", UNKNOWN: "--quiet" }[stateOf(robot, state)] || "--bad");
      context.fillText(text, ...corner);
    });
  }

  paintScale() {
    const { context, view } = this;
    const length = [10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000].find((mm) => mm * view.scale > 60) || 10000;
    const wide = length * view.scale;
    const [x, y] = [14, this.height - 14];
    context.strokeStyle = context.fillStyle = this.ink("--quiet");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, y - 5);
    context.lineTo(x, y);
    context.lineTo(x + wide, y);
    context.lineTo(x + wide, y - 5);
    context.stroke();
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.fillText(length < 1000 ? `${length / 10} cm` : `${length / 1000} m`, x + 5, y - 3);
  }
}
