// State of the join wizard: choices, the server's reading, and the trial.
import { element } from "../format.js";
import { post } from "../post.js";
import { Session } from "../session.js";

// Reason of an abandoned request: the choices have changed.
const REPLACED = new Error("replaced");

const NO_LOG_CHOICES = { log_columns: null, log_shape: null, log_decimal: null, log_dates: null, log_angles: null, log_clock_set_back: null, log_sheet: null };

export class Wizard extends Session {
  constructor(status) {
    super(status);
    Object.assign(this, { panels: [], choices: {}, sources: null, log: null, table: null, command: "", trial: null, asked: 0, running: new Set() });
    this.cancelButton = element("button", { type: "button", id: "cancel", hidden: true, onclick: () => this.giveUp(new Error("It was cancelled.")) }, "Cancel");
    status.after(this.cancelButton);
  }

  // Abort the request; the server ends its computation.
  giveUp(reason) {
    for (const asking of this.running) asking.abort(reason);
  }

  // An order to the server with all choices. Throws its reason.
  async ask(path, signal) {
    const answer = await post(`join/${path}`, this.choices, signal);
    if (!answer.ok) throw new Error(answer.reason ?? "the page's server does not answer");
    return answer;
  }

  // As `ask`, with a button that cancels it; no answer if the choices have changed meanwhile.
  async askPatiently(path) {
    const asking = new AbortController();
    this.running.add(asking);
    this.cancelButton.hidden = false;
    try {
      return await this.ask(path, asking.signal);
    } catch (error) {
      if (error !== REPLACED) throw error;
    } finally {
      this.running.delete(asking);
      this.cancelButton.hidden = !this.running.size;
    }
  }

  async list() {
    const response = await fetch("join/sources");
    if (!response.ok) throw new Error("the recordings cannot be listed");
    this.sources = await response.json();
    this.show();
  }

  // Other choices: read the export again, and discard the old trial.
  async change(choices) {
    Object.assign(this.choices, choices);
    if (Object.keys(choices).some((key) => key !== "name")) this.trial = null;
    const asked = ++this.asked;
    this.giveUp(REPLACED);
    this.show();
    if (!this.choices.log) this.log = null;
    else if (!this.log || Object.keys(choices).some((key) => key.startsWith("log"))) {
      const log = await this.attempt(() => this.askPatiently("log"));
      if (asked !== this.asked) return;
      this.log = log ?? null;
      this.show();
      if (!log) return;
    }
    if (!this.choices.export) return;
    const answer = await this.attempt(() => this.askPatiently("table"));
    if (asked !== this.asked) return; // the choices have changed meanwhile
    Object.assign(this, answer ? { table: answer, command: answer.command } : { command: "" });
    this.show();
  }

  async try() {
    const asked = this.asked;
    this.say("trying …");
    const trial = await this.attempt(() => this.askPatiently("trial"));
    if (asked !== this.asked) return;
    this.trial = trial ?? null;
    this.show();
  }

  // An export from this computer, kept beside the recordings.
  async bring(file) {
    if (file.size > this.sources.most_bytes) throw new Error(`${file.name} is too large: ${(file.size / 2 ** 20).toFixed(0)} MB; ${this.sources.most_bytes / 2 ** 20} MB are allowed.`);
    const response = await fetch(`join/exports?${new URLSearchParams({ name: file.name })}`, { method: "POST", headers: { "Content-Type": "application/octet-stream" }, body: file });
    const answer = await response.json().catch(() => ({}));
    if (!response.ok) throw new Error(answer.reason ?? `${file.name} could not be uploaded`);
    await this.list();
    return answer.name;
  }

  // Stored exports against their limits.
  async usage() {
    const response = await fetch("join/exports");
    if (!response.ok) throw new Error("what is kept of exports cannot be told");
    return response.json();
  }

  // Delete an export for good.
  async remove(name) {
    const response = await fetch(`join/exports/${encodeURIComponent(name)}`, { method: "DELETE" });
    const answer = await response.json().catch(() => ({}));
    if (!response.ok) throw new Error(answer.reason ?? `${name} could not be deleted`);
    Object.assign(this, { table: null, trial: null, command: "" });
    Object.assign(this.choices, { export: null, columns: null, group: null, sheet: null });
    if (this.choices.log === name) Object.assign(this.choices, { log: null, ...NO_LOG_CHOICES });
    await this.list();
  }

  // Another export starts without roles of its columns.
  choose(name) {
    this.table = null;
    return this.change({ export: name, columns: null, group: null, sheet: null });
  }

  // Another log, in place of a recording of the gauges.
  chooseLog(name) {
    this.log = null;
    return this.change({ log: name || null, ...(name && { recording: null }), ...NO_LOG_CHOICES });
  }

  show() {
    for (const panel of this.panels) panel.show(this);
  }
}
