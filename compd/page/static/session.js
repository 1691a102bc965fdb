// State of a view of the page, with the line for its problems in words.
export class Session {
  constructor(status) {
    this.status = status;
  }

  say(text) {
    this.status.textContent = text;
  }

  // Show an error in words, and remove the old answer.
  async attempt(work) {
    try {
      this.say("");
      return await work();
    } catch (error) {
      this.say(error.message);
    }
  }
}
