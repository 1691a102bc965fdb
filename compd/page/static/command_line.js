// The command line that something on the page amounts to, to be copied.
import { copyButton } from "./copy.js";
import { element } from "./format.js";

export class CommandLine {
  constructor(text = "", title = "Copy this command line") {
    this.code = element("code", {});
    this.row = element("div", { class: "command" }, this.code, copyButton(this.code, title));
    this.write(text);
  }

  write(text) {
    this.row.hidden = !text;
    if (this.code.textContent === text) return;
    // a word is broken where it does not fit a line, and not at its hyphens
    this.code.replaceChildren(...text.split(" ").flatMap((word, k) => [k ? " " : "", element("span", {}, word)]));
  }
}
