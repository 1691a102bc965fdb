// Appearance of each state: tone and sign, so that colour is not the only mark.
export const STATES = {
  starting: ["care", "…"], no_zero: ["bad", "∅"], ok: ["good", "✓"], slewing: ["care", "↗"], clamped: ["care", "⊣"],
  hold: ["care", "‖"], fade: ["care", "◐"], degraded: ["care", "◑"], stop: ["bad", "■"], refused: ["bad", "✕"], fault: ["bad", "!"],
};
// States by their number in the history.
export const NAMES = ["starting", "no_zero", "ok", "slewing", "clamped", "hold", "fade", "stop", "refused", "degraded", "fault"];
export const COLOURS = { good: "#009e73", care: "#e69f00", bad: "#d55e00", gone: "#8c959f" };

// A state unknown to this page counts as invalid.
export function appearance(state) {
  return STATES[state] || ["bad", "?"];
}

export function stateName(state) {
  return state.replaceAll("_", " ").toUpperCase();
}
