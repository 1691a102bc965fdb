// The recording of the gauges or the machine's own log, and the export of the instrument: chosen from a list, or
// uploaded from this computer.
import { element } from "../format.js";

export class Sources {
  constructor(recording, log, exported, [file, logFile], note) {
    Object.assign(this, { recording, log, exported, file, logFile, note, listed: null });
  }

  begin(wizard) {
    this.recording.addEventListener("change", () => wizard.change({ recording: this.recording.value, ...(this.recording.value && { log: null }) }));
    this.log.addEventListener("change", () => wizard.chooseLog(this.log.value));
    this.exported.addEventListener("change", () => wizard.choose(this.exported.value));
    this.bring(wizard, this.file, (name) => wizard.choose(name));
    this.bring(wizard, this.logFile, (name) => wizard.chooseLog(name));
  }

  bring(wizard, input, choose) {
    input.disabled = true; // until it is known whether this browser may
    input.addEventListener("change", () => {
      const [file] = input.files;
      if (file) wizard.attempt(async () => choose(await wizard.bring(file))).finally(() => (input.value = ""));
    });
  }

  show({ sources, choices }) {
    if (sources && sources !== this.listed) {
      this.listed = sources;
      const options = (names, none) => [element("option", { value: "" }, names.length ? "choose …" : none), ...names.map((name) => element("option", { value: name }, name))];
      this.recording.replaceChildren(...options(sources.gauges, "there is none without a reference"));
      this.log.replaceChildren(...options(sources.exports, "there is none yet"));
      this.exported.replaceChildren(...options(sources.exports, "there is none yet"));
      for (const input of [this.file, this.logFile]) input.disabled = !sources.may_write;
      this.note.textContent = `Recordings without a reference in ${sources.directory}, exports and logs in ${sources.directory}/exports. ${sources.may_write ? "Uploads are copied there." : "This browser is read-only: no uploads, no writing."}`;
    }
    this.recording.value = choices.recording ?? "";
    this.log.value = choices.log ?? "";
    this.exported.value = choices.export ?? "";
  }
}
