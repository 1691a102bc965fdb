// The selected rows, by their number in the file, shared by all pictures.
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

  // Add to the selected rows.
  add(rows) {
    this.set([...this.rows, ...rows]);
  }
}
