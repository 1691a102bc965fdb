"""Numbers at the level of a module: each that can change a verdict is a criterion; these others stand where they are
used, for a reason that `compd.diagnosis.criteria` allows."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import compd

ROOT = Path(compd.__file__).parent
PACKAGES = ("comparison", "diagnosis", "fleet", "planning", "statistics")

ROUNDING = "numerics: what rounding may do"
CONDITIONING = "numerics: conditioning of equations"
ITERATION = "numerics: step or end of an iteration that settles before"
SEED = "numerics: seed of a draw"
DEFINITION = "definition of a method or a unit, or what follows from one"
MEMORY = "memory or time"
WORDS = "words: what a sentence, a table or a picture shows"
PLAN = "form of a proposed measurement"

# Module and name -> why it is no criterion.
NUMBERS = {
    "comparison/alignment/fixed_ends.py": {
        "STEPS": ITERATION,
        "CONVERGED_MM": ITERATION,
        "PLACE_NUMBERS": DEFINITION,
        "PLANE_SHARE": CONDITIONING,
    },
    "comparison/alignment/target_place.py": {"ROUNDS": ITERATION, "_CONVERGED_MM": ITERATION},
    "comparison/alignment/registration.py": {
        "ROUNDS": ITERATION,
        "MIN_POINTS": DEFINITION,
        "MIN_SPREAD_MM": ROUNDING,
    },
    "comparison/recording_comparison.py": {"NUISANCE_ROUNDS": ITERATION},
    "comparison/comparison.py": {"MAX_TRENDS": WORDS},
    "comparison/effect_fit.py": {
        "STEPS": ITERATION,
        "ROUNDS": ITERATION,
        "CONVERGED": ITERATION,
        "MIN_RMS_UM": ROUNDING,
    },
    "comparison/noise_floor.py": {"DIFFERENCE_VARIANCE": DEFINITION},
    "comparison/nuisance.py": {"MIN_SHARE": CONDITIONING, "SCATTER_ROUNDS": ITERATION},
    "comparison/row_faults.py": {"_AGREE_SHARE": WORDS},
    "comparison/shape_search.py": {"FINE": ITERATION},
    "statistics/replicates.py": {"CHANCE_PAIRS": ROUNDING},
    "comparison/prediction_uncertainty.py": {"NOISE_SEED": SEED},
    "statistics/last_digit.py": {"PER_STEP": DEFINITION, "STEPS_UM": DEFINITION, "_HARMONICS": DEFINITION},
    "statistics/least_squares.py": {
        "RANK_CUT": CONDITIONING,
        "DIAGONAL_GUARD": CONDITIONING,
        "SHARE_OF_COMBINATION": CONDITIONING,
    },
    "statistics/periodogram.py": {
        "OVERSAMPLING": ITERATION,
        "LOBES": DEFINITION,
        "MIN_SPAN": ROUNDING,
        "REFINED": ITERATION,
        "MIN_DETERMINANT": CONDITIONING,
    },
    "statistics/robust.py": {
        "ROUNDS": ITERATION,
        "MIN_SIGMA": ROUNDING,
        "MEDIAN_OF_NORMAL": DEFINITION,
        "P95_OF_NORMAL": DEFINITION,
        "WINSORIZED": DEFINITION,
        "TRIMMED": DEFINITION,
        "WINSORIZED_MEAN_SQUARE": DEFINITION,
        "SCALE_EFFICIENCY": DEFINITION,
    },
    "comparison/open.py": {"LONG_ROWS": MEMORY},
    "comparison/sampling_error.py": {"SECONDS_PER_HOUR": DEFINITION},
    "comparison/thinning.py": {"SEED": SEED},
    "diagnosis/implausible_effect.py": {"_FREE": CONDITIONING},
    "diagnosis/candidate_result.py": {"_NAMED_SHARE": WORDS, "MAX_NAMED": WORDS, "_ALIKE": WORDS},
    "diagnosis/candidates/changes.py": {"MIN_SHARE": ROUNDING},
    "diagnosis/candidates/proxies.py": {"ZERO_DEGC_K": DEFINITION},
    "diagnosis/candidates/constant.py": {"MM_PER_UM": DEFINITION, "MIN_OUTSIDE": ROUNDING},
    "diagnosis/descriptions/empirical_terms.py": {
        "MIN_VALUES": DEFINITION,
        "UNKNOWN_RANGE": WORDS,
        "RANGE_PER_SIZE": WORDS,
    },
    "diagnosis/descriptions/search_covariates.py": {"MIN_CHANGE": ROUNDING, "MIDDLE_SHARE": WORDS},
    "diagnosis/descriptions/term_grids.py": {"TURN": DEFINITION, "ROUNDING": WORDS},
    "planning/measurement_plan.py": {"MIN_SHOWN": WORDS, "MAX_VALUES": WORDS},
    "planning/measurement_programmes.py": {
        "PLACES_PER_EDGE": PLAN,
        "LOADS": PLAN,
        "SPEEDS": PLAN,
        "ROW_EVERY_S": PLAN,
        "WORKSPACE_QUANTILES": PLAN,
    },
    "planning/measurement_settings.py": {
        "MAX_STEPS": PLAN,
        "DIRECTIONS": PLAN,
        "MAX_COMBINATIONS": PLAN,
        "MIN_LEVELS": PLAN,
        "MAX_LEVELS": PLAN,
        "TIED": PLAN,
        "DIGITS_OF_RANGE": PLAN,
    },
    "planning/plan_formats.py": {"DWELL_S": PLAN, "_NAME_DIGITS": WORDS},
    "planning/programme_rows.py": {"WAITS": PLAN, "STEP_S": PLAN, "REVERSALS_MM": PLAN},
    "planning/setting_programmes.py": {"WATCHED_S": PLAN, "PROBED_ROWS": PLAN},
    "planning/t_optimal.py": {"RIDGE": CONDITIONING, "MIN_RIDGE": CONDITIONING},
    "planning/tip_ways.py": {"TRAVEL_MM": PLAN, "MAX_MM": PLAN, "STEADY_S": PLAN, "_STEP_MM": ITERATION},
    "diagnosis/proposed_measurement.py": {"MAX_COVARIATES": WORDS},
    "diagnosis/search/empirical_search.py": {"BATCH": MEMORY},
    "diagnosis/search/gross_rows.py": {"ROUNDS": ITERATION},
    "diagnosis/search/place_significance.py": {"RANK_CUT": ROUNDING},
    "diagnosis/search/regression.py": {"MIN_RIDGE": CONDITIONING, "BATCH": MEMORY},
    "diagnosis/search/significance.py": {"SEED": SEED, "ROUNDING": ROUNDING},
    "diagnosis/search/subset_losses.py": {"MIN_LOSS": ROUNDING},
    "diagnosis/unmodelled.py": {"RANK_CUT": CONDITIONING},
    "diagnosis/left_interval.py": {"MIN_FOLDS": DEFINITION},
    "diagnosis/search/better_sets.py": {"LEAST": ROUNDING},
    "diagnosis/verdict.py": {"VERDICT_VERSION": WORDS},
    "diagnosis/words/phrases.py": {
        "MAX_VALUES": WORDS,
        "MAX_RIVALS": WORDS,
        "MAX_ROWS": WORDS,
        "MAX_DOUBTS": WORDS,
        "CANCELLING": WORDS,
        "MIN_PLACES": WORDS,
        "SURE_SIGMAS": WORDS,
        "OTHERS_SHARE": WORDS,
        "LEAST": WORDS,
    },
    "diagnosis/words/summary_lines.py": {
        "MAX_LINES": WORDS,
        "WIDTH": WORDS,
        "MAX_NAMED": WORDS,
        "DOUBTFUL": WORDS,
        "MAX_FAULTS": WORDS,
        "CROWDED": WORDS,
        "WITH_LIMITS": WORDS,
        "CONTRADICTED": WORDS,
    },
    "fleet/checkpoint.py": {"WRITE_EVERY_S": MEMORY},
    "fleet/cluster.py": {"CONNECT_S": MEMORY},
    "fleet/drift.py": {"_SECONDS_PER_DAY": DEFINITION},
    "fleet/effect_matrix.py": {
        "ROW_PX": WORDS,
        "_DRIFTS": WORDS,
        "_DIFFERS": WORDS,
        "_UNEXPLAINED": WORDS,
        "_MOST": WORDS,
        "_PALE": WORDS,
    },
    "fleet/engine.py": {"MAX_WITHOUT_WORKERS_S": MEMORY, "_MIN_BATCHES": MEMORY, "LOOK_EVERY_S": MEMORY},
    "fleet/machine_examination.py": {"MAX_KEPT": MEMORY},
    "fleet/examine.py": {"BATCH": MEMORY},
    "fleet/fleet_figures.py": {"MAX_PANELS": WORDS, "PANEL_PX": WORDS},
    "fleet/outlying.py": {"_SIGMA_OF_MAD": DEFINITION, "_OF_MEDIAN": DEFINITION},
    "fleet/recordings.py": {"_HEADER_BYTES": MEMORY},
}

# Inside functions these count, halve, square, index axes and convert units, or guard against a division by nought.
PLAIN = {-1, 0, 0.5, 1, 2, 3, 100, 1000}
GUARDS = {1e9, 1e-3, 1e-6, 1e-9, 1e-12, 1e-300}
# Anything else needs a name, and so a place above or among the criteria; but for the following.
IN_FUNCTIONS = {
    "comparison/alignment/aligned_recording.py": {3600: DEFINITION},
    "comparison/alignment/measured_attitude.py": {6: "columns of a rigid motion"},
    "comparison/comparison.py": {0.95: "P95, a quantile that is reported"},
    "comparison/covariate.py": {3600: DEFINITION},
    "statistics/covariance.py": {0.95: DEFINITION},
    "statistics/robust.py": {0.95: DEFINITION},
    "diagnosis/candidates/constant.py": {4: "axes of an attitude", 5: "axes of an attitude", 6: "axes of a motion"},
    "diagnosis/descriptions/search_covariates.py": {17: "digits of a double"},
    "planning/measurement_plan.py": {10: WORDS},
    "planning/measurement_programmes.py": {4: PLAN, 9: "numbers of the frame"},
    "planning/measurement_settings.py": {10: "decimals"},
}
PICTURES = ("fleet/effect_matrix.py", "fleet/fleet_figures.py")


def is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool)


def module_numbers(tree: ast.Module) -> set[str]:
    """Names that a module gives to a value with a number in it."""
    found: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(map(is_number, ast.walk(node.value))):
                found |= {part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)}
    return found


def magic_numbers(tree: ast.Module) -> set[float]:
    """Numbers inside functions that are neither plain nor a guard."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    numbers = {part.value for node in functions for part in ast.walk(node) if is_number(part)}  # type: ignore[attr-defined]
    return numbers - PLAIN - GUARDS


MODULES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_number_is_a_criterion_or_has_a_reason(path: Path) -> None:
    tree, module = ast.parse(path.read_text(encoding="utf-8")), str(path.relative_to(ROOT))
    allowed = set(NUMBERS.get(module, {}))
    assert module_numbers(tree) == allowed, "a number that can change a verdict belongs in the criteria"
    if module not in PICTURES:
        assert magic_numbers(tree) == set(IN_FUNCTIONS.get(module, {})), "give it a name"


def test_every_listed_module_is_there() -> None:
    assert {*NUMBERS, *IN_FUNCTIONS, *PICTURES} <= {str(path.relative_to(ROOT)) for path in MODULES}


def test_a_new_number_is_found() -> None:
    tree = ast.parse("LIMIT = 0.25\nLOW, HIGH = 1, 2.5\nNAME = 'x'\ndef f(x):\n    return x > 7.5 or x < 1e-9\n")
    assert module_numbers(tree) == {"LIMIT", "LOW", "HIGH"}
    assert magic_numbers(tree) == {7.5}
