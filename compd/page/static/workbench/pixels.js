// Many small marks at once: written as pixels of one buffer, ten times faster than one call of the canvas for each.
const SIZE_PX = 2.5;
// More arrows are drawn without smooth edges, which nobody sees among so many.
const MOST_SMOOTH = 1500;

export class Pixels {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.context = this.canvas.getContext("2d", { willReadFrequently: true });
    this.colours = {};
  }

  // Draw squares in the context's fillStyle, which prepared() has scaled; marks: x and y one after the other
  dots(context, marks, shown) {
    this.written(context, ({ pixels, width, height, ratio, colour }) => {
      const size = Math.max(1, Math.round(SIZE_PX * ratio));
      for (let k = 0; k < marks.length / 2; k++) {
        if (!shown(k)) continue;
        const [left, top] = [Math.round(marks[2 * k] * ratio - size / 2), Math.round(marks[2 * k + 1] * ratio - size / 2)];
        if (!(left >= 0 && top >= 0 && left + size <= width && top + size <= height)) continue;
        for (let y = top; y < top + size; y++) for (let x = left; x < left + size; x++) pixels[y * width + x] = colour;
      }
    });
  }

  // Draw arrows in the context's fillStyle and lineWidth: a dot at the place, and a line to the end. ends: x and y of
  // each end, relative to its mark
  arrows(context, marks, ends, shown) {
    const count = marks.length / 2;
    const draw = count > MOST_SMOOTH ? plainLine : smoothLine;
    this.written(context, ({ pixels, width, height, ratio, colour }) => {
      const thick = Math.max(1, Math.round(context.lineWidth * ratio));
      for (let k = 0; k < count; k++) {
        if (!shown(k)) continue;
        const x = marks[2 * k] * ratio;
        const y = marks[2 * k + 1] * ratio;
        for (let side = 0; side < thick; side++) draw(pixels, width, height, colour, x, y, ends[2 * k] * ratio, ends[2 * k + 1] * ratio, side - (thick - 1) / 2);
        const left = Math.round(x - thick);
        const top = Math.round(y - thick);
        if (!(left >= 0 && top >= 0 && left + 2 * thick <= width && top + 2 * thick <= height)) continue;
        for (let row = top; row < top + 2 * thick; row++) for (let column = left; column < left + 2 * thick; column++) pixels[row * width + column] = colour;
      }
    });
  }

  // An empty buffer as large as the canvas, which is drawn onto it after `write`.
  written(context, write) {
    const { width, height } = context.canvas;
    if (!width || !height) return;
    const image = this.emptyImage(width, height);
    const colour = (this.colours[context.fillStyle] ??= this.pixel(context.fillStyle));
    write({ pixels: new Uint32Array(image.data.buffer), width, height, ratio: context.getTransform().a, colour });
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

// A line of whole pixels from (x, y) by (along, up), moved sideways.
function plainLine(pixels, width, height, colour, x, y, along, up, sideways) {
  const steep = Math.abs(up) > Math.abs(along);
  const begin = steep ? y : x;
  const length = steep ? up : along;
  if (!(Math.abs(length) < Infinity)) return;
  const slope = length ? (steep ? along : up) / length : 0;
  const step = steep ? width : 1;
  const beside = steep ? 1 : width;
  const across = steep ? width : height;
  const from = Math.max(0, Math.round(Math.min(begin, begin + length)));
  const to = Math.min(steep ? height : width, Math.round(Math.max(begin, begin + length)) + 1);
  let at = (steep ? x : y) + sideways + (from - begin) * slope + 0.5;
  for (let place = from * step; place < to * step; place += step, at += slope) if (at >= 0 && at < across) pixels[place + (at | 0) * beside] = colour;
}

// A smooth line from (x, y) by (along, up), moved sideways (Wu 1991): of the two pixels beside it each gets its share of
// the opacity.
function smoothLine(pixels, width, height, colour, x, y, along, up, sideways) {
  const steep = Math.abs(up) > Math.abs(along);
  const [begin, other, length, rise] = steep ? [y, x, up, along] : [x, y, along, up];
  if (!(Math.abs(length) < Infinity)) return;
  const slope = length ? rise / length : 0;
  const [limit, across] = steep ? [height, width] : [width, height];
  const [step, beside] = steep ? [width, 1] : [1, width];
  const from = Math.max(0, Math.round(Math.min(begin, begin + length)));
  const to = Math.min(limit - 1, Math.round(Math.max(begin, begin + length)));
  const plain = colour & 0xffffff;
  const opacity = colour >>> 24;
  let at = other + sideways + (from - begin) * slope;
  for (let k = from; k <= to; k++, at += slope) {
    const near = Math.floor(at);
    if (near < 0 || near + 1 >= across) continue;
    const place = k * step + near * beside;
    const share = ((at - near) * opacity) | 0;
    if (pixels[place] >>> 24 < opacity - share) pixels[place] = plain | ((opacity - share) << 24);
    if (pixels[place + beside] >>> 24 < share) pixels[place + beside] = plain | (share << 24);
  }
}
