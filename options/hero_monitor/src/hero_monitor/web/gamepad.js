// A gamepad, by the rules of the page's buttons: the left shoulder button held, the left stick drives the chosen robots;
// B stops all robots; the D-pad chooses: left and right one robot, up all.
//
// Browsers tell this page of a gamepad only while it has the focus. What ended a drive ends it here, too, until the
// shoulder button is pressed again.

const STEP_MS = 50;
const ENABLE = 4, STOP = 1, UP = 12, LEFT = 14, RIGHT = 15; // of the standard mapping
const DEAD_ZONE = 0.15;

const shape = (value) => (Math.abs(value) < DEAD_ZONE ? 0 : -value);

export class GamepadInput {
  panel; stop; move;

  /** move: choose so many robots further; 0 for all. */
  constructor({ panel, stop, move }) {
    Object.assign(this, { panel, stop, move });
    this.held = new Set();
    this.timer = null;
    addEventListener("gamepadconnected", () => (this.timer ??= setInterval(() => this.step(), STEP_MS)));
  }

  step() {
    const gamepad = [...navigator.getGamepads()].find((one) => one && one.connected && one.mapping === "standard");
    const held = new Set();
    if (gamepad) gamepad.buttons.forEach((button, index) => button.pressed && held.add(index));
    const isPressed = (button) => held.has(button) && !this.held.has(button);
    if (isPressed(STOP)) this.stop();
    if (isPressed(UP)) this.move(0);
    if (isPressed(LEFT)) this.move(-1);
    if (isPressed(RIGHT)) this.move(1);
    if (held.has(ENABLE)) this.panel.steer([shape(gamepad.axes[1]), shape(gamepad.axes[0])], isPressed(ENABLE));
    else if (this.held.has(ENABLE)) this.panel.endDrive();
    this.held = held;
  }
}
