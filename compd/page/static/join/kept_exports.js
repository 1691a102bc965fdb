// Stored exports against their limits, and deletion of one after a confirmation.
const MB = 2 ** 20;

export class KeptExports {
  constructor(wizard, { button, question, name, yes, no, note }) {
    Object.assign(this, { wizard, button, question, name, note, listed: null });
    button.addEventListener("click", () => this.ask(true));
    no.addEventListener("click", () => this.ask(false));
    yes.addEventListener("click", () => this.delete());
    question.addEventListener("keydown", (event) => event.key === "Escape" && this.ask(false));
    this.yes = yes;
  }

  ask(asked) {
    this.asked = asked ? this.wizard.choices.export : null;
    this.name.textContent = asked ? `Delete ${this.asked} from the page's computer? There is no way back.` : "";
    this.question.hidden = !asked;
    (asked ? this.yes : this.button).focus();
  }

  async delete() {
    const name = this.asked;
    this.ask(false);
    const deleted = await this.wizard.attempt(async () => {
      await this.wizard.remove(name);
      return true;
    });
    if (!deleted) return;
    this.wizard.say(`${name} is deleted.`);
    document.getElementById("export").focus();
  }

  show({ sources, choices }) {
    this.button.disabled = !sources?.may_write || !choices.export;
    if (this.asked && this.asked !== choices.export) {
      this.asked = null;
      this.question.hidden = true;
    }
    if (sources && sources !== this.listed) {
      this.listed = sources;
      this.wizard.usage().then(
        ({ files, bytes, most_files, most_bytes }) => (this.note.textContent = `Kept: ${files} of ${most_files} files, ${(bytes / MB).toFixed(1)} of ${most_bytes / MB} MB.`),
        (error) => (this.note.textContent = error.message),
      );
    }
  }
}
