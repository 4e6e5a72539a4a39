// The map: robots as they are, seen from above; x to the right, y up, as in ROS. Lengths in mm, angles in mrad.

import { colourOf, isDark } from "./colours.js";

const BODY_MM = 36.85;
const WHEEL_MM = [24.6, 6, 31.5]; // radius, width, distance from the middle
const SENSOR_REACH_MM = 236.8;
const TRAIL_MS = 60000;
const TRAIL_STEP_MM = 8;
const TRAIL_INKS = [0.15, 0.28, 0.42, 0.6];
const CLICK_PX = 6;
const PIXELS_PER_MM = { least: 0.01, most: 8 };
const SPARE = 0.05; // of the map's size, around what Fit shows
const EDGE_PX = 36; // above and below lie tools and hints

const element = (id) => document.getElementById(id);

export class FleetMap {
  constructor(state, { choose, send, notice }) {
    this.state = state;
    this.choose = choose;
    this.send = send;
    this.notice = notice;
    this.canvas = element("canvas");
    this.paper = this.canvas.getContext("2d");
    this.shows = { trails: true, beams: true, names: true, truth: localStorage.getItem("truth") === "true" };
    this.view = { x: 0, y: 0, scale: 0.3 };
    this.held = false; // people chose what they see: it stays until they press Fit
    this.trails = new Map();
    this.pointers = new Map();
    this.going = false;
    this.aim = null;
    this.waiting = false;
    for (const name of Object.keys(this.shows)) {
      element(name).setAttribute("aria-pressed", String(this.shows[name]));
      element(name).addEventListener("click", () => this.toggle(name));
    }
    element("fit").addEventListener("click", () => {
      this.held = false;
      this.fit();
    });
    element("zoomin").addEventListener("click", () => this.zoom(1.4));
    element("zoomout").addEventListener("click", () => this.zoom(1 / 1.4));
    this.listen();
    new ResizeObserver(() => this.resize()).observe(element("map"));
  }

  toggle(name) {
    this.shows[name] = !this.shows[name];
    element(name).setAttribute("aria-pressed", String(this.shows[name]));
    if (name === "truth") {
      localStorage.setItem("truth", String(this.shows.truth));
      this.send({ do: "look", truth: this.shows.truth });
    }
    this.draw();
  }

  setGoing(going) {
    this.going = going;
    this.aim = null;
    this.canvas.classList.toggle("going", going);
    element("hint").hidden = !going;
    element("hint").textContent = going
      ? `Click where ${this.state.chosen} shall go; drag to say where it shall look.`
      : "";
    this.draw();
  }

  // ------------------------------------------------------------ pointer

