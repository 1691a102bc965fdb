// What each order is called.
const WHAT_IS_ORDERED = { zero: "Take machine zero", accept: "Accept gauges", shadow: "Run as a shadow", adopt: "Adopt the shadow's model", "no-model": "Run without effects" };

export function nameOf(order, subject) {
  return order === "shadow" && !subject ? "End the shadow" : WHAT_IS_ORDERED[order];
}

// Of the first step, which gives no order yet.
export const firstStep = (order, subject) => `${nameOf(order, subject)} …`;
