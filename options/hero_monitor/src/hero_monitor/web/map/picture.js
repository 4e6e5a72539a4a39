// The camera's picture: each that the monitor announces is fetched while it is shown, one at a time.

import { element, make } from "../dom.js";

export class CameraPicture {
  /** redraw: is called when the map has another picture, or none. */
  constructor(redraw) {
    this.redraw = redraw;
    this.shown = null; // image, and its box on the map, mm
    this.wanted = null; // as the monitor describes it: number, box
    this.number = null; // of the last one that was fetched
    this.fetching = false;
  }

  /** Show the picture that the monitor describes (null: it has none of this map), or no picture. */
  show(isShown, picture) {
    this.wanted = isShown ? picture : null;
    element("no_picture").hidden = !isShown || picture !== null;
    if (this.wanted !== null) this.fetch();
    else {
      this.shown = this.number = null;
      this.redraw();
    }
  }

  async fetch() {
    if (this.fetching) return;
    this.fetching = true;
    while (this.wanted !== null && this.wanted.number !== this.number) {
      const { number, box } = this.wanted;
      const image = make("img", { src: `picture/${number}` });
      const isThere = await image.decode().then(() => true, () => false);
      this.number = number;
      if (!isThere || this.wanted === null) continue;
      this.shown = { image, box };
      this.redraw();
    }
    this.fetching = false;
  }
}
