"""What makes a link longer or shorter than its scale and joints say; added to its length, in mm."""

from __future__ import annotations

from compd.model.effects import Constant, Effect, KernelBasis, Parameter
from compd.model.kernels.effects import link

_EXPANSION_RANGE = "Super-Invar rod 0-0.8, steel 11-12.5, aluminium 23"

EFFECTS = (
    Effect(
        id="link_expansion",
        ports=("link",),
        physics="The rods between joints and scale grow with temperature.",
        equation="delta_i = a l_i dT_link_i",
        symbols={
            "a": "expansion coefficient, ppm/K",
            "l_i": "length of link i, mm",
            "dT_link_i": "temperature of link i since machine zero, K",
        },
        source="Oiwa, section 2.2 and figure 5",
        needs=("kinematics", "temperature_link_{link}_degC"),
        parameters=(Parameter("a", "ppm/K", 0, 23, _EXPANSION_RANGE),),
        mistaken_for=("link_expansion_lag", "link_zero"),
        separated_by="a change of temperature by 3 K, fast enough that a lag would show",
        basis=KernelBasis(link.expansion),
    ),
    Effect(
        id="link_expansion_lag",
        ports=("link",),
        physics="The rods grow with temperature, but warm up later than the thermometer on the link's skin.",
        equation="delta_i = a l_i y_i, tau dy_i/dt = dT_link_i - y_i",
        symbols={
            "a": "expansion coefficient, ppm/K",
            "l_i": "length of link i, mm",
            "y_i": "warming of the rod in link i, K; fitted along at the start of a session, dT_link_i in the daemon",
            "dT_link_i": "temperature of link i since machine zero, K",
            "tau": "time constant of warming up, s",
        },
        source="lumped heat capacity: Incropera, Fundamentals of Heat and Mass Transfer, chapter 5",
        needs=("kinematics", "temperature_link_{link}_degC", "time", "order"),
        parameters=(Parameter("a", "ppm/K", 0, 23, _EXPANSION_RANGE),),
        mistaken_for=("link_expansion", "reference_drift"),
        separated_by="a step of temperature, watched for three time constants",
        basis=KernelBasis(link.lagged_expansion, states=3),
        constants=(
            Constant(
                "tau",
                "s",
                60,
                30000,
                "thin rod in moving air 60 s, thick tube in still air hours",
                (60.0, 120.0, 240.0, 480.0, 900.0, 1800.0, 3600.0, 7200.0, 14400.0, 30000.0),
            ),
        ),
        remembers=True,
        unknown_states=(2,),
    ),
    Effect(
        id="link_elasticity",
        ports=("link",),
        physics="A link stretches under its axial force.",
        equation="delta_i = (F_i - F0_i) / k",
        symbols={
            "F_i": "axial force in link i from load and weight, N, tension positive",
            "F0_i": "the same at machine zero, N",
            "k": "stiffness of a link with its joints, N/um; 1/k is fitted",
        },
        source="Oiwa, section 1, factor (2); statics by virtual work",
        needs=("kinematics", "force"),
        parameters=(
            Parameter(
                "k",
                "N/um",
                5,
                200,
                "slender screw drive 5-30, ground ball screw and preloaded joints 200",
                reciprocal=True,
            ),
        ),
        mistaken_for=("joint_contact",),
        separated_by="loads of 20, 60 and 120 N at one place: a spring is straight, a contact is not",
        basis=KernelBasis(link.elasticity),
    ),
    Effect(
        id="joint_contact",
        ports=("link",),
        physics="Balls flatten where they touch, less and less as the force grows; a preload holds them between two "
        "seats.",
        equation="delta_i = c (x_i - x0_i); F_i = (p + x_i)^(3/2) - (p - x_i)^(3/2) while both seats touch, |x_i| < p; "
        "beyond, x_i = sgn(F_i) (|F_i|^(2/3) - p); p = P^(2/3)",
        symbols={
            "c": "contact compliance, um/N^(2/3)",
            "F_i": "axial force in link i, N, tension positive",
            "x0_i": "x_i at machine zero",
            "P": "preload of the ball, N; without one x_i = sgn(F_i) |F_i|^(2/3)",
        },
        source="Hertz (1882); Johnson, Contact Mechanics (1985), chapter 4",
        needs=("kinematics", "force"),
        parameters=(Parameter("c", "um/N^(2/3)", 0.01, 1, "steel balls of 25 mm 0.05, of 5 mm on flats 0.5"),),
        mistaken_for=("link_elasticity",),
        separated_by="loads of 20, 60 and 120 N at one place: a spring is straight, a contact is not",
        basis=KernelBasis(link.contact),
        constants=(
            Constant(
                "P",
                "N",
                0,
                2,
                "held by a magnet or a spring 0.5-2; a larger preload makes it a spring, link_elasticity",
                (0.0, 0.5, 1.0, 2.0),
                unstated=0.0,
            ),
        ),
    ),
    Effect(
        id="link_sag",
        ports=("link",),
        physics="A leaning link bows under its own weight, and a bowed link is shorter between its ends.",
        equation="delta_i = -s (1 - u_iz^2) (l_i / 500 mm)^n",
        symbols={
            "s": "shortening of a level link of 500 mm, um",
            "u_iz": "vertical component of link i's direction, 1",
            "l_i": "length of link i, mm",
            "n": "7 for a beam that bends between its joints, 3 for a slender link that tension holds, 1",
        },
        source="arc less chord, w^2 l^3 / (24 H^2) of a catenary, 17 w^2 l^7 / (40320 (E I)^2) of a beam on two "
        "supports: Young, Roark's Formulas for Stress and Strain, chapter 8",
        needs=("kinematics",),
        parameters=(Parameter("s", "um", 0, 20, "stiff tube 0, slender spindle 20"),),
        mistaken_for=("scale_gain",),
        separated_by="equally long links at different inclinations",
        basis=KernelBasis(link.sag),
        constants=(Constant("n", "1", 3, 7, "catenary 3, beam 7", (3.0, 7.0)),),
    ),
    Effect(
        id="link_zero",
        ports=("link",),
        physics="A link is longer or shorter than the drawing says, always by the same.",
        equation="delta_i = z_i",
        symbols={"z_i": "error of link i's length at machine zero, um"},
        source="Wampler, Hollerbach, Arai (1995): kinematic calibration of closed chains",
        needs=(),
        parameters=(Parameter("z", "um", -50, 50, "adjustment of machine zero", "link", tolerance="place"),),
        mistaken_for=("tool_offset",),
        separated_by="the edges of the workspace, where the links point differently than in the middle",
        basis=KernelBasis(link.zero),
    ),
)
