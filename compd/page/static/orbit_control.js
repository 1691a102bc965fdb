// View of a picture in three dimensions: drag to turn, zoom by the wheel.
export class Turn {
  // hover: called with the position of the pointer
  constructor(canvas, draw, hover = () => {}) {
    Object.assign(this, { draw, turn: 0.5, tilt: 0.25, zoom: 1 });
    let held = null;
    canvas.addEventListener("pointerdown", (event) => {
      held = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return hover(event.offsetX, event.offsetY);
      this.turn -= (event.clientX - held[0]) * 0.01;
      this.tilt = Math.max(-1.5, Math.min(1.57, this.tilt + (event.clientY - held[1]) * 0.01));
      held = [event.clientX, event.clientY];
      draw();
    });
    canvas.addEventListener("pointerup", () => (held = null));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom = Math.max(0.3, Math.min(8, this.zoom * Math.exp(-event.deltaY * 0.001)));
      draw();
    }, { passive: false });
    new ResizeObserver(draw).observe(canvas);
  }

  look(turn, tilt) {
    Object.assign(this, { turn, tilt });
    this.draw();
  }

  // From places (x, y, z one after the other) to the canvas: turned about z, tilted, and as large as fits.
  projector(places, width, height) {
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let k = 0; k < places.length; k++) {
      if (!Number.isFinite(places[k])) continue;
      low[k % 3] = Math.min(low[k % 3], places[k]);
      high[k % 3] = Math.max(high[k % 3], places[k]);
    }
    const centre = low.map((value, k) => (value + high[k]) / 2);
    const radius = Math.hypot(...low.map((value, k) => high[k] - value)) / 2 || 1;
    const scale = (0.5 * Math.min(width, height) * this.zoom) / radius;
    const [ct, st, ci, si] = [Math.cos(this.turn), Math.sin(this.turn), Math.cos(this.tilt), Math.sin(this.tilt)];
    const project = (point) => {
      const [x, y, z] = [point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]];
      const [right, away] = [ct * x + st * y, -st * x + ct * y];
      return [width / 2 + scale * right, height / 2 - scale * (ci * z + si * away)];
    };
    project.radius = radius;
    project.px_per_mm = scale;
    return project;
  }
}
