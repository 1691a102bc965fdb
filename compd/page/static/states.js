// What each state looks like: its tone, and a sign, so that nothing depends on colour alone.
export const STATES = {
  starting: ["care", "…"], no_zero: ["bad", "∅"], ok: ["good", "✓"], slewing: ["care", "↗"], clamped: ["care", "⊣"],
  hold: ["care", "‖"], fade: ["care", "◐"], degraded: ["care", "◑"], stop: ["bad", "■"], refused: ["bad", "✕"], fault: ["bad", "!"],
};
// By the number of the state in the history.
export const NAMES = ["starting", "no_zero", "ok", "slewing", "clamped", "hold", "fade", "stop", "refused", "degraded", "fault"];
export const COLOURS = { good: "#009e73", care: "#e69f00", bad: "#d55e00", gone: "#8c959f" };

// A state that this page does not know is not valid, whatever it says.
export function appearance(state) {
  return STATES[state] || ["bad", "?"];
}

export function stateName(state) {
  return state.replaceAll("_", " ").toUpperCase();
}
