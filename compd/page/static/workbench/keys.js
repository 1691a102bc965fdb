// The keyboard of the workbench; never with Ctrl, Alt or Meta, which are the browser's and the system's.
import { element } from "../format.js";

export function bindKeys({ bench, picture, selection, exclusions, card, effects, ledger, diagnosis }) {
  const list = document.getElementById("keys");
  const keys = [
    ["j", "the next effect", () => effects.step(1)],
    ["k", "the effect before", () => effects.step(-1)],
    ["/", "filter the effects", () => effects.filter.focus()],
    ["0", "sliders to the fit", () => card.fit()],
    ["x", "before, or with the trial", () => picture.compare()],
    ["a", "add the effect: preview", () => card.add()],
    ["u", "undo the last step of the model", () => ledger.undo()],
    ["d", "diagnose, or cancel", () => diagnosis.startOrCancel()],
    ["]", "the next picture", () => picture.step(1)],
    ["[", "the picture before", () => picture.step(-1)],
    ["f", "3D from the front", () => picture.turn.look(0, 0)],
    ["s", "3D from the side", () => picture.turn.look(Math.PI / 2, 0)],
    ["t", "3D from the top", () => picture.turn.look(0, Math.PI / 2)],
    ["e", "leave the chosen rows out: the reason", () => exclusions.focus()],
    ["Escape", "choose no rows", () => selection.set([])],
    ["?", "this list", () => list.showModal()],
  ];
  const others = [["← →", "in the picture: choose a row, with Shift further ones"], ["← →", "on a slider: a step, with Shift ten"], ["Tab", "to everything else"]];
  list.querySelector("dl").replaceChildren(...[...keys, ...others].flatMap(([key, meaning]) => [element("dt", {}, key), element("dd", {}, meaning)]));
  document.addEventListener("keydown", (event) => {
    const act = keys.find(([key]) => key === event.key)?.[2];
    const typing = event.target.closest("input[type=text], input[type=search], input[type=number], select, textarea, dialog");
    if (!act || typing || event.ctrlKey || event.altKey || event.metaKey || (!bench.summary && event.key !== "?")) return;
    event.preventDefault();
    act();
  });
}
