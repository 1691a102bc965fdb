// The workbench: a recording against the model, an effect tried by hand, and the steps that keep it.
import { element } from "../format.js";
import { Bench } from "./bench.js";
import { Card } from "./card.js";
import { Diagnosis } from "./diagnosis.js";
import { Effects } from "./effects.js";
import { Exclusions } from "./exclusions.js";
import { Formula } from "./formula.js";
import { bindKeys } from "./keys.js";
import { Ledger } from "./ledger.js";
import { LiveModel } from "./live_model.js";
import { Picture } from "./picture.js";
import { Plan } from "./plan.js";
import { Selection } from "./selection.js";
import { Strip } from "./strip.js";

const at = (id) => document.getElementById(id);
const bench = new Bench(at("problem-line"));
const selection = new Selection();
const strip = new Strip(at("errors"), at("verdict"));
const picture = new Picture({ canvas: at("picture"), tabs: at("tabs"), around: at("around"), against: at("against"), note: at("picture-note") }, selection);
const card = new Card(at("card"), (rivals) => plan.planFor(rivals));
const effects = new Effects(at("effects"), at("filter"), at("effects-note"), { choose: (effect) => card.choose(effect), ranked: (ranking) => strip.measured(ranking) });
const diagnosis = new Diagnosis(at("diagnosis"), {
  named: (result) => {
    effects.name(result);
    if (result) plan.suggestFor(result);
  },
  plan: (rivals) => plan.planFor(rivals),
  formula: ({ declaration }) => formula.edit(declaration),
  choose: (effect) => effects.pick(effect),
  add: async (effect) => {
    await effects.pick(effect);
    card.add();
  },
});
// always in sight, while its findings are below the picture
at("do-diagnose").append(diagnosis.button);
const formula = new Formula(at("formula"), card, effects);
const plan = new Plan(at("plan"));
const ledger = new Ledger(at("ledger"));
const exclusions = new Exclusions(at("exclusions"), selection);
// what to do first, until it is done
const firstSteps = { begin: ({ summary }) => (at("first-steps").hidden = summary.ledger.length > 0) };
bench.panels = [firstSteps, strip, picture, exclusions, card, ledger, diagnosis, effects, formula, plan, new LiveModel(at("live-model"))];
bindKeys({ bench, picture, selection, exclusions, card, effects, ledger, diagnosis });

// what is scrolled to stays below the header, where that is always in sight
const header = at("strip");
new ResizeObserver(() => {
  const above = getComputedStyle(header).position === "sticky" ? `${header.offsetHeight + 8}px` : "";
  document.documentElement.style.scrollPaddingTop = above;
  document.documentElement.style.setProperty("--above", above || "0px");
}).observe(header);

// each recording has a model file of its own, unless the person has named another one
const ownModel = (recording) => `${recording.slice(0, 64)}.model.yaml`;
let suggested = "";
const suggestModel = () => {
  const model = at("model");
  if (model.value.trim() && model.value !== suggested) return;
  model.value = suggested = at("recording").value ? ownModel(at("recording").value) : "";
};
at("recording").addEventListener("change", suggestModel);

const open = () => bench.attempt(() => bench.open(at("recording").value, at("model").value.trim(), [...document.querySelectorAll("#libraries input:checked")].map(({ value }) => value)));
at("open").addEventListener("click", open);
bench.attempt(async () => {
  const [{ parts }, { models }, { libraries }] = await Promise.all(["recordings", "models", "workbench/libraries"].map(async (path) => (await fetch(path)).json()));
  at("recording").replaceChildren(...parts.map(({ name }) => element("option", { value: name }, name)));
  at("models").replaceChildren(...models.map(({ name }) => element("option", { value: name })));
  at("libraries").append(...libraries.map((name) => element("label", {}, element("input", { type: "checkbox", value: name, onchange: () => bench.summary && open() }), name)));
  if (!parts.length) bench.say("There are no recordings in the page's directory of recordings.");
  // the recording requested by another page
  const asked = new URLSearchParams(location.search);
  if (asked.has("model")) at("model").value = asked.get("model");
  if (asked.has("recording")) at("recording").value = asked.get("recording");
  suggestModel();
  if (asked.has("recording")) await open();
});
// pictures have the colours of the theme in which they are drawn
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => [picture, ledger].forEach((shown) => shown.redraw()));
window.bench = Object.assign(bench, { selection, picture }); // for tests and inspection