  listen() {
    const canvas = this.canvas;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
      this.start = [event.offsetX, event.offsetY];
      this.moved = this.pointers.size > 1;
      if (this.going) this.aim = { from: this.toMap(event.offsetX, event.offsetY), to: null };
    });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => {
      const only = this.pointers.size === 1;
      this.pointers.delete(event.pointerId);
      if (this.going && only && this.aim) this.sendGoal();
      else if (only && !this.moved) this.pick(event.offsetX, event.offsetY);
    });
    canvas.addEventListener("pointercancel", (event) => {
      this.pointers.delete(event.pointerId);
      this.aim = null;
    });
    canvas.addEventListener("pointerleave", () => (element("place").textContent = ""));
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
      },
      { passive: false },
    );
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-60, 0], ArrowRight: [60, 0], ArrowUp: [0, -60], ArrowDown: [0, 60] }[event.key];
      if (step) this.pan(-step[0], -step[1]);
      else if (event.key === "+") this.zoom(1.4);
      else if (event.key === "-") this.zoom(1 / 1.4);
      else return;
      event.preventDefault();
    });
  }

  move(event) {
    const here = [event.offsetX, event.offsetY];
    const [x, y] = this.toMap(...here);
    element("place").textContent = `${(x / 1000).toFixed(2)}  ${(y / 1000).toFixed(2)} m`;
    const last = this.pointers.get(event.pointerId);
    if (!last) return;
    if (Math.hypot(here[0] - this.start[0], here[1] - this.start[1]) > CLICK_PX) this.moved = true;
    if (this.pointers.size === 2) {
      const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
      const before = Math.hypot(last[0] - other[0], last[1] - other[1]);
      const after = Math.hypot(here[0] - other[0], here[1] - other[1]);
      this.pan((here[0] - last[0]) / 2, (here[1] - last[1]) / 2);
      if (before > 0) this.zoom(after / before, (here[0] + other[0]) / 2, (here[1] + other[1]) / 2);
      this.aim = null;
    } else if (this.going) {
      if (this.aim && this.moved) this.aim.to = [x, y];
      this.draw();
    } else if (this.moved) {
      this.pan(here[0] - last[0], here[1] - last[1]);
    }
    this.pointers.set(event.pointerId, here);
  }

  pick(px, py) {
    const [x, y] = this.toMap(px, py);
    let nearest = null;
    let least = Math.max(BODY_MM * 1.3, 22 / this.view.scale);
    for (const [name, pose] of Object.entries(this.state.poses)) {
      if (pose === null) continue;
      const distance = Math.hypot(pose[0] - x, pose[1] - y);
      if (distance < least) [nearest, least] = [name, distance];
    }
    this.choose(nearest);
  }

  sendGoal() {
    const { from, to } = this.aim;
    this.aim = null;
    const request = { do: "goal", robot: this.state.chosen, x: from[0] / 1000, y: from[1] / 1000 };
    if (to) request.yaw = Math.atan2(to[1] - from[1], to[0] - from[0]);
    if (!this.send(request)) this.notice("error", "no connection to the monitor: the goal was not sent");
    this.draw();
  }

  // ------------------------------------------------------------ view

  toMap(px, py) {
    const { x, y, scale } = this.view;
    return [x + (px - this.width / 2) / scale, y - (py - this.height / 2) / scale];
  }

  pan(px, py) {
    this.held = true;
    this.view.x -= px / this.view.scale;
    this.view.y += py / this.view.scale;
    this.draw();
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    this.held = true;
    const [x, y] = this.toMap(px, py);
    const { least, most } = PIXELS_PER_MM;
    this.view.scale = Math.min(most, Math.max(least, this.view.scale * factor));
    const [nowX, nowY] = this.toMap(px, py);
    this.view.x += x - nowX;
    this.view.y += y - nowY;
    this.draw();
  }

  fit() {
    const xs = [];
    const ys = [];
    const add = (x, y, reach) => {
      xs.push(x - reach, x + reach);
      ys.push(y - reach, y + reach);
    };
    for (const pose of Object.values(this.state.poses)) if (pose) add(pose[0], pose[1], 150);
    for (const [x, y, yaw, length, width] of this.state.arena.boxes) {
      const [cosine, sine] = [Math.abs(Math.cos(yaw / 1000)), Math.abs(Math.sin(yaw / 1000))];
      xs.push(x - (length * cosine + width * sine) / 2, x + (length * cosine + width * sine) / 2);
      ys.push(y - (length * sine + width * cosine) / 2, y + (length * sine + width * cosine) / 2);
    }
    for (const [x, y, radius] of this.state.arena.circles) add(x, y, radius);
    if (!xs.length) return false;
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const room = 1 - SPARE;
    this.view.x = (left + right) / 2;
    this.view.y = (low + high) / 2;
    this.view.scale = Math.min(
      (this.width * room) / Math.max(right - left, 300),
      ((this.height - 2 * EDGE_PX) * room) / Math.max(high - low, 300),
    );
    this.draw();
    return true;
  }

  resize() {
    const { clientWidth, clientHeight } = element("map");
    const ratio = devicePixelRatio || 1;
    this.width = clientWidth;
    this.height = clientHeight;
    this.canvas.width = Math.round(clientWidth * ratio);
    this.canvas.height = Math.round(clientHeight * ratio);
    this.paper.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (!this.held) this.fit();
    this.draw();
  }

  // ------------------------------------------------------------ news

  update(news) {
    if ("poses" in news) this.keepTrails();
    const count = Object.keys(this.state.poses).length;
    if (!this.held && this.fittedFor !== this.sceneKey(count) && this.fit()) this.fittedFor = this.sceneKey(count);
    this.draw();
  }

  /** What is there to be seen: when it changes, everything is shown anew. */
  sceneKey(count) {
    return `${count} ${this.state.arena.boxes.length} ${this.state.fleet.robots.filter((robot) => robot.located).length}`;
  }

  keepTrails() {
    const now = Date.now();
    for (const [name, pose] of Object.entries(this.state.poses)) {
      if (pose === null) continue;
      const trail = this.trails.get(name) || [];
      this.trails.set(name, trail);
      const last = trail[trail.length - 1];
      const step = last ? Math.hypot(pose[0] - last[0], pose[1] - last[1]) : Infinity;
      // A robot that was carried, or whose odometry was set: no line across the map.
      if (last && step > 500) trail.length = 0;
      if (step > TRAIL_STEP_MM) trail.push([pose[0], pose[1], now]);
    }
    for (const [name, trail] of this.trails) {
      while (trail.length && now - trail[0][2] > TRAIL_MS) trail.shift();
      if (!(name in this.state.poses)) this.trails.delete(name);
    }
  }

  // ------------------------------------------------------------ drawing

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.paint();
    });
  }

  paint() {
    if (!this.width) return;
    const { paper, view, state } = this;
    const style = getComputedStyle(document.documentElement);
    this.ink = (name) => style.getPropertyValue(name).trim();
    paper.save();
    paper.fillStyle = this.ink("--floor");
    paper.fillRect(0, 0, this.width, this.height);
    paper.translate(this.width / 2, this.height / 2);
    paper.scale(view.scale, -view.scale);
    paper.translate(-view.x, -view.y);
    this.paintGrid();
    this.paintArena();
    const robots = state.fleet.robots.filter((robot) => robot.state !== "REFUSED" && state.poses[robot.name]);
    if (this.shows.trails) for (const robot of robots) this.paintTrail(robot);
    if (this.shows.truth) for (const robot of robots) this.paintTruth(robot);
    for (const robot of robots) this.paintGoal(robot);
    if (this.shows.beams) for (const robot of robots) this.paintBeams(robot);
    for (const robot of robots) this.paintRobot(robot);
    if (this.aim) this.paintAim();
    paper.restore();
    if (this.shows.names) this.paintNames(robots);
    this.paintScale();
  }

  at(pose, paint) {
    const { paper } = this;
    paper.save();
    paper.translate(pose[0], pose[1]);
    paper.rotate(pose[2] / 1000);
    paint(paper);
    paper.restore();
  }

  paintGrid() {
    const { paper, view } = this;
    const steps = [10, 100, 1000, 10000];
    const fine = steps.find((step) => step * view.scale >= 14) || 100000;
    const [left, low] = this.toMap(0, this.height);
    const [right, high] = this.toMap(this.width, 0);
    for (const [step, ink] of [[fine, "--grid"], [fine * 10, "--grid-bold"]]) {
      paper.strokeStyle = this.ink(ink);
      paper.lineWidth = 1 / view.scale;
      paper.beginPath();
      for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
        paper.moveTo(x, low);
        paper.lineTo(x, high);
      }
      for (let y = Math.ceil(low / step) * step; y <= high; y += step) {
        paper.moveTo(left, y);
        paper.lineTo(right, y);
      }
      paper.stroke();
    }
  }

  paintArena() {
    const { paper, state, view } = this;
    paper.fillStyle = this.ink("--wall");
    for (const [x, y, yaw, length, width] of state.arena.boxes) {
      const thick = Math.max(width, 3 / view.scale);
      this.at([x, y, yaw], () => paper.fillRect(-length / 2, -thick / 2, length, thick));
    }
    for (const [x, y, radius] of state.arena.circles) {
      paper.beginPath();
      paper.arc(x, y, radius, 0, 2 * Math.PI);
      paper.fill();
    }
  }

  paintTrail(robot) {
    const trail = this.trails.get(robot.name);
    if (!trail || trail.length < 2) return;
    const { paper, view } = this;
    const now = Date.now();
    paper.lineWidth = Math.max(5, 1.5 / view.scale);
    paper.lineJoin = paper.lineCap = "round";
    // In a few pieces, the older the fainter.
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
      paper.strokeStyle = colourOf(robot.id, TRAIL_INKS[index]);
      paper.stroke(piece);
    });
  }

  paintTruth(robot) {
    const truth = this.state.truth[robot.name];
    if (!truth) return;
    const { paper, view } = this;
    paper.strokeStyle = this.ink("--ink");
    paper.lineWidth = 1.2 / view.scale;
    paper.setLineDash([4 / view.scale, 3 / view.scale]);
    this.at(truth, () => {
      paper.beginPath();
      paper.arc(0, 0, BODY_MM, 0, 2 * Math.PI);
      paper.moveTo(0, 0);
      paper.lineTo(BODY_MM * 1.35, 0);
      paper.stroke();
    });
    paper.setLineDash([]);
  }

  paintGoal(robot) {
    const goal = this.state.goals[robot.name];
    if (!goal) return;
    const { paper, view, state } = this;
    const pose = state.poses[robot.name];
    paper.strokeStyle = paper.fillStyle = colourOf(robot.id);
    paper.lineWidth = Math.max(3, 1.5 / view.scale);
    paper.setLineDash([14, 12]);
    paper.beginPath();
    paper.moveTo(pose[0], pose[1]);
    paper.lineTo(goal[0], goal[1]);
    paper.stroke();
    paper.setLineDash([]);
    for (const radius of [26, 11]) {
      paper.beginPath();
      paper.arc(goal[0], goal[1], Math.max(radius, (radius / 4) / view.scale), 0, 2 * Math.PI);
      if (radius === 11) paper.fill();
      else paper.stroke();
    }
  }

  paintBeams(robot) {
    const ranges = this.state.ranges[robot.name];
    if (!ranges || robot.state !== "READY") return;
    const { paper, view } = this;
    this.at(this.state.poses[robot.name], () => {
      ranges.forEach((range, index) => {
        const turn = -Math.PI + (index * 2 * Math.PI) / ranges.length;
        const [cosine, sine] = [Math.cos(turn), Math.sin(turn)];
        if (range === null || range < 0) {
          // Nothing in reach: a tick that shows where the sensor looks.
          paper.strokeStyle = this.ink("--beam-free");
          paper.lineWidth = 1 / view.scale;
          paper.beginPath();
          paper.moveTo(BODY_MM * cosine, BODY_MM * sine);
          paper.lineTo((BODY_MM + 14) * cosine, (BODY_MM + 14) * sine);
          paper.stroke();
          return;
        }
        const near = Math.min(1, Math.max(0, (range - BODY_MM) / (SENSOR_REACH_MM - BODY_MM)));
        const reach = Math.max(range, BODY_MM);
        const ink = `hsl(${(near * 48).toFixed(0)} 90% ${isDark() ? 58 : 44}%)`;
        paper.strokeStyle = paper.fillStyle = ink;
        paper.lineWidth = Math.max(2.5, 1 / view.scale);
        paper.globalAlpha = 0.45;
        paper.beginPath();
        paper.moveTo(BODY_MM * cosine, BODY_MM * sine);
        paper.lineTo(reach * cosine, reach * sine);
        paper.stroke();
        paper.globalAlpha = 1;
        paper.beginPath();
        paper.arc(reach * cosine, reach * sine, Math.max(5, 2 / view.scale), 0, 2 * Math.PI);
        paper.fill();
      });
    });
  }

  paintRobot(robot) {
    const { paper, view, state } = this;
    const here = robot.state === "READY";
    const light = state.lights[robot.name];
    this.at(state.poses[robot.name], () => {
      paper.globalAlpha = here ? 1 : 0.4;
      if (light) {
        const glow = paper.createRadialGradient(0, 0, BODY_MM * 0.6, 0, 0, BODY_MM * 2);
        glow.addColorStop(0, light + "99");
        glow.addColorStop(1, light + "00");
        paper.fillStyle = glow;
        paper.beginPath();
        paper.arc(0, 0, BODY_MM * 2, 0, 2 * Math.PI);
        paper.fill();
      }
      paper.fillStyle = this.ink("--tyre");
      for (const side of [-1, 1]) {
        paper.fillRect(-WHEEL_MM[0], side * WHEEL_MM[2] - WHEEL_MM[1] / 2, 2 * WHEEL_MM[0], WHEEL_MM[1]);
      }
      paper.fillStyle = this.ink("--shell");
      paper.strokeStyle = colourOf(robot.id);
      paper.lineWidth = Math.max(6, 1.6 / view.scale);
      if (!here) paper.setLineDash([12, 9]);
      paper.beginPath();
      paper.arc(0, 0, BODY_MM - 3, 0, 2 * Math.PI);
      paper.fill();
      paper.stroke();
      paper.setLineDash([]);
      // An arrowhead says where ahead is.
      paper.fillStyle = colourOf(robot.id);
      paper.beginPath();
      paper.moveTo(BODY_MM * 1.38, 0);
      paper.lineTo(BODY_MM * 0.72, BODY_MM * 0.48);
      paper.lineTo(BODY_MM * 0.72, -BODY_MM * 0.48);
      paper.closePath();
      paper.fill();
      paper.fillStyle = light || this.ink("--dark-light");
      paper.beginPath();
      paper.arc(-2, 0, BODY_MM * 0.42, 0, 2 * Math.PI);
      paper.fill();
      paper.globalAlpha = 1;
      if (robot.name === state.chosen) {
        paper.strokeStyle = this.ink("--accent");
        paper.lineWidth = 2.5 / view.scale;
        paper.beginPath();
        paper.arc(0, 0, BODY_MM * 1.5 + 4 / view.scale, 0, 2 * Math.PI);
        paper.stroke();
      }
    });
  }

  paintAim() {
    const { paper, view } = this;
    const { from, to } = this.aim;
    paper.strokeStyle = paper.fillStyle = this.ink("--accent");
    paper.lineWidth = 2 / view.scale;
    paper.beginPath();
    paper.arc(from[0], from[1], 6 / view.scale, 0, 2 * Math.PI);
    paper.fill();
    if (!to) return;
    paper.beginPath();
    paper.moveTo(from[0], from[1]);
    paper.lineTo(to[0], to[1]);
    paper.stroke();
  }

  paintNames(robots) {
    const { paper, view, state } = this;
    paper.font = "600 12px system-ui, sans-serif";
    paper.textAlign = "center";
    paper.textBaseline = "top";
    paper.lineWidth = 3;
    paper.strokeStyle = this.ink("--floor");
    for (const robot of robots) {
      const pose = state.poses[robot.name];
      const x = this.width / 2 + (pose[0] - view.x) * view.scale;
      const y = this.height / 2 - (pose[1] - view.y) * view.scale + BODY_MM * 1.25 * view.scale + 3;
      // Where names would lie on each other the number has to do.
      const short = robots.length > 12 && BODY_MM * view.scale < 22 && robot.name !== state.chosen && robot.id >= 0;
      const text = short ? String(robot.id) : robot.name;
      paper.strokeText(text, x, y);
      paper.fillStyle = robot.state === "READY" ? this.ink("--ink") : this.ink("--bad");
      paper.fillText(text, x, y);
    }
  }

  paintScale() {
    const { paper, view } = this;
    const length = [10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000].find((mm) => mm * view.scale > 60) || 10000;
    const wide = length * view.scale;
    const [x, y] = [14, this.height - 14];
    paper.strokeStyle = paper.fillStyle = this.ink("--quiet");
    paper.lineWidth = 1.5;
    paper.beginPath();
    paper.moveTo(x, y - 5);
    paper.lineTo(x, y);
    paper.lineTo(x + wide, y);
    paper.lineTo(x + wide, y - 5);
    paper.stroke();
    paper.font = "12px system-ui, sans-serif";
    paper.textAlign = "left";
    paper.textBaseline = "bottom";
    paper.fillText(length < 1000 ? `${length / 10} cm` : `${length / 1000} m`, x + 5, y - 3);
  }
}
