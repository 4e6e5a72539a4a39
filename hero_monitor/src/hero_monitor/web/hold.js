// A button that acts when it is held for a while, by finger, mouse or keyboard: no tap does it by mistake.

const STEP_MS = 50;
const GAP_MS = 400; // the page was suspended: the hold does not count

export class HoldButton {
  /** mayHold(): whether a hold may begin or continue. */
  constructor(button, holdMs, { mayHold, onHeld, onShort }) {
    Object.assign(this, { button, holdMs, mayHold, onHeld, onShort });
    this.timer = null;
    button.addEventListener("pointerdown", (event) => event.isPrimary && event.button === 0 && this.begin());
    for (const end of ["pointerup", "pointercancel", "pointerleave", "blur"]) {
      button.addEventListener(end, () => this.end());
    }
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    button.addEventListener("keydown", (event) => {
      if (event.code !== "Space" && event.code !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) this.begin();
    });
    button.addEventListener("keyup", () => this.end());
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
