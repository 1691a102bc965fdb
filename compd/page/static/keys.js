// The keyboard; never with Ctrl, Alt or Meta, which are the browser's and the system's.
// A button with `data-key` does what the key does, with `data-shift` as with Shift.
export function bindKeys({ page, machine, hour, drawer, freeze }) {
  const list = document.getElementById("keys");
  const actions = {
    " ": () => (page.frozen ? freeze(false) : hour.stop(page.live)),
    ArrowLeft: (event) => hour.step(event.shiftKey ? -60 : -1),
    ArrowRight: (event) => hour.step(event.shiftKey ? 60 : 1),
    ",": () => hour.step(-0.1),
    ".": () => hour.step(0.1),
    o: () => drawer.toggle(),
    "+": () => hour.zoom(0.5),
    "-": () => hour.zoom(2),
    0: () => hour.whole(),
    "?": () => list.showModal(),
    Escape: () => (drawer.open ? drawer.toggle() : page.frozen && freeze(false)),
  };
  for (const key of ["f", "s", "t"]) actions[key] = () => machine.view(key);
  for (let link = 1; link <= 6; link++) actions[link] = () => document.querySelectorAll(".strip")[link - 1]?.click();
  for (const button of document.querySelectorAll("[data-key]")) button.addEventListener("click", () => actions[button.dataset.key]({ shiftKey: "shift" in button.dataset }));
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest("input[type=text], select, dialog, textarea");
    if (typing || event.ctrlKey || event.altKey || event.metaKey || !actions[event.key]) return;
    if (event.key === " " && event.target.closest("button")) return;
    if (event.key.startsWith("Arrow") && event.target.closest("input")) return;
    event.preventDefault();
    actions[event.key](event);
  });
}
