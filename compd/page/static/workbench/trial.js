// A trial of an effect: the residual follows its numbers at once, as effects are linear in them.
export class Trial {
  // sums and columns from the server; rows: the drawn ones of the recording
  constructor(packed, rows) {
    Object.assign(this, packed);
    this.count = packed.shapes.gram[0];
    this.rows = rows;
    this.left = new Float32Array(rows.residual);
  }

  // The error per coordinate of all rows, including those not drawn: n rms² = r'r - 2 θ'J'r + θ'J'Jθ.
  rms(theta) {
    let left = this.square;
    theta.forEach((value, i) => {
      left -= 2 * value * this.moment[i];
      theta.forEach((other, k) => (left += value * other * this.gram[i * this.count + k]));
    });
    return Math.sqrt(Math.max(left, 0) / this.values);
  }

  // The residual of each drawn row.
  residual(theta) {
    const { columns, count, left } = this;
    const measured = this.rows.residual;
    for (let place = 0; place < measured.length; place++) {
      let value = measured[place];
      for (let k = 0; k < count; k++) value -= columns[place * count + k] * theta[k];
      left[place] = value;
    }
    return left;
  }

  // The displacement of each drawn row by the effect itself.
  moved(theta) {
    const { columns, count } = this;
    return this.rows.residual.map((_, place) => theta.reduce((sum, value, k) => sum + columns[place * count + k] * value, 0));
  }
}
