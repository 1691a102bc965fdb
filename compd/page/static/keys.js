// The keyboard; never with Ctrl, Alt or Meta, which are the browser's and the system's.
export function bindKeys({ page, machine, hour, drawer, freeze }) {
  const list = document.getElementById("keys");
  const actions = {
    " ": () => (page.frozen ? freeze(false) : hour.stop(page.live)),
    ArrowLeft: (event) => hour.step(event.shiftKey ? -60 : -1),
    ArrowRight: (event) => hour.step(event.shiftKey ? 60 : 1),
    ",": () => hour.step(-0.1),
    ".": () => hour.step(0.1),
    o: () => drawer.toggle(),
    "?": () => list.showModal(),
    Escape: () => (drawer.open ? drawer.toggle() : page.frozen && freeze(false)),
  };
  for (const key of ["f", "s", "t"]) actions[key] = () => machine.view(key);
  for (let link = 1; link <= 6; link++) actions[link] = () => document.querySelectorAll(".strip")[link - 1]?.click();
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest("input[type=text], select, dialog, textarea");
    if (typing || event.ctrlKey || event.altKey || event.metaKey || !actions[event.key]) return;
    if (event.key === " " && event.target.closest("button")) return;
    if (event.key.startsWith("Arrow") && event.target.closest("input")) return;
    event.preventDefault();
    actions[event.key](event);
  });
}
