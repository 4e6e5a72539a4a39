// STOP ALL: its status from the press until all wheels are at rest, even if the monitor does not answer; and Release.
//
// STOP ALL acts when it is pressed, at a place that never changes. Release is at the other end of the page, needs
// a hold, and does nothing for a while after a stop.

import { element, setText } from "./dom.js";
import { HoldButton } from "./hold.js";

const ANSWER_MS = 1400; // with one step of the timer, a missing answer shows within 1.5 s
const STEP_MS = 100;
const HOLD_MS = 1000;
const INERT_MS = 2000;

export class StopPanel {
  connection; endDrive; notice;

  constructor({ connection, endDrive, notice }) {
    Object.assign(this, { connection, endDrive, notice });
    this.pressedMs = null; // when it was pressed; null once the monitor has acknowledged that
    this.status = null; // the monitor's status of the last request
    this.stopped = false; // whether all drivers report that they have stopped
    this.heardMs = 0; // while robots are being stopped the monitor sends updates all the time
    this.mayRelease = true; // pupils stop, teachers release
    this.inertMs = 0; // until then Release does nothing
    const stop = element("stop");
    stop.addEventListener("pointerdown", () => this.press());
    // From the keyboard; of a finger or the mouse this is the end of a press that has counted.
    stop.addEventListener("click", (event) => event.detail === 0 && this.press());
    stop.addEventListener("contextmenu", (event) => event.preventDefault());
    new HoldButton(element("release"), HOLD_MS, {
      mayHold: () => this.stopped && connection.isFresh && Date.now() >= this.inertMs,
      onHeld: () => this.release(),
      onShort: () => this.notice("info", "Hold Release for 1 s: robots may move then."),
    });
    setInterval(() => this.show(), STEP_MS);
  }

  press() {
    this.endDrive();
    this.delayRelease();
    this.pressedMs = this.pressedMs ?? Date.now();
    this.connection.send({ do: "stop" });
    this.show();
  }

  delayRelease() {
    this.inertMs = Date.now() + INERT_MS;
  }

  release() {
    this.pressedMs = null;
    if (!this.connection.send({ do: "release" })) this.notice("error", "NOT RELEASED: no connection to the monitor");
  }

  /** Send on a new connection what was pressed without one. */
  open() {
    if (this.pressedMs !== null) this.connection.send({ do: "stop" });
  }

  receive(updates) {
    this.heardMs = Date.now();
    if (updates.received === "stop") this.pressedMs = null;
    if ("fleet" in updates) {
      if (updates.fleet.stopped && !this.stopped) this.delayRelease();
      this.stopped = updates.fleet.stopped;
    }
    if ("stop" in updates) {
      const passing = updates.stop !== null && updates.stop.is_final && updates.stop.level !== "error" && !this.stopped;
      if (passing && this.status !== null) this.notice(updates.stop.level, updates.stop.text);
      const pending = updates.stop !== null && !updates.stop.is_final && updates.stop.level !== "error";
      if (pending) this.delayRelease(); // perhaps of another page
      this.status = updates.stop;
    }
    this.show();
  }

  /** Why the outcome is unknown; null while the monitor answers. */
  failure() {
    const pressed = this.pressedMs !== null;
    if (!pressed && (this.status === null || this.status.is_final)) return null;
    if (!this.connection.isOpen) return "there is no connection to the monitor";
    if (!pressed && this.status.level === "error") return null;
    return Date.now() - (pressed ? this.pressedMs : this.heardMs) >= ANSWER_MS ? "the monitor does not answer" : null;
  }

  /** Level and text of the banner; null for none. */
  describe() {
    const failure = this.failure();
    if (failure !== null) return ["error", `NOT STOPPED: ${failure}`];
    if (this.pressedMs !== null) return ["warn", "stopping"];
    if (this.status === null || !this.connection.isFresh) return null;
    const { level, text, is_final: isFinal } = this.status;
    return this.stopped || !isFinal || level === "error" ? [level, text] : null;
  }

  show() {
    const [level, text] = this.describe() || ["", ""];
    const banner = element("stopping");
    banner.toggleAttribute("hidden", text === ""); // what is so already is not painted anew
    if (banner.dataset.level !== level) banner.dataset.level = level;
    setText(banner, text);
    const atRest = this.stopped && this.connection.isFresh && level !== "error" && level !== "warn";
    element("stop").classList.toggle("done", atRest);
    setText(element("stop"), atRest ? "STOPPED" : "STOP ALL");
    element("release_bar").toggleAttribute("hidden", !this.stopped);
    element("release").hidden = !this.mayRelease;
    setText(element("release_note"), this.mayRelease ? "Robots may move then." : "The teacher releases the robots.");
    const { classList } = element("release");
    classList.toggle("inert", Date.now() < this.inertMs);
    setText(element("release"), classList.contains("holding") ? "Keep holding ..." : "Release: hold 1 s");
  }
}
