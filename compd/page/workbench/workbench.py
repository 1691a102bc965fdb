"""One recording and one model file in the page, shared by all browsers that have them open. Lives in a worker."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from compd.comparison import Comparison
from compd.configuration import Machine
from compd.diagnosis import Diagnosis, diagnose
from compd.errors import CompdError, RecordingError, StateError
from compd.files import file_stamp, write_files
from compd.live.machine import ModelText
from compd.model.effects import Effect, can_concern
from compd.model.library import beside_library
from compd.page.recording_machine import machine_of
from compd.page.workbench.candidates import Candidates
from compd.page.workbench.effect_libraries import OWN_NAME
from compd.page.workbench.effect_sources import EffectSources
from compd.page.workbench.model_changes import proposed, step_summary, undone, write
from compd.page.workbench.opened_recording import OpenedRecording, open_for_page
from compd.page.workbench.own_effects import OwnEffects
from compd.page.workbench.trial import Trial
from compd.planning import MeasurementPlan
from compd.recording import exclude_rows, include_rows

# Most drafts: browsers that can write at once.
MOST = 16
_DIGITS = 12


class Drafts:
    """The newest drafts beside one comparison, each named after its content: `ram_growth@3f0c9b12a4d7`."""

    def __init__(self, comparison: Comparison, library: Candidates) -> None:
        """library : the known effects; a draft's fit has the same row weights."""
        self._comparison, self._library = comparison, library
        self._candidates: dict[str, Candidates] = {}

    @property
    def effects(self) -> dict[str, Effect]:
        """The drafts by name."""
        return {name: next(iter(candidates.library.values())) for name, candidates in self._candidates.items()}

    def add(self, effect: Effect) -> str:
        """Keep a draft, replacing the oldest beyond the limit; return its name."""
        text = json.dumps(effect.declared, sort_keys=True)
        name = f"{effect.id}@{hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]}"
        candidates = self._candidates.pop(name, None)
        self._candidates[name] = candidates or Candidates(self._comparison, [effect], self._library.problem)
        for oldest in list(self._candidates)[:-MOST]:
            del self._candidates[oldest]
        return name

    def find(self, name: str) -> tuple[Candidates, str]:
        """The candidates that contain an effect, and its id there: a draft, or any other effect of that name."""
        candidates = self._candidates.get(name)
        return (self._library, name) if candidates is None else (candidates, name.partition("@")[0])


class CommandLines(NamedTuple):
    """Command lines for one recording and one model file, which may be created later."""

    recording: Path
    model: Path
    machine: Machine | None

    def all(self, effects: Sequence[str]) -> dict[str, str]:
        """Command lines by action; EFFECT, ROWS and REASON stand for choices. effects : files of effects."""
        recording, model = str(self.recording), str(self.model)
        on = ["--recording", recording, "--model", model, *self._machine]
        words = {
            "compare": ["compare", recording, *self._known, *self._machine],
            "diagnose": ["diagnose", recording, *self._known, *_options(effects), *self._machine],
            "show": ["model", "effect", "EFFECT"],
            "add": ["model", "add", "EFFECT", *on],
            "remove": ["model", "remove", "EFFECT", *on],
            "undo": ["model", "undo", "--model", model],
            "fit": ["model", "fit", *on],
            "ledger": ["model", "ledger", model],
            "exclude": ["recording", "exclude", recording, "--rows", "ROWS", "--reason", "REASON"],
            "include": ["recording", "include", recording, "--rows", "ROWS"],
        }
        return {name: shlex.join(["compd", *line]) for name, line in words.items()}

    def plan(self, effects: Sequence[str], options: Sequence[str]) -> str:
        """`compd plan` with its options. effects : files of effects."""
        words = ["compd", "plan", str(self.recording), *self._machine, *self._known, *_options(effects)]
        return shlex.join([*words, *options])

    @property
    def _machine(self) -> list[str]:
        return [] if self.machine is None else ["--machine", str(self.machine)]

    @property
    def _known(self) -> list[str]:
        return ["--model", str(self.model)] if self.model.exists() else []


def _options(effects: Sequence[str]) -> list[str]:
    return [word for path in effects for word in ("--effects", path)]


