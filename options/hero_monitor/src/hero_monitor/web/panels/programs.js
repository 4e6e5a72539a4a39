// Programs on the chosen robots, those that run, and the recording. They belong to the monitor: every page shows them.

import { groupOf, makePicture, sentenceOf } from "./about.js";
import { mayDrive } from "./lesson.js";
import { Lines, element, make, setPressed, setText } from "../dom.js";

const UNIT = /_(m_s|rad_s|1_s|m|s|deg|hz)$/;
const WORDS = {
  linear_m_s: "speed",
  cruise_m_s: "speed",
  leader_m_s: "leader's speed",
  max_linear_m_s: "speed limit",
  wheel_m_s: "wheel speed",
  angular_rad_s: "turn rate",
  own_m: "to own group",
  others_m: "to others",
};

const WALL_GAP_MM = 120; // of a robot on the circle from the middle of the wall

const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;

export class ProgramPanel {
  connection; map; notice;

  constructor({ connection, map, notice }) {
    Object.assign(this, { connection, map, notice });
    this.names = [];
    this.offers = [];
    this.rows = new Lines(element("running"), (number) => this.makeRow(number));
    this.recorded = ""; // by the last recording that this page has seen
    element("program").addEventListener("change", () => this.showFields());
    element("start").addEventListener("click", () => this.start());
    element("stop_some").addEventListener("pointerdown", () => this.stopSome());
    element("stop_some").addEventListener("click", (event) => event.detail === 0 && this.stopSome());
    element("record").addEventListener("click", () => this.send({ do: "record", on: !this.recording }));
  }

  send(request) {
    if (!this.connection.send(request)) this.notice("error", "no connection to the monitor: nothing was done");
  }

  stopSome() {
    this.send({ do: "stop_some", robots: this.names });
  }

  /** Whether a click on the map places the robots. */
  get isPlaced() {
    return Boolean(this.offer?.fields.some((field) => field.on_map));
  }

  get offer() {
    return this.offers.find((offer) => offer.program === element("program").value);
  }

  start() {
    const inputs = [...element("fields").querySelectorAll("input, select")];
    if (!inputs.every((input) => input.reportValidity())) return;
    const read = (input) => (input.type === "checkbox" ? input.checked : input.type === "number" ? Number(input.value) : input.value);
    const values = Object.fromEntries(inputs.map((input) => [input.name, read(input)]));
    const request = { do: "start", program: this.offer.program, robots: this.names };
    if (!this.isPlaced) return this.send({ ...request, values });
    this.map.askPlace(`Click the center of the ${this.offer.title}; drag to turn it.`, ({ x, y, yaw }) => {
      this.map.askPlace(null);
      const turn = ((yaw ?? 0) * 180) / Math.PI;
      this.send({ ...request, values: { ...values, x_m: x, y_m: y, turn_deg: turn } });
    });
  }

  /** The greatest spacing of a circle of so many robots that fits the arena, m; the usual one without an arena. */
  fitSpacing(usual, least) {
    const { extent } = this.map.state.arena;
    const count = this.names.length;
    if (count < 2 || extent === null) return usual;
    const [left, low, right, high] = extent;
    const radius = (Math.min(-left, -low, right, high) - WALL_GAP_MM) / 1000;
    const fitting = Math.floor(200 * Math.sin(Math.PI / count) * radius) / 100;
    return Math.max(least, Math.min(usual, fitting));
  }

  showFields() {
    if (this.offer) {
      const sentence = make("span", { className: "quiet" }, sentenceOf(this.offer));
      element("about").replaceChildren(...[makePicture(this.offer), sentence].filter((one) => one !== null));
    }
    const fields = this.offer ? this.offer.fields.filter((field) => !field.on_map) : [];
    element("fields").replaceChildren(
      ...fields.map(({ name, unit, default: value, choices, limits, step }) => {
        const words = WORDS[name] || name.replace(UNIT, "").replaceAll("_", " ");
        let input;
        if (choices.length) input = make("select", { name }, ...choices.map((choice) => new Option(choice)));
        else if (limits === null) input = make("input", { name, type: "checkbox", checked: value });
        else input = make("input", { name, type: "number", min: limits[0], max: limits[1], step, required: true });
        if (input.type !== "checkbox") input.value = name === "spacing_m" && this.isPlaced ? this.fitSpacing(value, limits[0]) : value;
        return make("label", {}, unit ? `${words}, ${unit}` : words, input);
      }),
    );
  }

  show(state, names) {
    const isOtherCount = names.length !== this.names.length;
    this.names = names;
    if (isOtherCount && this.isPlaced) this.showFields();
    const { programs, record } = state.offers;
    if (this.offers !== programs) {
      const chosen = element("program").value;
      this.offers = programs;
      const groups = [...new Set(programs.map(groupOf))];
      const list = (group) => programs.filter((offer) => groupOf(offer) === group).map(({ title, program }) => new Option(title, program));
      element("program").replaceChildren(...groups.map((group) => make("optgroup", { label: group }, ...list(group))));
      if (programs.some(({ program }) => program === chosen)) element("program").value = chosen;
      this.showFields();
    }
    const isTeacher = state.user.title === "teacher";
    element("launcher").hidden = names.length === 0 || programs.length === 0 || !state.isFresh || !mayDrive(state, names);
    element("stop_some").textContent = `Stop ${names.length === 1 ? names[0] : `these ${names.length}`}`;
    const isRecording = ({ program, failure }) => program === "record" && !failure;
    const shown = state.programs.filter((one) => !isRecording(one) && (one.program !== "record" || state.isFresh));
    this.rows.show(shown, ({ number }) => number, (row, program) => this.fill(row, program, state));
    this.recording = state.programs.find(isRecording);
    element("recorder").hidden = !record || !state.hello.control || !isTeacher;
    setPressed(element("record"), Boolean(this.recording));
    const { seconds = 0, bytes = 0, folder = "" } = this.recording || {};
    const length = bytes ? clock(seconds) : "starting";
    if (this.recording) this.recorded = `${length}, ${(bytes / 1e6).toFixed(1)} MB in ${folder}`;
    element("recorded").textContent = this.recording ? this.recorded : this.recorded && `recorded ${this.recorded}`;
    element("rec").hidden = !this.recording;
    element("rec").textContent = `rec ${length}`;
  }

  fill({ line, text, button }, { title, robots, seconds, ending, failure }, state) {
    const what = robots.length === 1 ? robots[0] : `${robots.length} robots`;
    setText(text, failure ? `${title} failed: ${failure}` : `${title}, ${what}, ${clock(seconds)}${ending ? ", ending" : ""}`);
    line.classList.toggle("problem", Boolean(failure));
    setText(button, failure ? "Dismiss" : "End");
    button.hidden = !mayDrive(state, robots);
    button.setAttribute("aria-label", `${button.textContent} ${title}`);
  }

  makeRow(number) {
    const [text, button] = [make("span"), make("button", { type: "button" })];
    button.addEventListener("click", () => this.send({ do: "end", number }));
    return { line: make("li", {}, text, button), text, button };
  }
}
