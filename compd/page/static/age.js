// How late an event is. Both clocks are monotonic and begin anywhere: the quickest event so far is the measure, and an
// event that took longer than that one is late by the difference. A page that was stalled gets the events that the
// system kept for it, each later than the next: none of them may pass for the present.

// Largest difference in rate of the two clocks (relative).
const DRIFT = 2e-4;
// Delay (s) from which an event is no longer shown as the present; after as long a silence the page is disconnected.
export const LATE_S = 0.5;
export const SILENT_S = 1.5;

export class Age {
  constructor(now = () => performance.now() / 1000) {
    this.now = now;
    this.begin();
  }

  // Of a new connection.
  begin() {
    this.quickest_s = Infinity;
    this.last_s = this.now();
    this.arrived_s = this.now();
    this.late_s = 0;
  }

  arrived(made_s) {
    const now_s = this.now();
    const took_s = now_s - made_s;
    this.quickest_s = Math.min(took_s, this.quickest_s + DRIFT * (now_s - this.last_s));
    this.last_s = this.arrived_s = now_s;
    this.late_s = took_s - this.quickest_s;
    return this.late_s;
  }

  // Seconds since the last event if too long; else the delay of the last event if too late.
  get behind_s() {
    const silent_s = this.now() - this.arrived_s;
    if (silent_s > SILENT_S) return silent_s + this.late_s;
    return this.late_s > LATE_S ? this.late_s : 0;
  }
}
