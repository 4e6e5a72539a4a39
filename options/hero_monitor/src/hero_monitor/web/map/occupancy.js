// The occupancy grid that robots measure (/map), as an image of one pixel per cell.

import { make } from "../dom.js";

const WALL = [0x7b, 0x86, 0x96]; // as style.css has it, for both themes
const ALPHAS = [70, 0, 255]; // of unknown, free, occupied, as the monitor numbers them

/** Return the image of a grid, its lowest row first. */
export function drawGrid({ columns, rows, runs }) {
  const canvas = make("canvas", { width: columns, height: rows });
  const pixels = new ImageData(columns, rows);
  let at = 0;
  for (let index = 0; index < runs.length; index += 2) {
    const color = [...WALL, ALPHAS[runs[index]]];
    for (const end = at + 4 * runs[index + 1]; at < end; at += 4) pixels.data.set(color, at);
  }
  canvas.getContext("2d").putImageData(pixels, 0, 0);
  return canvas;
}
