"""The cases of the gallery: one family of effects each, chosen so that every kind of verdict is among them."""

from __future__ import annotations

from dataclasses import dataclass

from compd.diagnosis.verdict import Verdict


@dataclass(frozen=True)
class Case:
    """A simulated machine with hidden causes.

    name : of its files.  title : its heading.  machine : of a shipped configuration.
    effects : ids of the causes, as `compd sim campaign --effect` takes them.  seed : of machine, weather and noise.
    verdict : the kind of verdict that `look_at` is written for; the gallery is not made with another.
    look_at : what the case shows, and where on its page.
    """

    name: str
    title: str
    machine: str
    effects: tuple[str, ...]
    seed: int
    verdict: Verdict
    look_at: str

    @property
    def campaign_command(self) -> list[str]:
        """The command that simulates the measurement to learn from."""
        effects = [part for effect in self.effects for part in ("--effect", effect)]
        return [
            "sim",
            "campaign",
            f"config/{self.machine}.yaml",
            "--seed",
            str(self.seed),
            *effects,
            "--out",
            "learn.csv",
        ]

    @property
    def other_days_command(self) -> list[str]:
        """The command that simulates the same machine on other days."""
        return [*self.campaign_command[:-1], "other.csv", "--other-days", "1"]


DIAGNOSE_COMMAND = ["diagnose", "learn.csv", "other.csv", "--html", "diagnosis.html"]

CASES = (
    Case(
        name="backlash",
        title="A scale: backlash",
        machine="tripod-cmm",
        effects=("backlash",),
        seed=1,
        verdict="identified",
        look_at="The error has two levels, one for each direction from which a link was approached. On the page, the "
        "figure *the error against what drives it* shows the two levels before, and one level at zero after.",
    ),
    Case(
        name="joint-comparator-gain",
        title="A comparator: wrong gain",
        machine="tripod-cmm",
        effects=("joint_comparator_gain",),
        seed=1,
        verdict="identified",
        look_at="The comparators in the joints show more or less than their plungers move, all by the same share. "
        "The page gives the share with its standard error; a gauge block of known thickness would confirm it.",
    ),
    Case(
        name="joint-contact",
        title="A link under load: two effects look alike",
        machine="tripod-cmm",
        effects=("joint_contact=0.03",),
        seed=1,
        verdict="ambiguous",
        look_at="Contacts in the joints that give way and links that stretch both follow the link's force, and this "
        "measurement has too few different loads to separate them where the error is small. The verdict names both "
        "effects, and lists the rows to measure next. [Tell two effects apart](../how-to/tell-two-effects-apart.md) "
        "goes on from here.",
    ),
    Case(
        name="platform-expansion",
        title="A hexapod's platform grows with temperature",
        machine="hexapod",
        effects=("platform_expansion",),
        seed=1,
        verdict="identified",
        look_at="The joints on the moving platform move apart when it warms up. This machine has six links, and the "
        "same library of effects is tried on it.",
    ),
    Case(
        name="two-effects",
        title="Tool and reference: two effects at once",
        machine="tripod-cmm",
        effects=("tool_bending", "reference_drift"),
        seed=1,
        verdict="identified",
        look_at="The tool bends under force, and the reference instrument itself drifts with time. Neither effect "
        "alone brings the error down to the noise; the page shows the error after the first and after both.",
    ),
    Case(
        name="cable-drag",
        title="Outside the library: a cable pulls",
        machine="tripod-cmm",
        effects=("cable_drag",),
        seed=3,
        verdict="unexplained",
        look_at="No effect of the library is the right one, and none is named. Instead the verdict says what the error "
        "follows, and proposes a formula which can be used until the cause is known. The page's figure of the rest "
        "against x shows where the cable comes taut.",
    ),
)
