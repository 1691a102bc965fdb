// Recordings: made and ended from here, listed, and downloaded.
import { CommandLine } from "./command_line.js";
import { dateText, element } from "./format.js";
import { post } from "./post.js";

export class Recordings {
  constructor(page, say) {
    Object.assign(this, { page, say, listing: null, recording: null });
    const button = (text, onclick, id) => element("button", { type: "button", onclick, id }, text);
    this.name = element("input", { type: "text", placeholder: "name of a recording", "aria-label": "Name of the recording" });
    this.name.addEventListener("input", () => this.showCommands());
    this.record = button("Record", () => this.startOrStop(), "record");
    this.burst = button("Burst of 5 s", () => this.begin(5), "burst");
    this.recorded = element("p", { class: "note" });
    this.where = element("p", { class: "note" });
    this.command = new CommandLine();
    this.burstCommand = new CommandLine();
    this.body = element("tbody");
    this.parts = [
      element("div", { class: "row" }, this.name, this.record, this.burst),
      this.recorded,
      this.command.row,
      this.burstCommand.row,
      this.where,
      element("table", { "aria-label": "Recordings" }, this.body),
    ];
  }

  async startOrStop() {
    if (!this.page.slow?.recording) return this.begin(null);
    await post("recordings", { stop: true });
    this.list();
  }

  async begin(burst_s) {
    const answer = await post("recordings", { name: this.name.value.trim(), burst_s });
    this.say(answer.ok ? "" : answer.reason);
    this.list();
  }

  async list() {
    this.listing = await (await fetch("recordings")).json();
    this.where.textContent = `in ${this.listing.directory}`;
    this.showCommands();
    this.body.replaceChildren(...this.listing.parts.flatMap((part) => this.rows(part)));
  }

  rows(part) {
    const link = element("a", { href: `recordings/${part.name}`, download: true }, part.name);
    const numbers = [element("td", { class: "number" }, `${(part.bytes / 1e6).toFixed(2)} MB`), element("td", {}, dateText(new Date(part.changed)))];
    return [element("tr", {}, element("td", {}, link), ...numbers), element("tr", {}, element("td", { colspan: 3 }, new CommandLine(part.command).row))];
  }

  // As typed; the server refuses an invalid name.
  showCommands() {
    const name = this.name.value.trim();
    const named = (command) => (/^[\w-]+$/.test(name) ? command.replace("/NAME ", `/${name} `) : command);
    this.command.write(named(this.listing?.command ?? ""));
    this.burstCommand.write(named(this.listing?.burst_command ?? ""));
  }

  // The slow event.
  show({ recording, last_words }, open) {
    const looksOnly = this.page.role !== "operate";
    this.record.disabled = looksOnly;
    this.burst.disabled = looksOnly || Boolean(recording);
    this.record.textContent = recording ? `Stop ${recording.name}` : "Record";
    if (this.recording && !recording && open) this.list();
    this.recording = recording;
    this.recorded.textContent = last_words || (recording ? `recording ${recording.name} since ${dateText(new Date(recording.started * 1000))}` : "");
  }
}
