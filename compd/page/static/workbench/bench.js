// The open recording of the workbench: numbers, rows, the trial, and requests to the server.
import { post } from "../post.js";
import { Session } from "../session.js";
import { fetchArrays } from "./arrays.js";

export class Bench extends Session {
  constructor(status) {
    super(status);
    Object.assign(this, { panels: [], key: "", summary: null, rows: null, trial: null, tried_rms: null, doubts: new Map(), warnings: new Map(), doubted: new Set() });
  }

  // JSON of the open recording. Throws the server's reason.
  async get(path) {
    const response = await fetch(`workbench/${this.key}/${path}`);
    const answer = await response.json();
    if (!response.ok) throw new Error(answer.reason);
    return answer;
  }

  arrays(path) {
    return fetchArrays(`workbench/${this.key}/${path}`);
  }

  // An order for the open recording. Throws the server's reason.
  async post(path, keys, signal) {
    const answer = await post(`workbench/${this.key}/${path}`, keys, signal);
    if (!answer.ok) throw new Error(answer.reason);
    return answer;
  }

  // Why the rows do not support an effect, "" where they do. It may take a diagnosis; each effect is asked once.
  doubtOf(effect) {
    const { doubts } = this;
    if (!doubts.has(effect)) {
      const { summary, key } = this;
      const asked = this.get(`effects/${effect}/doubt`).then(({ warning }) => {
        if (this.summary === summary && this.key === key) this.warned(effect, warning);
        return warning;
      });
      asked.catch(() => doubts.delete(effect));
      doubts.set(effect, asked);
    }
    return doubts.get(effect);
  }

  // An effect has a warning, "" for none; until then it is unknown whether the rows support it.
  warned(effect, warning) {
    this.warnings.set(effect, warning);
    for (const panel of this.panels) panel.warned?.(effect, warning);
  }

  // Why the fall of the error is no success: of the effect being tried, or of one in the model; "" where it is one.
  get doubt() {
    const { summary, tried_rms, trying, warnings, doubted } = this;
    if (summary.numbers.some(({ plausible }) => !plausible)) return "a number of the model is outside its plausible range";
    const kept = summary.numbers.some(({ effect }) => doubted.has(`${this.key} ${effect}`));
    return kept || (tried_rms !== null && warnings.get(trying) !== "") ? "not shown to be supported by these rows" : "";
  }

  // A change of the model or of the rows; the server refuses it after another browser's change.
  async change(path, keys) {
    await this.show(await this.post(path, { ...keys, revision: this.summary.revision }));
  }

  // libraries: names of files of effects that are tried, too
  async open(recording, model, libraries) {
    this.say("opening …");
    const answer = await post("workbench/open", { recording, model, libraries });
    if (!answer.ok) throw new Error(answer.reason);
    this.key = answer.key;
    await this.show(answer);
  }

  // Another state of the open recording: every panel starts again.
  async show(summary) {
    Object.assign(this, { summary: null, trial: null, tried_rms: null, doubts: new Map(), warnings: new Map() });
    this.rows = await this.arrays("rows");
    this.summary = summary;
    document.getElementById("opened").hidden = false;
    this.say("");
    await Promise.all(this.panels.map((panel) => panel.begin(this)));
  }

  // Try the effect with these numbers; null for none.
  tried(theta) {
    const left = theta && this.trial ? this.trial.residual(theta) : null;
    this.tried_rms = left && this.trial.rms(theta);
    for (const panel of this.panels) panel.try?.(left);
  }
}
