// The new recording: its name, the equivalent command line, and the link to open it.
import { CommandLine } from "../command_line.js";

export class Writing {
  constructor(wizard, { name, button, link, note, command }) {
    Object.assign(this, { wizard, name, button, link, note });
    this.command = new CommandLine();
    command.replaceChildren(this.command.row);
    name.addEventListener("input", () => wizard.change({ name: name.value.trim() }));
    button.addEventListener("click", () => this.write());
  }

  show({ command, trial, choices, sources }) {
    this.command.write(command);
    this.button.disabled = !sources?.may_write || !choices.name || !trial || Boolean(trial.reason);
    this.note.textContent = !sources || sources.may_write ? (trial && !trial.reason ? "Give a name, and write it." : "Try it first.") : "This browser is read-only; the command line does the same.";
    if (this.written !== JSON.stringify(choices)) this.link.hidden = true;
    else this.note.textContent = this.message;
  }

  write() {
    const { wizard } = this;
    const chosen = JSON.stringify(wizard.choices);
    this.button.disabled = true;
    return wizard.attempt(async () => {
      try {
        const { recording, path } = await wizard.ask("recording");
        Object.assign(this, { written: chosen, message: `Written: ${path}` });
        this.link.href = `/workbench?recording=${recording}`;
        this.link.hidden = false;
      } finally {
        wizard.show();
      }
    });
  }
}
