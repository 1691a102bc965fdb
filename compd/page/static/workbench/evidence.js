// The findings of a diagnosis below its verdict: each effect with its numbers, other findings, what to measure.
import { CommandLine } from "../command_line.js";
import { copyButton } from "../copy.js";
import { element } from "../format.js";

const plain = (name) => name.replaceAll("_", " ");

// Advice names the buttons of this page for the commands of the terminal; the commands may be wrapped.
const BUTTONS = [
  [/compd\s+effect\s+add\s+(\S+)\s+--recording\s+\S+\s+--model\s+FILE/g, "press “Add …” at $1 below"],
  [/\(compd\s+effect\s+add\)/g, "(“Add …” below)"],
  [/compd\s+compare\s+OTHER\.csv\s+--model\s+FILE/g, "choose it above, with this model file, and press “Open”"],
  [/compd\s+plan\s+\S+\s+--rivals\s+\S+\s+says\s+what\s+tells\s+them\s+apart/g, "press “Plan the measurement that tells them apart” below"],
];
const advice = (text) => BUTTONS.reduce((told, [command, press]) => told.replace(command, press), text);

// act: actions of the buttons, {choose(effect), add(effect), plan(effects), formula(formula)}; none, no button.
export function evidence(diagnosis, act) {
  const { effects, follows, formulas, constant, gross, tried, without_gain, untested, next } = diagnosis;
  const all = [
    ...effects.map((effect, k) => folded(`${k + 1}. ${plain(effect.effect)}`, effectParts(effect, act), true)),
    follows && folded("What the rest follows: descriptions, no causes; on rows left out", [table(follows), ...formulas.map((formula) => formulaPart(formula, act))], !effects.length),
    constant && folded("A constant in every row, which no effect is judged by", [table(constant)]),
    gross && folded("What is wrong with the data", [element("p", {}, gross)]),
    next && folded("What to measure next", [table(next)], true),
    tried && folded("Effects that were tried, each alone, on rows left out", [table(tried)]),
    without_gain.length && folded(`Without gain (${without_gain.length})`, [element("p", {}, without_gain.map(plain).join(", "))]),
    untested && folded(`Not testable on these rows (${untested.rows.length})`, [table(untested)]),
  ];
  return all.filter(Boolean);
}

function effectParts(effect, act) {
  const { numbers, facts, rivals, separated_by, plan_command } = effect;
  const rows = numbers.map(({ name, text, range, plausible }) => element("tr", { class: plausible ? "" : "bad" }, element("td", {}, name), element("td", {}, text), element("td", {}, `${plausible ? "plausible" : "IMPLAUSIBLE: usual is"} ${range}`)));
  const together = [effect.effect, ...rivals.map((rival) => rival.effect)];
  return [
    element("p", {}, effect.physics),
    element("p", { class: "equation" }, effect.equation),
    element("table", { "aria-label": `Numbers of ${plain(effect.effect)}` }, element("tbody", {}, ...rows)),
    element("dl", { class: "facts" }, ...facts.flatMap(pair)),
    rivals.length
      ? element("p", { class: "rivals" }, element("b", {}, "It could as well be "), rivals.map((rival) => `${plain(rival.effect)} (${rival.alike} alike on these rows)`).join(", "), "; these rows cannot tell.")
      : element("p", { class: "note" }, "No other effect that was tried does as well."),
    element("p", {}, element("b", {}, "Told apart by: "), separated_by),
    element("div", { class: "row" },
      ...button("Try it", act.choose, effect.effect, { "data-try": effect.effect }),
      ...button("Add …", act.add, effect.effect, { "data-add": effect.effect }),
      ...(rivals.length ? button("Plan the measurement that tells them apart", act.plan, together, { "data-plan": effect.effect }) : [])),
    new CommandLine(plan_command).row,
  ];
}

function formulaPart(formula, act) {
  const text = element("pre", { class: "formula-text", tabindex: 0 }, formula.text);
  return element("div", {}, text, element("div", { class: "row" }, ...button("Try this formula", act.formula, formula, { "data-formula": formula.id }), copyButton(text, "Copy this formula")));
}

function button(text, act, subject, attributes) {
  return act ? [element("button", { type: "button", ...attributes, onclick: () => act(subject) }, text)] : [];
}

function pair([name, text]) {
  return [element("dt", {}, name), element("dd", {}, text)];
}

function table({ head, rows, caption }) {
  const named = head.some(Boolean) ? [element("thead", {}, element("tr", {}, ...head.map((cell) => element("th", {}, cell))))] : [];
  return element("div", { class: "wide", tabindex: 0, role: "region", "aria-label": head.filter(Boolean).join(", ") || "table" }, element("table", {}, ...named, element("tbody", {}, ...rows.map((row) => element("tr", {}, ...row.map((cell) => element("td", {}, cell)))))), ...(caption ? [element("p", { class: "note" }, caption)] : []));
}

function folded(title, parts, open = false) {
  return element("details", { open }, element("summary", {}, title), ...parts);
}

// The verdict's word, then a few lines with labels.
export function summaryLines(verdict, lines) {
  const [heading, ...others] = lines;
  const entries = [];
  for (const line of others) {
    const labelled = /^(\w[\w ]*):\s+(.*)$/.exec(line);
    if (labelled) entries.push([labelled[1], labelled[2]]);
    else if (entries.length) entries.at(-1)[1] += `\n${line.trim()}`;
  }
  const word = element("b", { class: "word", "data-verdict": verdict }, plain(verdict));
  return element("div", { class: "summary-lines" }, element("p", { class: "heading" }, word, " ", heading.slice(heading.indexOf(":") + 2)), element("dl", { class: "facts" }, ...entries.flatMap(([name, text]) => pair([name, advice(text)]))));
}
