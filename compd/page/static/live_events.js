// The events of the page's server: motion twenty times a second, and slow changes.
import { Latch } from "./latch.js";

// page: gets id and role of this connection, the newest events, and their latch. age: notes their delays.
// take: {machine(message), live(message, late_s), slow(message)}
export function listen(page, age, take) {
  page.latch = new Latch();
  const source = new EventSource("live");
  const on = (name, took) => source.addEventListener(name, (event) => took(JSON.parse(event.data)));
  on("hello", (message) => {
    age.begin();
    // arming ends with the connection
    Object.assign(page, { id: message.id, role: message.role, armed_until: 0 });
    take.machine(message.machine);
  });
  on("machine", (message) => take.machine(message.machine));
  on("live", (message) => {
    const late_s = age.arrived(message.made);
    page.live = message;
    page.latch.note(message.setpoint);
    take.live(message, late_s);
  });
  on("slow", (message) => {
    page.slow = message;
    take.slow(message);
  });
}
