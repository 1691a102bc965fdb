// What is chosen in the join wizard, what the server reads of it, and what was tried.
import { element } from "../format.js";
import { post } from "../post.js";
import { Session } from "../session.js";

// Why a question is given up: what is chosen now is another.
const REPLACED = new Error("replaced");

export class Wizard extends Session {
  constructor(status) {
    super(status);
    Object.assign(this, { panels: [], choices: {}, sources: null, table: null, command: "", trial: null, asked: 0, running: new Set() });
    this.cancelButton = element("button", { type: "button", id: "cancel", hidden: true, onclick: () => this.giveUp(new Error("It was cancelled.")) }, "Cancel");
    status.after(this.cancelButton);
  }

  // The server ends what nobody waits for.
  giveUp(reason) {
    for (const asking of this.running) asking.abort(reason);
  }

  // An order to the server with all that is chosen. Throws its reason.
  async ask(path, signal) {
    const answer = await post(`join/${path}`, this.choices, signal);
    if (!answer.ok) throw new Error(answer.reason ?? "the page's server does not answer");
    return answer;
  }

  // As `ask`, with a button that cancels it; nothing is answered where other choices have taken its place.
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

  // Other choices: the export is read anew, and what was tried with the old ones is gone.
  async change(choices) {
    Object.assign(this.choices, choices);
    if (Object.keys(choices).some((key) => key !== "name")) this.trial = null;
    const asked = ++this.asked;
    this.giveUp(REPLACED);
    this.show();
    if (!this.choices.export) return;
    const answer = await this.attempt(() => this.askPatiently("table"));
    if (asked !== this.asked) return; // somebody has gone on choosing
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
    if (file.size > this.sources.most_bytes) throw new Error(`${file.name} is too large: ${(file.size / 2 ** 20).toFixed(0)} MB; ${this.sources.most_bytes / 2 ** 20} MB may be brought.`);
    const response = await fetch(`join/exports?${new URLSearchParams({ name: file.name })}`, { method: "POST", headers: { "Content-Type": "application/octet-stream" }, body: file });
    const answer = await response.json().catch(() => ({}));
    if (!response.ok) throw new Error(answer.reason ?? `${file.name} could not be brought`);
    await this.list();
    await this.choose(answer.name);
  }

  // What is kept of exports, beside what is allowed.
  async usage() {
    const response = await fetch("join/exports");
    if (!response.ok) throw new Error("what is kept of exports cannot be told");
    return response.json();
  }

  // An export that is not needed any more; there is no way back.
  async remove(name) {
    const response = await fetch(`join/exports/${encodeURIComponent(name)}`, { method: "DELETE" });
    const answer = await response.json().catch(() => ({}));
    if (!response.ok) throw new Error(answer.reason ?? `${name} could not be deleted`);
    Object.assign(this, { table: null, trial: null, command: "" });
    Object.assign(this.choices, { export: null, columns: null, group: null, sheet: null });
    await this.list();
  }

  // Another export begins with nothing said about its columns.
  choose(name) {
    this.table = null;
    return this.change({ export: name, columns: null, group: null, sheet: null });
  }

  show() {
    for (const panel of this.panels) panel.show(this);
  }
}
