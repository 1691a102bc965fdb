// The join wizard: `compd recording join` with the mouse.
import { KeptExports } from "./kept_exports.js";
import { LogReading } from "./log_reading.js";
import { Putting } from "./putting.js";
import { Reading } from "./reading.js";
import { Sources } from "./sources.js";
import { Wizard } from "./wizard.js";
import { Writing } from "./writing.js";

const at = (id) => document.getElementById(id);
const wizard = new Wizard(at("problem-line"));
const sources = new Sources(at("recording"), at("log"), at("export"), [at("file"), at("log-file")], at("sources-note"));
sources.begin(wizard);
const kept = new KeptExports(wizard, { button: at("delete"), question: at("deleting"), name: at("deleting-name"), yes: at("delete-it"), no: at("keep-it"), note: at("usage-note") });
wizard.panels = [
  sources,
  kept,
  new LogReading(wizard, { panel: at("log-reading"), fields: at("log-fields"), problems: at("log-problems"), table: at("log-table"), taken: at("log-taken"), note: at("log-note") }),
  new Reading(wizard, { fields: at("reading-fields"), problems: at("problems"), table: at("table"), taken: at("taken"), note: at("reading-note") }),
  new Putting(wizard, { fields: at("putting-fields"), note: at("putting-note"), button: at("try"), result: at("result"), canvas: at("picture"), pictureNote: at("picture-note") }),
  new Writing(wizard, { name: at("name"), button: at("write"), link: at("open"), note: at("writing-note"), command: at("command") }),
];
wizard.attempt(() => wizard.list());
window.wizard = wizard; // for tests and inspection
