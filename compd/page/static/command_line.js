// The command line that something on the page amounts to, to be copied.
import { element } from "./format.js";

export class CommandLine {
  constructor(text = "") {
    this.code = element("code", {});
    this.button = element("button", { type: "button", title: "Copy this command line", onclick: () => this.copy() }, "Copy");
    this.row = element("div", { class: "command" }, this.code, this.button);
    this.write(text);
  }

  write(text) {
    this.row.hidden = !text;
    if (this.code.textContent === text) return;
    // a word is broken where it does not fit a line, and not at its hyphens
    this.code.replaceChildren(...text.split(" ").flatMap((word, k) => [k ? " " : "", element("span", {}, word)]));
  }

  async copy() {
    // a page that is neither on this computer nor behind TLS has no clipboard: there the text is selected, and copied
    if (navigator.clipboard) await navigator.clipboard.writeText(this.code.textContent).catch(() => this.select());
    else this.select();
    this.button.textContent = "Copied";
    setTimeout(() => (this.button.textContent = "Copy"), 1500);
  }

  select() {
    getSelection().selectAllChildren(this.code);
    document.execCommand("copy");
  }
}
