// A view for an audience: the map alone, over the whole screen, with big robots and numbers. STOP ALL keeps its place.

import { element, setPressed } from "./dom.js";

export class Projector {
  constructor(redraw) {
    this.redraw = redraw;
    element("projector").addEventListener("click", () => this.show(!document.body.classList.contains("projector")));
    // Escape, or the browser's own way back.
    document.addEventListener("fullscreenchange", () => document.fullscreenElement || this.show(false));
    addEventListener("keydown", (event) => event.key === "Escape" && this.show(false));
  }

  async show(isShown) {
    document.body.classList.toggle("projector", isShown);
    setPressed(element("projector"), isShown);
    this.redraw();
    try {
      if (isShown) await document.documentElement.requestFullscreen();
      else if (document.fullscreenElement) await document.exitFullscreen();
    } catch {
      // Without the browser's leave the view fills the window.
    }
  }
}
