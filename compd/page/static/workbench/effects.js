// The effects of the library, the one that explains most first; chosen by mouse, or by j and k.
import { amounts, element } from "../format.js";

export class Effects {
  // choose: called with an effect; ranked: called with the server's ranking
  constructor(place, filter, note, { choose, ranked }) {
    Object.assign(this, { place, filter, note, choose, ranked, effects: [], draft: null, chosen: "", noise: "", remarks: {} });
    filter.addEventListener("input", () => this.draw());
  }

  async begin(bench) {
    const last = this.chosen;
    Object.assign(this, { effects: [], draft: null, chosen: "", noise: "" });
    this.draw();
    this.note.textContent = "computing each effect …";
    Object.assign(this, { unit: bench.summary.unit, warnings: bench.warnings });
    const ranking = await bench.get("effects");
    Object.assign(this, { effects: ranking.effects, noise: ranking.noise });
    this.ranked(ranking);
    this.draw();
    for (const { effect, warning } of this.effects) {
      if (warning === null) continue;
      bench.doubts.set(effect, warning);
      bench.warned(effect, warning);
    }
    // the diagnosis that says whether the rows support an effect begins while a person still looks
    void this.askDoubts(bench);
    // what was chosen stays chosen while it is still offered
    if (last && this.effects.some(({ effect }) => effect === last)) await this.pick(last);
  }

  // In turn: the first takes a diagnosis, the others are answered from it.
  async askDoubts(bench) {
    const { effects } = this;
    for (const { effect, explained } of effects) {
      if (this.effects !== effects) return;
      if (explained !== null) await bench.doubtOf(effect).catch(() => {});
    }
  }

  warned() {
    this.draw();
  }

  // Mark the findings of a diagnosis; null for none.
  name(result) {
    const steps = result?.steps ?? [];
    const rivals = steps.flatMap(({ effect, rivals }) => rivals.map((rival) => [rival, `as good as ${effect.replaceAll("_", " ")}`]));
    const remarks = Object.fromEntries([...rivals, ...steps.map(({ effect }, k) => [effect, `named, number ${k + 1}`])]);
    if (JSON.stringify(remarks) === JSON.stringify(this.remarks)) return;
    this.remarks = remarks;
    this.draw();
  }

  // Show the effect being written among the others; null for none.
  write(draft) {
    this.draft = draft && { ...draft, remark: "being written" };
    this.draw();
  }

  get all() {
    if (!this.draft) return this.effects;
    const place = this.effects.findIndex(({ left_out_rms }) => left_out_rms === null || left_out_rms > (this.draft.left_out_rms ?? Infinity));
    return this.effects.toSpliced(place < 0 ? this.effects.length : place, 0, this.draft);
  }

  get shown() {
    const wanted = this.filter.value.trim().toLowerCase();
    return this.all.filter(({ effect, physics }) => `${effect} ${physics}`.toLowerCase().includes(wanted));
  }

  step(by) {
    const names = this.shown.map(({ effect }) => effect);
    const next = names[Math.max(0, Math.min(names.length - 1, names.indexOf(this.chosen) + by))];
    if (next) this.pick(next);
  }

  pick(effect) {
    this.chosen = effect;
    this.draw();
    this.place.querySelector("[aria-selected=true]")?.scrollIntoView({ block: "nearest" });
    return this.choose(effect);
  }

  draw() {
    const shown = this.shown;
    // the verdict on top says it whole
    this.note.textContent = this.noise ? this.noise.split(/[:.] /)[0] : `${shown.length} of ${this.all.length}; what each explains alone, on rows left out`;
    this.place.classList.toggle("noise-only", Boolean(this.noise));
    this.place.replaceChildren(...shown.map((effect) => this.row(effect)));
  }

  row({ effect, status, why, explained, left_out_rms, own, remark = this.remarks[effect] }) {
    const percent = explained === null || this.noise ? null : Math.round(100 * Math.max(0, Math.min(1, explained)));
    const bar = element("i", { class: this.warnings?.get(effect) === "" ? "" : "doubted" }); // green where the rows support it
    bar.style.width = `${percent ?? 0}%`;
    return element(
      "button",
      { type: "button", class: "effect", role: "option", "aria-selected": String(effect === this.chosen), "data-effect": effect, title: why, onclick: () => this.pick(effect) },
      element("span", { class: "name" }, element("b", {}, effect.split("@")[0].replaceAll("_", " "), ...(own ? [element("small", { class: "own" }, " own")] : [])), element("span", {}, percent === null ? "" : `${percent} %`)),
      ...(percent === null ? [] : [element("div", { class: "share" }, bar)]),
      element("small", { class: remark ? "remark" : "" }, remark ?? this.left(status, why, left_out_rms)),
    );
  }

  // The error left by an effect, tried alone.
  left(status, why, rms) {
    return status === "partial" || status === "explains" ? `alone, leaves ${amounts([rms], this.unit)}` : why;
  }
}
