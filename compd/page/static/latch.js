// The worst state of the last seconds, so that a banner can be read while the state changes from one cycle to the next.

// Time (s) for which a state stays.
const LATCHED_S = 3;
// States, the worst last; one that is unknown to this page is worse.
const BY_RANK = ["ok", "slewing", "clamped", "degraded", "hold", "fade", "starting", "no_zero", "refused", "stop", "fault"];
const rank = (state) => (BY_RANK.includes(state) ? BY_RANK.indexOf(state) : BY_RANK.length);

export class Latch {
  constructor(now = () => performance.now() / 1000) {
    Object.assign(this, { now, spells: [] });
  }

  // Take the newest setpoint; null where there is none.
  note(setpoint) {
    const now_s = this.now();
    const last = this.spells.at(-1);
    if (setpoint && last?.state === setpoint.state) Object.assign(last, { until_s: now_s, reason: setpoint.reason });
    else if (setpoint) this.spells.push({ state: setpoint.state, reason: setpoint.reason, until_s: now_s });
    this.spells = this.spells.filter(({ until_s }) => now_s - until_s < LATCHED_S);
  }

  // The worst state, its newest reason, and how often it has come.
  get worst() {
    const worst = this.spells.reduce((one, other) => (rank(other.state) >= rank(one.state) ? other : one));
    return { ...worst, count: this.spells.filter(({ state }) => state === worst.state).length };
  }
}
