// Buttons that are held by finger, mouse or keyboard; HoldButton acts only after a while: never on a tap.

const STEP_MS = 50;
const GAP_MS = 400; // the page was suspended: the hold does not count

/** Call begin(event) when a pointer or one of these keys holds a button, and end() however that ends. */
export function listenToHold(button, keys, begin, end) {
  button.addEventListener("pointerdown", begin);
  for (const name of ["pointerup", "pointercancel", "pointerleave", "lostpointercapture", "blur"]) {
    button.addEventListener(name, end);
  }
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  button.addEventListener("keydown", (event) => {
    if (!keys.includes(event.code)) return;
    event.preventDefault();
    if (!event.repeat) begin(event);
  });
  button.addEventListener("keyup", (event) => keys.includes(event.code) && end());
}

export class HoldButton {
  button; holdMs; mayHold; onHeld; onShort;

  /** mayHold(): whether a hold may begin or continue. */
  constructor(button, holdMs, { mayHold, onHeld, onShort }) {
    Object.assign(this, { button, holdMs, mayHold, onHeld, onShort });
    this.timer = null;
    const begin = (event) => event.isPrimary !== false && !event.button && this.begin();
    listenToHold(button, ["Space", "Enter"], begin, () => this.end());
    document.addEventListener("visibilitychange", () => this.end());
  }

  begin() {
    this.end();
    if (!this.mayHold()) return this.onShort();
    this.beganMs = this.steppedMs = performance.now();
    this.timer = setInterval(() => this.step(), STEP_MS);
    this.button.classList.add("holding");
  }

  step() {
    const now = performance.now();
    if (now - this.steppedMs > GAP_MS || !this.mayHold()) return this.end();
    this.steppedMs = now;
    if (now - this.beganMs < this.holdMs) return;
    this.stopTimer();
    this.onHeld();
  }

  end() {
    if (this.timer === null) return;
    this.stopTimer();
    this.onShort();
  }

  stopTimer() {
    clearInterval(this.timer);
    this.timer = null;
    this.button.classList.remove("holding");
  }
}
