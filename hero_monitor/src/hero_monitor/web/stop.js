// STOP ALL: its status from the press until all wheels are at rest, even if the monitor does not answer.

const ANSWER_MS = 1400; // with one step of the timer, a missing answer shows within 1.5 s
const STEP_MS = 100;
const ASK_MS = 4000;

const element = (id) => document.getElementById(id);

export class StopPanel {
  constructor({ send, isOpen, releaseRobot, notice }) {
    this.send = send;
    this.isOpen = isOpen;
    this.releaseRobot = releaseRobot;
    this.notice = notice;
    this.pressedMs = null; // when it was pressed; null once the monitor has acknowledged that
    this.status = null; // the monitor's status of the last request
    this.stopped = false; // whether all drivers report that they have stopped
    this.heardMs = 0; // while robots are being stopped the monitor sends updates all the time
    this.askedMs = 0;
    element("stop").addEventListener("click", () => this.press());
    element("release").addEventListener("click", () => this.release());
    setInterval(() => this.show(), STEP_MS);
  }

  press() {
    this.releaseRobot();
    this.pressedMs = this.pressedMs ?? Date.now();
    this.send({ do: "stop", stop: true });
    this.show();
  }

  /** Two clicks: robots may move afterwards. */
  release() {
    const asked = Date.now() - this.askedMs < ASK_MS;
    this.askedMs = asked ? 0 : Date.now();
    if (!asked) return;
    this.pressedMs = null;
    if (!this.send({ do: "stop", stop: false })) this.notice("error", "NOT RELEASED: no connection to the monitor");
  }

  /** Send on a new connection what was pressed without one. */
  open() {
    if (this.pressedMs !== null) this.send({ do: "stop", stop: true });
  }

  receive(updates) {
    this.heardMs = Date.now();
    if (updates.received === "stop") this.pressedMs = null;
    if ("fleet" in updates) this.stopped = updates.fleet.stopped;
    if ("stop" in updates) {
      const passing = updates.stop !== null && updates.stop.is_final && updates.stop.level !== "error" && !this.stopped;
      if (passing && this.status !== null) this.notice(updates.stop.level, updates.stop.text);
      this.status = updates.stop;
    }
    this.show();
  }

  /** Why the outcome is unknown; null while the monitor answers. */
  failure() {
    const pressed = this.pressedMs !== null;
    if (!pressed && (this.status === null || this.status.is_final)) return null;
    if (!this.isOpen()) return "there is no connection to the monitor";
    if (!pressed && this.status.level === "error") return null;
    return Date.now() - (pressed ? this.pressedMs : this.heardMs) >= ANSWER_MS ? "the monitor does not answer" : null;
  }

  /** Level and text of the banner; null for none. */
  describe() {
    const failure = this.failure();
    if (failure !== null) return ["error", `NOT STOPPED: ${failure}`];
    if (this.pressedMs !== null) return ["warn", "stopping"];
    if (this.status === null) return null;
    const { level, text, is_final: isFinal } = this.status;
    return this.stopped || !isFinal || level === "error" ? [level, text] : null;
  }

  show() {
    const [level, text] = this.describe() || ["", ""];
    const banner = element("stopping");
    banner.hidden = text === "";
    if (banner.dataset.level !== level) banner.dataset.level = level;
    if (banner.textContent !== text) banner.textContent = text;
    const atRest = this.stopped && level !== "error" && level !== "warn";
    element("stop").classList.toggle("done", atRest);
    element("stop").textContent = atRest ? "STOPPED" : "STOP ALL";
    element("release").hidden = !this.stopped;
    element("release").textContent = Date.now() - this.askedMs < ASK_MS ? "Click again to release" : "Release robots";
  }
}
