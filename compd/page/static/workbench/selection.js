// Rows that are chosen, by their number in the file: the same ones in every picture.
export class Selection {
  constructor() {
    Object.assign(this, { rows: new Set(), listeners: [] });
  }

  // change: called after every change
  listen(change) {
    this.listeners.push(change);
  }

  set(rows) {
    this.rows = new Set(rows);
    this.listeners.forEach((change) => change());
  }

  // As well as those that are chosen already.
  add(rows) {
    this.set([...this.rows, ...rows]);
  }
}
