"""Effects tried in addition to compd's: of the chosen libraries, and one's own."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from compd.errors import CompdError
from compd.model.effects import Effect
from compd.model.library import gather_effects, load_effects
from compd.page.workbench.own_effects import OwnEffects


class EffectSources:
    """Files of effects, as `--effects` takes them.

    Attributes
    ----------
    libraries : files that were chosen.
    own : effects of one's own, in a file beside the model file.
    effects : those of all files, as they were gathered last.
    """

    def __init__(self, own: OwnEffects) -> None:
        self.own = own
        self.libraries: list[str] = []
        self.gather()

    def gather(self) -> None:
        """Read all files. Raises CompdError with every problem of the libraries."""
        by_source: dict[str, Mapping[str, Effect]] = {
            **{source: dict(load_effects(source)) for source in self.libraries},
            **({str(self.own.path): self.own.effects} if self.own.effects else {}),
        }
        every = [effect for effects in by_source.values() for effect in effects.values()]
        self.effects: list[Effect] = list(gather_effects(every).values())
        self._source_by_effect = {effect: source for source, effects in by_source.items() for effect in effects}
        self._gathered = self.own.version

    def refresh(self) -> bool:
        """Read again if the file of one's own effects has changed; return whether it has."""
        self.own.reload()
        if self._gathered == self.own.version:
            return False
        self.gather()
        return True

    def use(self, libraries: Sequence[str]) -> bool:
        """Choose libraries; return whether they differ. Raises CompdError for a faulty one; none changes then."""
        if list(libraries) == self.libraries:
            return False
        before, self.libraries = self.libraries, list(libraries)
        try:
            self.gather()
        except CompdError:
            self.libraries = before
            raise
        return True

    @property
    def paths(self) -> list[str]:
        """Paths of all files with effects."""
        return [*self.libraries, *([str(self.own.path)] if self.own.effects else [])]

    def paths_of(self, effects: Collection[str]) -> list[str]:
        """Paths of the files with these effects."""
        wanted = {self.path_of(effect) for effect in effects}
        return [path for path in self.paths if path in wanted]

    def path_of(self, effect: str) -> str | None:
        """Path of the file with an effect; None for one of compd's or an unknown one."""
        return self._source_by_effect.get(effect)
