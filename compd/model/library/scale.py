"""What makes a linear scale show something else than the length it stands for; added to its reading, in mm."""

from __future__ import annotations

from compd.model.effects import Constant, Effect, KernelBasis, Parameter
from compd.model.kernels.effects import scale

# Gratings on the market, from interferential (2 um) to magnetic (1 mm and more).
PERIODS_MM = (0.002, 0.004, 0.008, 0.010, 0.020, 0.040, 0.050, 0.080, 0.100, 0.200, 0.400, 0.500, 1.0, 2.0)

EFFECTS = (
    Effect(
        id="scale_gain",
        ports=("scale",),
        physics="A scale's graduation is longer or shorter than it says, by a constant share.",
        equation="delta_i = k_i g_i",
        symbols={"k_i": "gain error of scale i, ppm", "g_i": "reading of scale i, mm"},
        source="Slocum, Precision Machine Design (1992), chapter 4: linear error of graduated scales",
        needs=("scale",),
        parameters=(
            Parameter(
                "k",
                "ppm",
                -50,
                50,
                "accuracy grades of exposed scales: 3-10 um/m; steel tape: 50",
                "scale",
                tolerance="gain",
            ),
        ),
        mistaken_for=("link_sag", "scale_expansion"),
        separated_by="long and short links in several attitudes, at two temperatures",
        basis=KernelBasis(scale.gain),
        intercept="link_zero",
    ),
    Effect(
        id="scale_expansion",
        ports=("scale",),
        physics="A scale grows with temperature over the length that has been travelled.",
        equation="delta_i = a g_i dT_link_i",
        symbols={
            "a": "expansion coefficient of the scale, ppm/K",
            "g_i": "reading of scale i, mm",
            "dT_link_i": "temperature of link i above 20 degC, K",
        },
        source="Slocum, Precision Machine Design (1992), chapter 4; ISO 1 for the reference temperature",
        needs=("scale", "temperature_link_{scale}_degC"),
        parameters=(Parameter("a", "ppm/K", 0, 23, "Zerodur 0, glass 8, steel 10.5-12, aluminium 23"),),
        mistaken_for=("scale_gain", "link_expansion"),
        separated_by="the same long and short links at two temperatures 3 K apart",
        basis=KernelBasis(scale.expansion),
        counts_from="its own",
    ),
    Effect(
        id="scale_cyclic",
        ports=("scale",),
        physics="The two signals of a scale are not quite sine and cosine, so that interpolation errs within a period.",
        equation="delta_i = A1_i sin(2 pi g_i/p) + B1_i cos(2 pi g_i/p) + A2_i sin(4 pi g_i/p) + B2_i cos(4 pi g_i/p)",
        symbols={
            "A1_i, B1_i": "first harmonic of scale i (offset of a signal), um",
            "A2_i, B2_i": "second harmonic of scale i (unequal amplitude, phase), um",
            "g_i": "reading of scale i, mm",
            "p": "signal period, mm",
        },
        source="Heydemann, Applied Optics 20 (1981) 3382: errors of quadrature signals",
        needs=("scale",),
        parameters=tuple(
            Parameter(
                name, "um", -2, 2, "1 % of the period for a good scale (0.2 um at 20 um), 10 % for a bad one", "scale"
            )
            for name in ("A1", "B1", "A2", "B2")
        ),
        mistaken_for=(),
        separated_by="twenty steps of a twentieth of a period on one link; what looks like noise repeats",
        basis=KernelBasis(scale.cyclic),
        constants=(
            Constant(
                "p",
                "mm",
                0.0001,
                10,
                "periods of scales on the market, pitches of screws",
                PERIODS_MM,
                setting="scale_signal_period_mm",
                period_of="scale_mm",
            ),
        ),
    ),
    Effect(
        id="backlash",
        ports=("scale",),
        physics="Play between scale and link: on its way the scale is ahead of the link by half of it.",
        equation="delta_i = -b_i sgn(direction_i) / 2",
        symbols={
            "b_i": "play of link i, um; negative where the link runs ahead of the scale",
            "direction_i": "+1 or -1, as link i last moved",
        },
        source="ISO 230-2: reversal value of an axis",
        needs=("direction",),
        parameters=(Parameter("b", "um", 0, 20, "preloaded ball screw 0.1-1, worn or plain screw 20", "scale"),),
        mistaken_for=("friction_hysteresis", "gauge_latency"),
        separated_by="approach each point from both sides, by long and by short moves, at two speeds and at rest",
        basis=KernelBasis(scale.backlash),
    ),
    Effect(
        id="friction_hysteresis",
        ports=("scale",),
        physics="Friction bends what carries the scale; after a reversal the bend builds up again over a distance.",
        equation="delta_i = -h z_i; r = 0: z_i := min(1, max(-1, z_i + change of g_i / d)); "
        "r = 1: dz_i/dg_i = (s - z_i) s / d",
        symbols={
            "h": "bend when sliding, um; negative where it is the scale that lags",
            "z_i": "how far link i has yielded, -1 to 1",
            "g_i": "reading of scale i, mm",
            "s": "direction of motion, +1 or -1",
            "d": "travel from unbent to sliding, or in which the loop nears its end by a factor e, mm",
            "r": "0 where one spring slides at once, 1 where many slide one after another: a round loop",
        },
        source="stop operator: Visintin, Differential Models of Hysteresis (1994); friction: Dahl (1968)",
        needs=("scale", "order", "direction"),
        parameters=(Parameter("h", "um", -5, 5, "rolling guides 0.1-1, plain guides 5; either sign"),),
        mistaken_for=("backlash",),
        separated_by="small reversals in growing steps: backlash jumps at once, friction builds up over d",
        basis=KernelBasis(scale.hysteresis, states=2),
        constants=(
            Constant(
                "d",
                "mm",
                0.001,
                50,
                "rolling contacts 0.001-0.1; bellows, cable chains and seals up to 50",
                (0.001, 0.01, 0.1, 1.0, 2.0, 5.0, 10.0, 20.0, 35.0, 50.0),
            ),
            Constant("r", "1", 0, 1, "single contacts 0, guides and bellows 1", (0.0, 1.0)),
        ),
        remembers=True,
    ),
    Effect(
        id="gauge_latency",
        ports=("scale", "joint"),
        physics="A reading is old by the time it is used; a moving link has gone on meanwhile.",
        equation="delta_i = v_i tau",
        symbols={"v_i": "velocity of reading i, mm/s", "tau": "age of the reading, ms"},
        source="Taylor expansion of the reading in time, first term",
        needs=("motion", "time"),
        parameters=(Parameter("tau", "ms", 0, 50, "polling 1-16 ms, averaging in displays up to 50 ms"),),
        mistaken_for=("backlash",),
        separated_by="moving rows at two speeds: latency grows with speed and is nil at rest",
        basis=KernelBasis(scale.latency),
    ),
)
