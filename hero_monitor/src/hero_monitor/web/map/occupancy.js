// The occupancy grid that robots measure (/map), as an image of one pixel per cell.

const STATES = ["unknown", "free", "occupied"]; // as the monitor numbers them

export class Occupancy {
  constructor() {
    this.grid = null; // as the monitor describes it
    this.image = null;
  }

  /** Paint the grid, if there is one, in colors [red, green, blue, alpha] by STATES. */
  paint(context, grid, colors) {
    if (grid === null) return;
    const key = JSON.stringify(colors);
    if (grid !== this.grid || key !== this.key) this.image = this.draw(grid, colors);
    [this.grid, this.key] = [grid, key];
    const [x, y, yaw] = grid.pose;
    context.save();
    context.translate(x, y);
    context.rotate(yaw / 1000);
    context.imageSmoothingEnabled = false;
    context.drawImage(this.image, 0, 0, grid.columns * grid.cell, grid.rows * grid.cell); // the lowest row first, as y is up
    context.restore();
  }

  draw({ columns, rows, runs }, colors) {
    const canvas = Object.assign(document.createElement("canvas"), { width: columns, height: rows });
    const pixels = new ImageData(columns, rows);
    let at = 0;
    for (let index = 0; index < runs.length; index += 2) {
      const color = colors[STATES[runs[index]]];
      for (const end = at + 4 * runs[index + 1]; at < end; at += 4) pixels.data.set(color, at);
    }
    canvas.getContext("2d").putImageData(pixels, 0, 0);
    return canvas;
  }

  /** The corners on the map, mm. */
  static corners({ pose: [x, y, yaw], cell, columns, rows }) {
    const [cosine, sine] = [Math.cos(yaw / 1000), Math.sin(yaw / 1000)];
    const [length, width] = [columns * cell, rows * cell];
    return [[0, 0], [length, 0], [length, width], [0, width]].map(([right, up]) => [
      x + right * cosine - up * sine,
      y + right * sine + up * cosine,
    ]);
  }
}
