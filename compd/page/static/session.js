// What a view of the page works on, with the line in which its problems are said in words.
export class Session {
  constructor(status) {
    this.status = status;
  }

  say(text) {
    this.status.textContent = text;
  }

  // What goes wrong is said in words; nothing that was shown stays as if it were the answer.
  async attempt(work) {
    try {
      this.say("");
      return await work();
    } catch (error) {
      this.say(error.message);
    }
  }
}
