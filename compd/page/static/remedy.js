// What a person does about a state: a sentence, and the order of this page that does it, where one does.
// Of the faults of a gauge, by their names in the protocol; another one is looked at as it is.
const FAULTS = {
  line_lost: "check plug, cable and power",
  timeout: "check plug, cable and power",
  stale: "check that it sends",
};
const BY_ITSELF = "It goes on by itself when every gauge is good.";
const OF_STATES = {
  starting: "Nothing to do: it begins when every gauge has been read.",
  no_zero: "Drive to the zero position, stand still, then take machine zero.",
  slewing: "Nothing to do: the correction is under way.",
  clamped: "Let the machine cool or warm up, or fit the model again: a correction is at its limit.",
  refused: "Go to another pose or target: it ends by itself with the next that can be used.",
};

// names: of things, at most two of them
function listed(names) {
  return names.length > 2 ? `${names[0]} and ${names.length - 1} more` : names.join(" and ");
}

const gaugesOf = (readings) => [...new Set(readings.map(({ wire }) => wire.channel.split(".")[0]))];

// {text, order, subject}; without an order only a person can do it. summary: of `describe`.
export function remedyOf(page, { tone, name, state }) {
  if (name === "NOT CONNECTED") return { text: "Start compd page again, or check the network." };
  if (name === "LATE") return { text: "Nothing to do if it passes; else close other programs, or check the network." };
  if (tone === "gone") return { text: "Start the daemon: compd run with the machine's configuration." };
  const wired = page.machine?.wiring ?? [];
  const bad = (page.live.gauges ?? []).map((gauge, k) => ({ ...gauge, wire: wired[k] })).filter(({ fault, wire }) => fault && wire);
  const distrusted = gaugesOf(bad.filter(({ fault }) => fault === "distrusted"));
  const waiting = gaugesOf(bad.filter(({ fault, needs_person }) => needs_person || fault === "distrusted"));
  if (state === "no_zero") return { text: OF_STATES.no_zero, order: "zero", subject: "" };
  // another gauge that is lost has to be mended first
  const lost = bad.filter(({ fault }) => fault !== "distrusted");
  if (lost.length) {
    return { text: `Gauge ${listed(gaugesOf(lost))}: ${FAULTS[lost[0].fault] ?? "look at it"}. ${waiting.length ? `Then a person looks at ${listed(waiting)}, references it, and accepts it: the machine does not go on by itself.` : BY_ITSELF}` };
  }
  if (distrusted.length) return { text: `Look at ${listed(distrusted)}, reference it, then accept it.`, order: "accept", subject: distrusted.length === 1 ? distrusted[0] : "all" };
  return { text: OF_STATES[state] ?? (tone === "bad" ? "Read the daemon's log, then start the daemon again." : "") };
}
