// A diagnosis: its stages while it runs, then the verdict and the evidence. Every browser shows the newest of them.
import { CommandLine } from "../command_line.js";
import { copyButton } from "../copy.js";
import { element } from "../format.js";
import { evidence, summaryLines } from "./evidence.js";

// Interval of requests while none runs, since another browser may begin one. A running one is followed without a pause,
// which a browser would make long for a tab that is hidden; a diagnosis that nobody follows ends.
const LOOK_AT_REST_MS = 3000;

export class Diagnosis {
  // act: named(result) marks the findings, null for none; the others are those of `evidence`.
  constructor(place, act) {
    Object.assign(this, { act, bench: null, key: "", shown: "", turn: 0, running: false, follows: false });
    this.button = element("button", { type: "button", id: "diagnose", onclick: () => this.startOrCancel() }, "Diagnose (d)");
    this.command = new CommandLine();
    this.stages = element("ol", { class: "stages", "aria-label": "Stages of the diagnosis" });
    this.state = element("p", { class: "note", role: "status", id: "diagnosis-state" });
    this.behind = element("p", { class: "behind", id: "diagnosis-behind" });
    this.outcome = element("div", { id: "diagnosis-outcome" });
    this.page = element("p", { class: "note", id: "diagnosis-page" });
    this.text = element("pre", { class: "verdict", tabindex: 0 });
    this.whole = element("details", {}, element("summary", {}, "As the terminal prints it"), copyButton(this.text, "Copy this text"), this.text);
    place.replaceChildren(this.command.row, this.stages, this.state, this.behind, this.outcome, this.page, this.whole);
    this.clear();
  }

  clear() {
    this.shown = "";
    for (const part of [this.stages, this.state, this.behind, this.outcome, this.page]) part.replaceChildren();
    this.whole.hidden = true;
    this.act.named?.(null);
  }

  begin(bench) {
    this.bench = bench;
    this.command.write(bench.summary.commands.diagnose);
    if (bench.key !== this.key) this.clear();
    this.key = bench.key;
    return this.look();
  }

  startOrCancel() {
    if (!this.bench) return;
    this.bench.attempt(async () => {
      await this.bench.post("diagnosis", this.running ? { cancel: true } : {});
      await this.look();
      this.stages.scrollIntoView({ block: "nearest" });
    });
  }

  // Poll for the newest; a later call takes over from an earlier one.
  async look() {
    const turn = ++this.turn;
    clearTimeout(this.looking);
    let failed = false;
    try {
      const job = await this.bench.get(`diagnosis?shown=${this.shown}${this.follows ? "&follow" : ""}`);
      if (turn !== this.turn) return;
      this.show(job);
    } catch {
      // the page's server is away, or has restarted: other parts report it
      if (turn !== this.turn) return;
      failed = true;
    }
    if (this.follows && !failed) this.look();
    else this.looking = setTimeout(() => this.look(), LOOK_AT_REST_MS);
  }

  show(job) {
    const { id, state, seconds, behind } = job;
    this.running = state === "running";
    this.follows = this.running || job.page === null;
    this.button.textContent = this.running ? `Cancel, ${seconds.toFixed(0)} s` : "Diagnose (d)";
    if (state === "none") return;
    if (this.running) this.clear();
    this.showStages(job);
    this.state.textContent = { cancelled: `cancelled after ${seconds.toFixed(1)} s`, failed: "it failed:", done: `done in ${seconds.toFixed(1)} s` }[state] ?? "";
    this.behind.textContent = behind && !this.running ? `Of the model before the last ${behind === 1 ? "step" : `${behind} steps`}: what is there now is not diagnosed yet.` : "";
    if (job.evidence && !this.running && id !== this.shown) this.showOutcome(job);
    if (state === "done") {
      this.act.named?.(behind ? null : this.result);
      this.showPage(job.page);
    }
  }

  showOutcome({ id, state, printed, result, evidence: parts }) {
    Object.assign(this, { shown: id, result });
    this.outcome.replaceChildren(...(state === "done" ? [summaryLines(parts.verdict, parts.lines), ...evidence(parts, this.act)] : []));
    this.text.textContent = printed;
    this.whole.hidden = !printed;
    this.whole.open = state === "failed";
  }

  // The finished stages with their times; those of the others are unknown.
  showStages({ stages, steps, seconds, state }) {
    const ends = steps.map((_, k) => steps[k + 1]?.at_s ?? seconds);
    const last = steps.at(-1)?.text;
    this.stages.replaceChildren(...stages.map(({ text, only_where_needed }, place) => {
      const took_s = steps.reduce((sum, step, k) => sum + (step.text === text ? ends[k] - step.at_s : 0), 0);
      const begun = steps.some((step) => step.text === text);
      const now = this.running && text === last;
      const over = state === "done" || stages.findIndex((stage) => stage.text === last) > place;
      const status = now ? "now" : begun ? "been" : over ? "skipped" : "";
      const note = begun ? `${took_s.toFixed(1)} s` : over ? "not needed" : only_where_needed ? "only where effects leave more than noise" : "";
      return element("li", { class: status, ...(now ? { "aria-current": "step" } : {}) }, text, " ", element("small", {}, note));
    }));
  }

  // page: true, false where it could not be drawn, null while it may still come
  showPage(page) {
    const link = () => element("a", { href: `workbench/${this.bench.key}/diagnosis/page`, target: "_blank", rel: "noopener" }, "Open the page with pictures in a new tab");
    const content = { true: link, false: () => "Its pictures could not be drawn; the command line with --html tells why.", null: () => "The page with pictures is being drawn …" }[page]();
    if (this.page.firstChild?.textContent !== (content.textContent ?? content)) this.page.replaceChildren(content);
  }
}
