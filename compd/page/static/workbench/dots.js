// Many small squares at once: written as pixels, ten times faster than one call of the canvas for each.
const SIZE_PX = 2.5;

export class Dots {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.context = this.canvas.getContext("2d", { willReadFrequently: true });
    this.colours = {};
  }

  // Draw squares in the context's fillStyle, which prepared() has scaled; marks: x and y one after the other
  paint(context, marks, shown) {
    const { width, height } = context.canvas;
    if (!width || !height) return;
    const image = this.emptyImage(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    const colour = (this.colours[context.fillStyle] ??= this.pixel(context.fillStyle));
    const ratio = context.getTransform().a;
    const size = Math.max(1, Math.round(SIZE_PX * ratio));
    for (let k = 0; k < marks.length / 2; k++) {
      if (!shown(k)) continue;
      const [left, top] = [Math.round(marks[2 * k] * ratio - size / 2), Math.round(marks[2 * k + 1] * ratio - size / 2)];
      if (!(left >= 0 && top >= 0 && left + size <= width && top + size <= height)) continue;
      for (let y = top; y < top + size; y++) for (let x = left; x < left + size; x++) pixels[y * width + x] = colour;
    }
    this.context.putImageData(image, 0, 0);
    context.save();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(this.canvas, 0, 0);
    context.restore();
  }

  // Reuse the memory for a picture of the same size: a slider requests it at every move.
  emptyImage(width, height) {
    if (this.image?.width === width && this.image.height === height) this.image.data.fill(0);
    else {
      Object.assign(this.canvas, { width, height });
      this.image = this.context.createImageData(width, height);
    }
    return this.image;
  }

  // A colour as one pixel, in the computer's own order of bytes.
  pixel(colour) {
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("2d");
    context.fillStyle = colour;
    context.fillRect(0, 0, 1, 1);
    return new Uint32Array(context.getImageData(0, 0, 1, 1).data.buffer)[0];
  }
}
