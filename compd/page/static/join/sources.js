// The recording of the gauges, and the export of the instrument: chosen from a list, or uploaded from this computer.
import { element } from "../format.js";

export class Sources {
  constructor(recording, exported, file, note) {
    Object.assign(this, { recording, exported, file, note, listed: null });
  }

  begin(wizard) {
    this.recording.addEventListener("change", () => wizard.change({ recording: this.recording.value }));
    this.exported.addEventListener("change", () => wizard.choose(this.exported.value));
    this.file.addEventListener("change", () => {
      const [file] = this.file.files;
      if (file) wizard.attempt(() => wizard.bring(file)).finally(() => (this.file.value = ""));
    });
  }

  show({ sources, choices }) {
    if (sources && sources !== this.listed) {
      this.listed = sources;
      const options = (names, none) => [element("option", { value: "" }, names.length ? "choose …" : none), ...names.map((name) => element("option", { value: name }, name))];
      this.recording.replaceChildren(...options(sources.gauges, "there is none without a reference"));
      this.exported.replaceChildren(...options(sources.exports, "there is none yet"));
      this.file.disabled = !sources.may_write;
      this.note.textContent = `Recordings without a reference in ${sources.directory}, exports in ${sources.directory}/exports. ${sources.may_write ? "Uploads are copied there." : "This browser is read-only: no uploads, no writing."}`;
    }
    this.recording.value = choices.recording ?? "";
    this.exported.value = choices.export ?? "";
  }
}
