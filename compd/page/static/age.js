// How late an event is. Both clocks are monotonic and begin anywhere: the quickest event so far is the measure, and an
// event that took longer than that one is late by the difference. A page that was stalled gets the events that the
// system kept for it, each later than the next: none of them may pass for the present.

// The two clocks may differ in pace by so much.
const DRIFT = 2e-4;
// An event that is later than this, s, is not shown as the present; without any for as long as this the page is alone.
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

  // Seconds since the last event, where that is too long; else how late the last event was, where that is too late.
  get behind_s() {
    const silent_s = this.now() - this.arrived_s;
    if (silent_s > SILENT_S) return silent_s + this.late_s;
    return this.late_s > LATE_S ? this.late_s : 0;
  }
}
