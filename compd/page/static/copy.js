// A button that copies the text of an element.
import { element } from "./format.js";

export function copyButton(source, title) {
  const button = element("button", { type: "button", title, onclick: () => copy() }, "Copy");
  const select = () => {
    getSelection().selectAllChildren(source);
    document.execCommand("copy");
  };
  async function copy() {
    // without TLS, a page from another computer has no clipboard: the text is selected, and copied
    if (navigator.clipboard) await navigator.clipboard.writeText(source.textContent).catch(select);
    else select();
    button.textContent = "Copied";
    setTimeout(() => (button.textContent = "Copy"), 1500);
  }
  return button;
}
