// A map, or what it costs to drive over it: cells from 0 to 100, or below 0 for none, drawn into an image.

export async function inflate(base64) {
  const packed = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Int8Array(await new Response(stream).arrayBuffer());
}

export class Grid {
  // ``name`` of a stored map; null of the one that is being made.
  constructor({ columns, rows, resolution_m, x_m, y_m, heading_rad }, name = null) {
    Object.assign(this, { columns, rows, resolution_m, x_m, y_m, heading_rad, name, revision: 0 });
    this.cells = new Int8Array(columns * rows).fill(-1);
    this.image = document.createElement("canvas");
    this.image.width = columns;
    this.image.height = rows;
  }

  // Whether a part belongs into this grid: it is of the map that is being made, with the same cells at the same place.
  isOf(part) {
    return this.name === null && ["columns", "rows", "resolution_m", "x_m", "y_m", "heading_rad"].every((key) => part[key] === this[key]);
  }

  put(cells, row, column, rows, columns, colours) {
    for (let r = 0; r < rows; r += 1) {
      this.cells.set(cells.subarray(r * columns, (r + 1) * columns), (row + r) * this.columns + column);
    }
    this.#paint(row, column, rows, columns, colours);
  }

  repaint(colours) {
    this.#paint(0, 0, this.rows, this.columns, colours);
  }

  // In metres of the map, wherever the grid lies on it.
  draw(c) {
    c.save();
    c.translate(this.x_m, this.y_m);
    c.rotate(this.heading_rad);
    c.imageSmoothingEnabled = false;
    c.drawImage(this.image, 0, 0, this.columns * this.resolution_m, this.rows * this.resolution_m);
    c.restore();
  }

  corners() {
    const [length, width] = [this.columns * this.resolution_m, this.rows * this.resolution_m];
    const [cos, sin] = [Math.cos(this.heading_rad), Math.sin(this.heading_rad)];
    return [[0, 0], [length, 0], [0, width], [length, width]].map(([x, y]) => [this.x_m + x * cos - y * sin, this.y_m + x * sin + y * cos]);
  }

  // Row 0 of the image is the lowest y: the view turns it.
  #paint(row, column, rows, columns, { wall, free, opacity = () => 255 }) {
    const context = this.image.getContext("2d");
    const pixels = context.createImageData(columns, rows);
    for (let r = 0; r < rows; r += 1) {
      for (let c = 0; c < columns; c += 1) {
        const percent = this.cells[(row + r) * this.columns + column + c];
        if (percent < 0) continue;
        const at = 4 * (r * columns + c);
        for (let i = 0; i < 3; i += 1) pixels.data[at + i] = free[i] + ((wall[i] - free[i]) * percent) / 100;
        pixels.data[at + 3] = opacity(percent);
      }
    }
    context.putImageData(pixels, column, row);
  }
}
