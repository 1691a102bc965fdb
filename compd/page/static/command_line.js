// The equivalent command line of a choice on the page, for copying.
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
    // long words break at the line's end, never at their hyphens
    this.code.replaceChildren(...text.split(" ").flatMap((word, k) => [k ? " " : "", element("span", {}, word)]));
  }
}
