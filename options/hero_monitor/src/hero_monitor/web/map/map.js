// The map, seen from above: x to the right, y up, as in ROS. Lengths in mm, angles in mrad.

import { element, make, setPressed } from "../dom.js";
import { isLate } from "../connection.js";
import { CameraPicture } from "./picture.js";
import { BODY_MM, MapPainter, TRAIL_MS } from "./painter.js";

const TRAIL_STEP_MM = 8;
const CLICK_PX = 6;
const PIXELS_PER_MM = { least: 0.01, most: 8 };
const LABEL_PX = 28; // of the frame's distance from the edge, and of a robot's radius
const MARGIN = 0.05; // of the map's size, around what Fit shows
const EDGE_PX = 36; // covered by tools above and hints below

export class FleetMap {
  state; choose; connection;

  constructor(state, { choose, connection }) {
    Object.assign(this, { state, choose, connection });
    this.canvas = element("canvas");
    this.painter = new MapPainter(this);
    // With select, clicks and drags choose robots in addition, as with Shift.
    this.shows = { trails: true, beams: true, numbers: true, ghosts: false, picture: false, select: false };
    this.picture = new CameraPicture(() => this.update({}));
    this.view = { x: 0, y: 0, scale: 0.3 };
    this.pinned = false; // then the view stays until Fit is pressed
    this.trails = new Map();
    this.reconnects = new Map(); // of each robot, as it was when its trail was drawn
    this.pointers = new Map();
    this.onPlace = null; // while a place is asked for
    this.aim = null;
    this.lasso = null;
    this.waiting = false;
    for (const name of Object.keys(this.shows)) {
      setPressed(element(name), this.shows[name]);
      element(name).addEventListener("click", () => this.toggle(name));
    }
    element("fit").addEventListener("click", () => {
      this.pinned = false;
      this.fit();
    });
    element("zoomin").addEventListener("click", () => this.zoom(1.4));
    element("zoomout").addEventListener("click", () => this.zoom(1 / 1.4));
    this.listen();
    new ResizeObserver(() => this.resize()).observe(element("map"));
  }

  toggle(name) {
    this.shows[name] = !this.shows[name];
    setPressed(element(name), this.shows[name]);
    this.requestShown();
    this.picture.show(this.shows.picture, this.state.picture);
    if (name === "ghosts" && !this.pinned) this.fit();
    this.draw();
  }

  /** Tell whether the picture is shown here; to be repeated on each connection. */
  requestShown() {
    this.connection.send({ do: "show", picture: this.shows.picture });
  }

  /** Ask for places, with a hint, until a hint of null: onPlace({x, y, yaw}) in m and rad, yaw after a drag alone. */
  askPlace(hint, onPlace = null) {
    this.onPlace = hint === null ? null : onPlace;
    this.aim = null;
    this.canvas.classList.toggle("going", hint !== null);
    element("hint").hidden = hint === null;
    element("hint").textContent = hint ?? "";
    this.draw();
  }

  /** Poses as drawn: simulated robots where they are. */
  get poses() {
    const { poses, ground_truth } = this.state;
    return Object.fromEntries(Object.entries(poses).map(([name, pose]) => [name, ground_truth[name] ?? pose]));
  }

  // ------------------------------------------------------------ pointer

