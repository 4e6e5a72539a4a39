// The camera's picture: each that the monitor announces is fetched while it is shown, one at a time.

import { element, make } from "../dom.js";

const HINT = "no picture: roslaunch hero_localization camera.launch";

export class CameraPicture {
  /** redraw: is called when the map has another picture, or none. */
  constructor(redraw) {
    this.redraw = redraw;
    this.box = null; // of the picture on the map, mm; null: it is shown in a panel, or not at all
    this.image = null;
    this.wanted = null; // as the monitor describes it: number, box on the map
    this.number = null;
    this.fetching = false;
  }

  /** Show the picture that the monitor describes (null: it has none), or no picture. */
  show(isShown, picture) {
    this.isShown = isShown;
    this.wanted = isShown ? picture : null;
    if (this.wanted === null) {
      this.image = this.box = this.number = null;
      this.place();
    } else this.fetch();
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
      [this.image, this.box] = [image, box];
      this.place();
    }
    this.fetching = false;
  }

  /** Put a picture without a place on the map into the panel. */
  place() {
    const beside = this.isShown && this.box === null ? [this.image || HINT] : [];
    element("panel").hidden = beside.length === 0;
    element("panel").replaceChildren(...beside);
    this.redraw();
  }
}
