// The socket to the monitor: opened again and again, and what it tells of the monitor's health.
//
// Several times a second the monitor sends its clock. Silence means that all on this page is outdated; and each request
// returns the clock as last heard, so that the monitor ignores what a socket held while something paused.

const RETRY_MS = 1000;
const SILENT_MS = 1600; // of the monitor, or of this page: with one step of the timer it shows within 2 s
const STEP_MS = 200;
const LATE_MS = 1000;

/** Whether an input was made before the page was suspended or too busy to take it. */
export const isLate = (event) => event.isTrusted && performance.now() - event.timeStamp > LATE_MS;

export class Connection {
  onOpen; onUpdates; onChange; onPause;

  /** onOpen(), onUpdates(updates), onChange(): the health has changed; onPause(): this page was suspended. */
  constructor(handlers) {
    Object.assign(this, handlers);
    this.socket = null;
    this.clockMs = this.clockHeardMs = 0;
    this.heardMs = 0; // when anything arrived
    this.steppedMs = Date.now();
    this.isFresh = false;
    setInterval(() => this.step(), STEP_MS);
    document.addEventListener("visibilitychange", () => this.step());
  }

  get isOpen() {
    return this.socket !== null && this.socket.readyState === WebSocket.OPEN;
  }

  /** Whether requests queue up on a stalled network: commands of a held button must not. */
  get isCongested() {
    return this.socket !== null && this.socket.bufferedAmount > 0;
  }

  /** The monitor's clock now, or a little before: a press is newer than the stop or release that this page has seen. */
  get nowMs() {
    return Math.floor(this.clockMs + performance.now() - this.clockHeardMs);
  }

  /** Send a request; false without a connection. */
  send(request) {
    if (!this.isOpen) return false;
    this.socket.send(JSON.stringify({ ...request, heard_ms: this.clockMs }));
    return true;
  }

  step() {
    const now = Date.now();
    if (now - this.steppedMs > SILENT_MS && !document.hidden) {
      this.heardMs = Math.min(this.heardMs, this.steppedMs);
      this.onPause();
    }
    this.steppedMs = now;
    this.updateFreshness();
  }

  updateFreshness() {
    const isFresh = this.isOpen && Date.now() - this.heardMs <= SILENT_MS;
    if (isFresh === this.isFresh) return;
    this.isFresh = isFresh;
    this.onChange();
  }

  open() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket = socket;
    let opened = false;
    socket.addEventListener("open", () => {
      opened = true;
      this.onOpen();
    });
    socket.addEventListener("message", (event) => {
      const updates = JSON.parse(event.data);
      this.heardMs = Date.now();
      if ("clock_ms" in updates) {
        this.clockMs = updates.clock_ms;
        this.clockHeardMs = performance.now();
      }
      this.updateFreshness();
      this.onUpdates(updates);
    });
    socket.addEventListener("close", async () => {
      this.socket = null;
      this.isFresh = false;
      this.onChange();
      if (!opened) await this.findLogin();
      setTimeout(() => this.open(), RETRY_MS);
    });
  }

  /** A restarted monitor may have another token: then this page becomes the login page. */
  async findLogin() {
    try {
      const page = await (await fetch(".", { cache: "no-store" })).text();
      if (page.includes("login.js")) location.reload();
    } catch {
      // It does not answer; keep trying.
    }
  }
}
