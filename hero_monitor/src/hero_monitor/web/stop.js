// STOP ALL: what people see from the press until all wheels are at rest, also where the monitor does not answer.

const ANSWER_MS = 1400; // with one step of the timer, people see within 1.5 s that nothing came back
const STEP_MS = 100;
const ASK_MS = 4000;

const element = (id) => document.getElementById(id);

export class StopPanel {
  constructor({ send, isOpen, letGo, notice }) {
    this.send = send;
    this.isOpen = isOpen;
    this.letGo = letGo;
    this.notice = notice;
    this.pressedMs = null; // when it was pressed; null once the monitor has acknowledged that
    this.status = null; // what the monitor says of the last request
    this.stopped = false; // whether the drivers say that all robots are stopped
    this.heardMs = 0; // while robots are being stopped the monitor says something all the time
    this.askedMs = 0;
    element("stop").addEventListener("click", () => this.press());
    element("release").addEventListener("click", () => this.release());
    setInterval(() => this.show(), STEP_MS);
  }

  press() {
    this.letGo();
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

  /** A new connection: what was pressed without one is sent now. */
  open() {
    if (this.pressedMs !== null) this.send({ do: "stop", stop: true });
  }

  receive(news) {
    this.heardMs = Date.now();
    if (news.received === "stop") this.pressedMs = null;
    if ("fleet" in news) this.stopped = news.fleet.stopped;
    if ("stop" in news) {
      const passing = news.stop !== null && news.stop.is_final && news.stop.level !== "error" && !this.stopped;
      if (passing && this.status !== null) this.notice(news.stop.level, news.stop.text);
      this.status = news.stop;
    }
    this.show();
  }

  /** Why nobody can say whether the robots stop; null while the monitor answers. */
  failure() {
    const pressed = this.pressedMs !== null;
    if (!pressed && (this.status === null || this.status.is_final)) return null;
    if (!this.isOpen()) return "there is no connection to the monitor";
    if (!pressed && this.status.level === "error") return null;
    return Date.now() - (pressed ? this.pressedMs : this.heardMs) >= ANSWER_MS ? "the monitor does not answer" : null;
  }

  /** Level and text for people, null for nothing. */
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
