// The events of the page's server: what the machine does, twenty times a second, and what changes slowly.

// page: gets id and role of this connection, and the newest events. age: notes how late they are.
// take: {machine(told), live(told, late_s), slow(told)}
export function listen(page, age, take) {
  const source = new EventSource("live");
  const on = (name, took) => source.addEventListener(name, (event) => took(JSON.parse(event.data)));
  on("hello", (told) => {
    age.begin();
    // arming ends with the connection
    Object.assign(page, { id: told.id, role: told.role, armed_until: 0 });
    take.machine(told.machine);
  });
  on("machine", (told) => take.machine(told.machine));
  on("live", (told) => {
    const late_s = age.arrived(told.made);
    page.live = told;
    take.live(told, late_s);
  });
  on("slow", (told) => {
    page.slow = told;
    take.slow(told);
  });
}