  listen() {
    const canvas = this.canvas;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
      this.start = [event.offsetX, event.offsetY];
      this.moved = this.pointers.size > 1;
      const here = this.toMap(event.offsetX, event.offsetY);
      this.lasso = null;
      if (this.onPlace) this.aim = { from: here, to: null };
      else if (!this.moved && (this.shows.select || event.shiftKey)) this.lasso = [here];
    });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => {
      const only = this.pointers.size === 1;
      this.pointers.delete(event.pointerId);
      if (this.onPlace && only && this.aim && !isLate(event)) this.takePlace();
      else if (only && !this.moved) this.pick(event);
      else if (only && this.lasso) this.choose(this.findInLasso(), true);
      this.lasso = null;
      this.draw();
    });
    canvas.addEventListener("pointercancel", (event) => {
      this.pointers.delete(event.pointerId);
      this.aim = this.lasso = null;
    });
    for (const change of ["focus", "blur"]) canvas.addEventListener(change, () => this.draw());
    canvas.addEventListener("pointerleave", () => (element("place").textContent = ""));
    const turnWheel = (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
    };
    canvas.addEventListener("wheel", turnWheel, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }[event.key];
      if (step) this.pan(...step);
      else if (event.key === "+") this.zoom(1.4);
      else if (event.key === "-") this.zoom(1 / 1.4);
      else if (event.key === "Enter" && this.onPlace && !event.repeat && !isLate(event)) {
        this.aim = { from: [this.view.x, this.view.y], to: null };
        this.takePlace();
      }
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
      this.aim = this.lasso = null;
    } else if (this.lasso) {
      this.lasso.push([x, y]);
      this.draw();
    } else if (this.onPlace) {
      if (this.aim && this.moved) this.aim.to = [x, y];
      this.draw();
    } else if (this.moved) {
      this.pan(here[0] - last[0], here[1] - last[1]);
    }
    this.pointers.set(event.pointerId, here);
  }

  pick(event) {
    const [x, y] = this.toMap(event.offsetX, event.offsetY);
    let nearest = null;
    let least = Math.max(BODY_MM * 1.3, 22 / this.view.scale);
    for (const [name, pose] of Object.entries(this.poses)) {
      if (pose === null) continue;
      const distance = Math.hypot(pose[0] - x, pose[1] - y);
      if (distance < least) [nearest, least] = [name, distance];
    }
    const isAdded = this.lasso !== null || event.ctrlKey || event.metaKey;
    if (nearest !== null || !isAdded) this.choose(nearest === null ? [] : [nearest], isAdded);
  }

  /** Robots inside the loop. */
  findInLasso() {
    const loop = new Path2D();
    for (const place of this.lasso) loop.lineTo(place[0], place[1]);
    const context = make("canvas").getContext("2d"); // without the map's transformation
    const isInside = (pose) => pose && context.isPointInPath(loop, pose[0], pose[1], "evenodd");
    return Object.entries(this.poses).filter(([, pose]) => isInside(pose)).map(([name]) => name);
  }

  takePlace() {
    const { from, to } = this.aim;
    this.aim = null;
    const place = { x: from[0] / 1000, y: from[1] / 1000 };
    this.onPlace(to ? { ...place, yaw: Math.atan2(to[1] - from[1], to[0] - from[0]) } : place);
    this.draw();
  }

  // ------------------------------------------------------------ view

  toMap(px, py) {
    const { x, y, scale } = this.view;
    return [x + (px - this.width / 2) / scale, y - (py - this.height / 2) / scale];
  }

  toScreen(x, y) {
    const { view } = this;
    return [this.width / 2 + (x - view.x) * view.scale, this.height / 2 - (y - view.y) * view.scale];
  }

  pan(px, py) {
    this.pinned = true;
    this.view.x -= px / this.view.scale;
    this.view.y += py / this.view.scale;
    this.draw();
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    this.pinned = true;
    const [x, y] = this.toMap(px, py);
    const { least, most } = PIXELS_PER_MM;
    this.view.scale = Math.min(most, Math.max(least, this.view.scale * factor));
    const [nowX, nowY] = this.toMap(px, py);
    this.view.x += x - nowX;
    this.view.y += y - nowY;
    this.draw();
  }

  fit() {
    const { poses, replay, arena, drawings } = this.state;
    const places = []; // that are to be seen
    const add = ([left, low, right, high]) => places.push([left, low], [right, high]);
    const surround = ([x, y], reach) => places.push([x - reach, y - reach], [x + reach, y + reach]);
    const drawn = [replay, this.poses, this.shows.ghosts ? poses : {}].flatMap((shown) => Object.values(shown));
    for (const pose of drawn) if (pose) surround(pose, 150);
    if (arena.extent) add(arena.extent);
    for (const { lines = [], isBeam } of drawings) if (!isBeam) for (const place of lines.flat()) surround(place, 60);
    if (this.picture.shown) add(this.picture.shown.box);
    if (!places.length) return false;
    const [xs, ys] = [0, 1].map((axis) => places.map((place) => place[axis]));
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const room = 1 - MARGIN;
    const { offsetWidth, offsetHeight } = element("invite"); // of the class code, for an audience: nothing is drawn behind it
    const [side, below] = this.width > 3 * offsetWidth ? [offsetWidth, 0] : [0, offsetHeight];
    const edge = Math.min(this.height / 4, Math.max(EDGE_PX, element("frame").offsetHeight + LABEL_PX));
    this.view.x = (left + right) / 2;
    this.view.y = (low + high) / 2;
    this.view.scale = Math.min(
      ((this.width - side) * room) / Math.max(right - left, 300),
      ((this.height - 2 * edge - below) * room) / Math.max(high - low, 300),
    );
    this.view.x -= side / 2 / this.view.scale;
    this.view.y -= below / 2 / this.view.scale;
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
    this.painter.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (!this.pinned) this.fit();
    this.draw();
  }

  // ------------------------------------------------------------ updates

  update(updates) {
    if ("poses" in updates || "ground_truth" in updates) this.keepTrails();
    if ("picture" in updates) this.picture.show(this.shows.picture, this.state.picture);
    const { poses, ground_truth, replay, fleet, arena, drawings } = this.state;
    const count = Object.keys({ ...poses, ...replay }).length + Object.keys(ground_truth).length;
    const placed = fleet.robots.filter((robot) => robot.source).length;
    // When there is something else to see, the view fits it again.
    const scene = String([count, fleet.frame, this.picture.shown?.box, arena.boxes.length, drawings.length > 0, placed]);
    if (!this.pinned && this.fittedFor !== scene && this.fit()) this.fittedFor = scene;
    this.draw();
  }

  keepTrails() {
    const now = Date.now();
    const { frame } = this.state.fleet;
    if (frame !== this.trailsFrame) this.trails.clear();
    this.trailsFrame = frame;
    for (const { name, reconnects } of this.state.fleet.robots) {
      // It may be in another place, or another simulator: no line leads there.
      if (this.reconnects.get(name) !== reconnects) this.trails.delete(name);
      this.reconnects.set(name, reconnects);
    }
    for (const [name, pose] of Object.entries(this.poses)) {
      if (pose === null) continue;
      const trail = this.trails.get(name) || [];
      this.trails.set(name, trail);
      const last = trail[trail.length - 1];
      const step = last ? Math.hypot(pose[0] - last[0], pose[1] - last[1]) : Infinity;
      // The robot was moved by hand, or its odometry was set: no line across the map.
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
      if (this.width) this.painter.paint();
    });
  }
}
