// Programs on the chosen robots, those that run, and the recording. They belong to the monitor: every page shows them.

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

const element = (id) => document.getElementById(id);
const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;

export class ProgramPanel {
  constructor({ connection, map, notice }) {
    this.connection = connection;
    this.map = map;
    this.notice = notice;
    this.names = [];
    this.offers = [];
    this.rows = new Map(); // of programs that run, by number
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

  get offer() {
    return this.offers.find((offer) => offer.program === element("program").value);
  }

  start() {
    const inputs = [...element("fields").querySelectorAll("input, select")];
    if (!inputs.every((input) => input.reportValidity())) return;
    const read = (input) => (input.type === "checkbox" ? input.checked : input.type === "number" ? Number(input.value) : input.value);
    const values = Object.fromEntries(inputs.map((input) => [input.name, read(input)]));
    const request = { do: "start", program: this.offer.program, robots: this.names };
    if (!this.offer.fields.some((field) => field.on_map)) return this.send({ ...request, values });
    this.map.askPlace(`Click the center of the ${this.offer.title}; drag to turn it.`, ({ x, y, yaw }) => {
      this.map.askPlace(null);
      const turn = ((yaw ?? 0) * 180) / Math.PI;
      this.send({ ...request, values: { ...values, x_m: x, y_m: y, turn_deg: turn } });
    });
  }

  showFields() {
    const fields = this.offer ? this.offer.fields.filter((field) => !field.on_map) : [];
    element("fields").replaceChildren(
      ...fields.map((field) => {
        const label = document.createElement("label");
        const input = document.createElement(field.options.length ? "select" : "input");
        input.name = field.name;
        if (field.options.length) for (const option of field.options) input.add(new Option(option));
        else input.type = typeof field.default === "boolean" ? "checkbox" : "number";
        if (input.type === "number") Object.assign(input, { min: field.low, max: field.high, step: field.whole ? 1 : "any", required: true });
        if (input.type === "checkbox") input.checked = field.default;
        else input.value = field.default;
        const words = WORDS[field.name] || field.name.replace(UNIT, "").replaceAll("_", " ");
        label.append(field.unit ? `${words}, ${field.unit}` : words, input);
        return label;
      }),
    );
  }

  show(state, names) {
    this.names = names;
    const { programs, record } = state.offers;
    if (this.offers !== programs) {
      const chosen = element("program").value;
      this.offers = programs;
      const options = (some) => some.map(({ title, program }) => new Option(title, program));
      const behaviors = document.createElement("optgroup");
      behaviors.label = "behaviors";
      behaviors.append(...options(programs.filter((offer) => offer.is_behavior)));
      element("program").replaceChildren(...options(programs.filter((offer) => !offer.is_behavior)), behaviors);
      if (programs.some(({ program }) => program === chosen)) element("program").value = chosen;
      this.showFields();
    }
    element("launcher").hidden = names.length === 0 || programs.length === 0 || !state.isFresh;
    element("stop_some").textContent = `Stop ${names.length === 1 ? names[0] : `these ${names.length}`}`;
    this.showRunning(state.programs.filter(({ program }) => program !== "record" || state.isFresh));
    this.recording = state.programs.find(({ program, failure }) => program === "record" && !failure);
    element("recorder").hidden = !record || !state.hello.control;
    element("record").setAttribute("aria-pressed", String(Boolean(this.recording)));
    const { seconds = 0, bytes = 0, folder = "" } = this.recording || {};
    const length = bytes ? clock(seconds) : "starting";
    if (this.recording) this.recorded = `${length}, ${(bytes / 1e6).toFixed(1)} MB in ${folder}`;
    element("recorded").textContent = this.recording ? this.recorded : this.recorded && `recorded ${this.recorded}`;
    element("rec").hidden = !this.recording;
    element("rec").textContent = `rec ${length}`;
  }

  showRunning(programs) {
    const left = new Set(this.rows.keys());
    for (const { number, program, title, robots, seconds, ending, failure } of programs) {
      if (program === "record" && !failure) continue;
      left.delete(number);
      const row = this.rows.get(number) || this.addRow(number);
      const what = robots.length === 1 ? robots[0] : `${robots.length} robots`;
      const text = failure ? `${title} failed: ${failure}` : `${title}, ${what}, ${clock(seconds)}${ending ? ", ending" : ""}`;
      if (row.text.textContent !== text) row.text.textContent = text;
      row.line.classList.toggle("problem", Boolean(failure));
      row.button.textContent = failure ? "Dismiss" : "End";
      row.button.setAttribute("aria-label", `${row.button.textContent} ${title}`);
    }
    for (const number of left) {
      this.rows.get(number).line.remove();
      this.rows.delete(number);
    }
  }

  addRow(number) {
    const [line, text, button] = ["li", "span", "button"].map((tag) => document.createElement(tag));
    button.type = "button";
    button.addEventListener("click", () => this.send({ do: "end", number }));
    line.append(text, button);
    element("running").append(line);
    const row = { line, text, button };
    this.rows.set(number, row);
    return row;
  }
}
