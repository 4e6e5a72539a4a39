// The occupancy grid that robots measure (/map), as an image of one pixel per cell.

import { make } from "../dom.js";

const STATES = ["unknown", "free", "occupied"]; // as the monitor numbers them

export class Occupancy {
  key;

  constructor() {
    this.grid = null; // as the monitor describes it
    this.image = null;
  }

  /** Return the grid's image, its lowest row first, in colors [red, green, blue, alpha] by STATES. */
  find(grid, colors) {
    const key = JSON.stringify(colors);
    if (grid !== this.grid || key !== this.key) this.image = this.draw(grid, colors);
    [this.grid, this.key] = [grid, key];
    return this.image;
  }

  draw({ columns, rows, runs }, colors) {
    const canvas = make("canvas", { width: columns, height: rows });
    const pixels = new ImageData(columns, rows);
    let at = 0;
    for (let index = 0; index < runs.length; index += 2) {
      const color = colors[STATES[runs[index]]];
      for (const end = at + 4 * runs[index + 1]; at < end; at += 4) pixels.data.set(color, at);
    }
    canvas.getContext("2d").putImageData(pixels, 0, 0);
    return canvas;
  }
}