class Workbench:
    """The open recording and the number of its changes: a browser with an older state is told so.

    Attributes
    ----------
    revision : counts changes of the model and of the rows that count.
    sources : files of effects that are tried beside compd's.
    candidates : the effects that may be tried.
    drafts : effects that are being written.
    plans : the newest of the next measurement, by key.
    commands : what is done here, as command lines.
    """

    def __init__(
        self, path: Path, model_path: Path, machine: Path | None, kept: Mapping[str, Any] | None = None
    ) -> None:
        """machine : the page's configuration, used for recordings of its machine.

        kept : of an ended workbench of the same files, which this one replaces.
        """
        self._path, self._model_path, self._machine = path, model_path, machine_of(path, machine)
        self.revision = 0
        self.sources = EffectSources(OwnEffects(model_path.parent / OWN_NAME))
        self.commands = CommandLines(path, model_path, self._machine)
        self.plans: dict[str, MeasurementPlan] = {}
        self._open()
        if kept is not None:
            self._go_on(kept)

    def _go_on(self, kept: Mapping[str, Any]) -> None:
        """Continue with the revision that browsers know if nothing has changed since."""
        is_same = kept["stamps"] == self._read
        try:
            if self.sources.use(kept["libraries"]):
                self._set_candidates()
        except CompdError:  # a library has become faulty meanwhile
            is_same = False
        self.revision = kept["revision"] + (not is_same)

    @property
    def kept(self) -> dict[str, Any]:
        """The state from which a successor continues: `revision`, `stamps` of the files, `libraries`."""
        return {"revision": self.revision, "stamps": self._read, "libraries": self.sources.libraries}

    def _open(self) -> None:
        self._read = self._stamps()
        self._set(open_for_page(self._path, self._model_path, self._machine))

    def _set(self, opened: OpenedRecording) -> None:
        self.opened = opened
        self.sources.gather()
        self._set_candidates()
        self._proposal: tuple[str, str, OpenedRecording] | None = None
        self.revision += 1

    def refresh(self) -> None:
        """Open it again if a command has changed one of its files meanwhile. Raises CompdError."""
        if self._stamps() != self._read:
            self._open()

    def _stamps(self) -> list[tuple[int, int] | None]:
        """Time of the last write and length of each file; None for a missing one."""
        paths = (self._path, self._path.with_suffix(".yaml"), self._model_path)
        return [file_stamp(path) for path in paths]

    def _set_candidates(self) -> None:
        rows = self.opened.aligned.rows
        own = {effect.id: effect for effect in self.sources.effects}
        every = [
            self.opened.aligned.on_machine(effect)
            for effect in beside_library(own)
            if effect.id in own or can_concern(effect, rows.available, rows.links)
        ]
        self.candidates = Candidates(self.opened.comparison, every)
        self.drafts = Drafts(self.opened.comparison, self.candidates)
        self._diagnoses: dict[str, Diagnosis] = {}

    def use_libraries(self, libraries: Sequence[str]) -> None:
        """Also try the effects of these files, as with `--effects`. Raises CompdError for a faulty one."""
        if self.sources.use(libraries):
            self._set_candidates()
            self._proposal = None
            self.revision += 1

    def look_again(self, libraries: Sequence[str] | None) -> None:
        """`refresh`, and `use_libraries` unless they are None. Raises as both."""
        self.refresh()
        if libraries is not None:
            self.use_libraries(libraries)
        if self.sources.refresh():
            self._set_candidates()

    def open_again(self, key: str, libraries: Sequence[str] | None) -> dict[str, Any]:
        """The summary for a browser that opens it, with the `key` of its address. Raises as `look_again`."""
        self.look_again(libraries)
        return {"key": key, **self.summary()}

    def summary(self) -> dict[str, Any]:
        """See `OpenedRecording.summary`; with the revision, and the hash of the model file as a daemon tells it."""
        if self.sources.refresh():
            self._set_candidates()
        return {
            **self.opened.summary(),
            "revision": self.revision,
            "libraries": [source.rpartition("/")[2] for source in self.sources.libraries],
            "model": str(self._model_path),
            "model_hash": ModelText.read(self._model_path).hash if self._model_path.exists() else "",
            "commands": self.commands.all(self.sources.paths),
        }

    def diagnosed(self) -> dict[str, Any]:
        """Input of a diagnosis: files `model` and `machine`, None for none; `effects`, files of effects."""
        return {
            "model": str(self._model_path) if self._model_path.exists() else None,
            "machine": None if self._machine is None else str(self._machine),
            "effects": self.sources.paths,
        }

    def rows(self, all_rows: bool) -> bytes:
        """See `OpenedRecording.rows`."""
        return self.opened.rows(all_rows=all_rows)

    def effects(self) -> dict[str, Any]:
        """See `Candidates.summary`; `own` says which effects are not of the library.

        `noise` : the verdict in words where only noise is left; else "".  `warning` : of each effect as of `doubt`;
        None where that takes a diagnosis.
        """
        summary = self.candidates.summary()
        known = self._diagnosis("") if self.candidates.is_noise else None
        return {
            **summary,
            "noise": known.summary if known is not None and known.verdict == "adequate" else "",
            "effects": [
                {
                    **effect,
                    "own": effect["effect"] in self.sources.own.effects,
                    "warning": None if known is None else known.doubt_of(effect["effect"]),
                }
                for effect in summary["effects"]
            ],
        }

    def _diagnosis(self, draft: str) -> Diagnosis:
        """The diagnosis of the present rows and model, made once.  draft : an effect beside the others; "" for none."""
        if draft not in self._diagnoses:
            library = {**self.candidates.library}
            if draft:
                candidates, _ = self.drafts.find(draft)
                library |= candidates.library
            model = self.opened.model
            effects = list(library.values())
            self._diagnoses[draft] = diagnose(self.opened.aligned, model.fitted, model.covariance, effects)
        return self._diagnoses[draft]

    def doubt(self, name: str, libraries: Sequence[str]) -> dict[str, Any]:
        """`warning` : why the rows do not support an effect, in the words of the verdict; else "".

        It takes a diagnosis, where none was made of these rows and this model.  name : as of `card`.
        libraries : the chosen ones. Raises as `look_again`.
        """
        self.look_again(libraries)
        candidates, effect = self.drafts.find(name)
        diagnosis = self._diagnosis("" if candidates is self.candidates else name)
        return {"warning": diagnosis.doubt_of(effect)}

    def card(self, name: str) -> dict[str, Any]:
        """See `Candidates.card`; `named` is how a command line names the effect. name : an id, or that of a draft.

        Raises KeyError if there is no such effect.
        """
        candidates, effect = self.drafts.find(name)
        own = name != effect or effect in self.sources.own.effects
        source = str(self.sources.own.path) if own else self.sources.path_of(effect)
        named = effect if source is None else shlex.quote(f"{source}:{effect}")
        return {**candidates.card(effect), "asked": name, "named": named, "own": own}

    def trial(self, name: str, variant: int) -> Trial:
        """See `Candidates.trial`. name : as of `card`."""
        candidates, effect = self.drafts.find(name)
        return candidates.trial(effect, variant)

    def tried(self, name: str, variant: int) -> bytes:
        """`trial`, for a browser."""
        return self.trial(name, variant).pack(self.opened.pictured, {"revision": self.revision})

    def propose(self, kind: str, effect: str) -> dict[str, Any]:
        """Preview of a step; no file is written. Raises CompdError for an impossible step."""
        return step_summary(self.opened, self._proposed(kind, effect))

    def _proposed(self, kind: str, effect: str) -> OpenedRecording:
        """The recording after a step, which is fitted once."""
        if self._proposal is None or self._proposal[:2] != (kind, effect):
            after = proposed(self.opened, kind, effect, {**self.candidates.library, **self.drafts.effects})
            self._proposal = (kind, effect, after)
        return self._proposal[2]

    def make(self, kind: str, effect: str, revision: int) -> dict[str, Any]:
        """Make the proposed step, and write the model file; return the summary.

        revision : that of which the browser knows. Raises StateError if somebody else was quicker.
        """
        self._check(revision)
        after = self._proposed(kind, effect)
        write(after)
        self._read = self._stamps()
        self._set(after)
        return self.summary()

    def undo(self, revision: int) -> dict[str, Any]:
        """Undo the last step; return the summary. Raises StateError as `make`, and if there is no step."""
        self._check(revision)
        after = undone(self.opened)
        self._read = self._stamps()
        self._set(after)
        return self.summary()

    def exclude(self, rows: Sequence[int], reason: str, revision: int) -> dict[str, Any]:
        """Leave rows out, with the reason in the sidecar; return the summary.

        Raises CompdError if they cannot be left out, StateError where somebody else was quicker.
        """
        self._check(revision)
        known = set(self.opened.aligned.recording.row.tolist())
        if unknown_rows := [row for row in rows if row not in known]:
            raise RecordingError.of(
                f"row {unknown_rows[0]}", "is not in the recording", allowed="rows of the recording"
            )
        return self._with_other_rows(lambda: exclude_rows(self._path, rows, reason))

    def include(self, rows: Sequence[int], revision: int) -> dict[str, Any]:
        """Let rows count again; return the summary. Raises as `exclude`."""
        self._check(revision)
        return self._with_other_rows(lambda: include_rows(self._path, rows))

    def _with_other_rows(self, change: Callable[[], None]) -> dict[str, Any]:
        """The summary after a change of the sidecar; the change is undone if no comparison is possible then."""
        sidecar = self._path.with_suffix(".yaml")
        before = sidecar.read_bytes()
        change()
        try:
            self._open()
            return self.summary()
        except CompdError:
            write_files({sidecar: before})
            self._open()
            raise

    def _check(self, revision: int) -> None:
        if revision != self.revision:
            raise StateError.of(
                "workbench",
                "the model or the rows were changed elsewhere meanwhile",
                next_step="check the present state, then repeat it",
            )
