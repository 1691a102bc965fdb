// The part of the last hour that tape and chart show, and the gestures that change it.
const HOUR_S = 3600;
const LEAST_S = 20;
// Pixels that a pointer moves before it drags.
const CLICK_PX = 4;

export class TimeWindow {
  constructor() {
    Object.assign(this, { end_s: 0, span_s: HOUR_S, right_s: null });
  }

  get right() {
    return this.right_s ?? this.end_s;
  }

  get left() {
    return this.right - this.span_s;
  }

  // share: of the width, from the left
  timeAt(share) {
    return this.left + this.span_s * share;
  }

  shareOf(time_s) {
    return (time_s - this.left) / this.span_s;
  }

  // The newest moment stays at the right while the window ends there.
  place(right_s) {
    const first = this.end_s - HOUR_S + this.span_s;
    this.right_s = right_s >= this.end_s ? null : Math.max(right_s, first);
  }

  zoom(factor, about_s = this.right) {
    const share = this.shareOf(about_s);
    this.span_s = Math.min(HOUR_S, Math.max(LEAST_S, this.span_s * factor));
    this.place(about_s + (1 - share) * this.span_s);
  }

  pan(seconds) {
    this.place(this.right + seconds);
  }

  // Keep `time_s` in sight.
  reveal(time_s) {
    if (time_s < this.left || time_s > this.right) this.place(time_s + this.span_s / 2);
  }

  whole() {
    Object.assign(this, { span_s: HOUR_S, right_s: null });
  }
}

// Wheel and two fingers zoom, one pointer clicks or drags. act: {click(share), drag(share, by), zoom(factor, share)}
export function gestures(place, act) {
  const held = new Map();
  let [moved, apart] = [false, 0];
  const share = (event) => {
    const box = place.getBoundingClientRect();
    return Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
  };
  const spread = () => {
    const [a, b] = [...held.values()];
    return { apart: Math.max(0.01, Math.abs(a.share - b.share)), middle: (a.share + b.share) / 2 };
  };
  const free = (event) => held.delete(event.pointerId);
  place.addEventListener("pointerdown", (event) => {
    held.set(event.pointerId, { share: share(event), x: event.clientX });
    moved = held.size > 1;
    if (held.size === 2) apart = spread().apart;
    place.setPointerCapture(event.pointerId);
  });
  place.addEventListener("pointermove", (event) => {
    const from = held.get(event.pointerId);
    if (!from) return;
    const now = share(event);
    if (held.size === 2) {
      from.share = now;
      const { apart: wide, middle } = spread();
      act.zoom(apart / wide, middle);
      apart = wide;
      return;
    }
    if (!moved && Math.abs(event.clientX - from.x) < CLICK_PX) return;
    moved = true;
    act.drag(now, now - from.share);
    from.share = now;
  });
  place.addEventListener("pointerup", (event) => {
    if (held.has(event.pointerId) && !moved) act.click(share(event));
    free(event);
  });
  place.addEventListener("pointercancel", free);
  place.addEventListener("wheel", (event) => {
    event.preventDefault();
    act.zoom(Math.exp(event.deltaY * 0.002), share(event));
  }, { passive: false });
}
