"""Wrong uses are refused before anything is compiled: with the argument, its value, and what to write instead."""

from typing import Any

import jaxtyping
import numpy as np
import pytest

from jaxdamp import dampers, roads, tune as typed_tune, vehicles


COMFORT, TYRE = "rms_sprung_acceleration", "rms_dynamic_tyre_load"
WHITE, BUMP = roads.white("C", 20.0), roads.cosine_bump(0.05, start=0.1, duration=0.2)
CAR, LINEAR, QUARTER = vehicles.presets.quarter_car_000(), dampers.Linear, vehicles.presets.quarter_car_000
RUN: dict[str, Any] = {"duration": 0.3, "dt": 2e-3}
PAIR = {"A": LINEAR(2000.0), "B": LINEAR(3000.0)}
tune: Any = typed_tune  # what type checkers would refuse


def minimise(**change: Any) -> Any:
    return tune.minimise(**{"metric": COMFORT, "vehicle": CAR, "road": WHITE} | change)


def pareto(**change: Any) -> Any:
    return tune.pareto(**{"objectives": [COMFORT, TYRE], "vehicle": CAR, "road": WHITE} | change)


def sensitivity(**change: Any) -> Any:
    return tune.sensitivity(**{"metric": COMFORT, "vehicle": CAR, "road": WHITE} | change)


def compare(**change: Any) -> Any:
    return tune.compare_dampers(**{"dampers": PAIR, "vehicle": QUARTER, "roads": WHITE} | change)


def tuned() -> Any:
    return tune.minimise(TYRE, CAR, WHITE, max_steps=1)


def white(speed: float) -> Any:
    return roads.white("C", speed)


# the call, the argument at fault, its value, and a part of the remedy
CASES = [
    (lambda: minimise(metric=None), "metric", "None", "The call is"),
    (lambda: minimise(vehicle=WHITE), "vehicle", "a WhiteRoad", "quarter_car_000"),
    (lambda: minimise(road=[WHITE, WHITE]), "road", "a list of 2", "roads.iso8608"),
    (lambda: minimise(limits=[(TYRE, 1.0)]), "limits", "a list of 1", "Write `{'working_space"),
    (lambda: minimise(limits={TYRE: "1"}), f"limits['{TYRE}']", "'1'", "Write 0.1"),
    (lambda: minimise(limits={TYRE: (None, None)}), f"limits['{TYRE}']", "(None, None)", "None for an end"),
    (lambda: minimise(limits={TYRE: (2.0, 1.0)}), f"limits['{TYRE}']", "(2.0, 1.0)", "Write (-0.08, 0.1)"),
    (lambda: minimise(limits={"rms_tyre_load": 1.0}), "limits", "'rms_tyre_load'", "Did you mean"),
    (lambda: minimise(bounds=[(1.0, 2.0)]), "bounds", "a list of 1", "Write `{'damper.rate'"),
    (lambda: minimise(shape=3), "shape", "the number 3", "tune.monotone()"),
    (lambda: minimise(max_steps=2.5), "max_steps", "2.5", "Write `max_steps=1`"),
    (lambda: minimise(starts=2, seed="x"), "seed", "'x'", "Write `seed=1`"),
    (lambda: minimise(road=WHITE, duration=5.0), "duration", "5.0", "Leave it out"),
    (lambda: minimise(metric=tune.Targets({"rms_comfort": (1.0, 0.1)})), "targets", "'rms_comfort'", "one of 'rms_"),
    (lambda: pareto(objectives=COMFORT), "objectives", f"the text '{COMFORT}'", "pareto([metric, metric]"),
    (lambda: pareto(objectives=[COMFORT, 3]), "objectives[1]", "the number 3", "The call is"),
    (lambda: pareto(objectives=[COMFORT, "rms_dynamic_load"]), "objectives", "'rms_dynamic_load'", "Did you mean"),
    (
        lambda: pareto(objectives=[COMFORT, "lift_off_fraction"], road=BUMP, **RUN),
        "objectives",
        "'lift_off_fraction', a count",
        "dynamic load coefficient",
    ),
    (lambda: pareto(points=5.5), "points", "5.5", "Write `points=1`"),
    (lambda: pareto(reference=[1.0, 2.0]), "reference", "a list of 2", f"Write `{{'{COMFORT}': 1.5}}`"),
    (lambda: pareto(reference={COMFORT: "a"}), f"reference['{COMFORT}']", "the text 'a'", "be a number"),
    (lambda: pareto(limits={TYRE: 1e3, "grip": 2e3}), "limits", f"'{TYRE}' and 'grip', which both limit", "the names"),
    (lambda: pareto(limits={TYRE: np.nan}), f"limits['{TYRE}']", "nan", "Write (-0.08, 0.1)"),
    (lambda: sensitivity(metric=[]), "metric", "a list of 0", "The call is"),
    (lambda: sensitivity(road=3), "road", "the number 3", "roads.iso8608"),
    (lambda: sensitivity(quantities={"speed": 20.0}), "road", "a WhiteRoad", "Write `lambda speed"),
    (lambda: sensitivity(road=white, quantities={"v": 20.0}), "quantities", "v: missing", "Write `lambda speed"),
    (lambda: sensitivity(road=white, quantities={"speed": np.nan}), "quantities", "[nan]", "quantities={'speed'"),
    (lambda: sensitivity(road=BUMP, hats=0, **RUN), "hats", "0", "are usual"),
    (lambda: sensitivity(road=BUMP, reach=-1.0, **RUN), "reach", "-1.0", "0.6 m/s"),
    (lambda: sensitivity(road=BUMP, dampers="rear", **RUN), "dampers", "'rear'", "None for none"),
    (lambda: tune.robust(COMFORT, CAR, WHITE), "scenarios", "a WhiteRoad", "tune.Scenarios"),
    (lambda: tune.robust(COMFORT, CAR, tune.Scenarios([WHITE]), risk="wurst"), "risk", "'wurst'", "Did you mean"),
    (
        lambda: tune.robust(COMFORT, CAR, tune.Scenarios([WHITE]), scatter={"rate": -1.0}),
        "scatter['rate']",
        "-1.0",
        "standard deviation of 5 %",
    ),
    (lambda: tune.tolerance_effects(COMFORT, CAR, WHITE, {}), "scatter", "a dict of 0", "Write `{'damper"),
    (lambda: tune.tolerance_effects([COMFORT, TYRE], CAR, WHITE, {"rate": 0.1}), "metric", "a list", "once"),
    (lambda: tune.Scenarios(WHITE), "roads", "a WhiteRoad", "Write `[...]`"),
    (lambda: tune.Scenarios([WHITE], weights=[1.0, 2.0]), "weights", "[1.0, 2.0]", "Leave it out"),
    (lambda: tune.Scenarios([WHITE], [{"rate": 1.0}]), "conditions['condition 1']", "a dict", "tune.Cond"),
    (lambda: tune.Scenarios([WHITE], risk=3), "risk", "the number 3", "Write `risk='worst'`"),
    (lambda: tune.Targets([COMFORT]), "targets", "a list of 1", "Write `{'rms_"),
    (lambda: tune.Targets({COMFORT: ("a", "b")}), f"targets['{COMFORT}']", "('a', 'b')", "Write (1.2"),
    (lambda: tune.valving(LINEAR(1.0), LINEAR(1.0)), "start", "a Linear", "valving(target, start)"),
    (lambda: tune.valving(3.0, dampers.MonoTube.reference()), "target", "the number 3.0", "bench.read"),
    (lambda: tune.valving([LINEAR(1.0)], dampers.MonoTube.reference()), "target[0]", "a Linear", "bench.read"),
    (lambda: tune.valving([], dampers.MonoTube.reference()), "target", "a list of 0", "bench.read"),
    (lambda: tune.rescore(3.0, [BUMP]), "result", "the number 3.0", "rescore(result, [road, road])"),
    (lambda: tune.rescore(tuned(), BUMP), "roads", "a Bump", "rescore(result, [road, road])"),
    (lambda: tune.rescore(tuned(), [3]), "roads[0]", "the number 3", "roads.iso8608"),
    (lambda: compare(dampers={"A": LINEAR(1.0)}), "dampers", "a dict of 1", "The call is"),
    (lambda: compare(dampers=PAIR | {"B": 3.0}), "dampers['B']", "the number 3.0", "dampers.Linear"),
    (lambda: compare(vehicle=CAR), "vehicle", "a QuarterCar", "Write `lambda law"),
    (lambda: compare(roads=[BUMP]), "roads", "a list of 1", "several seeds"),
    (lambda: compare(roads=[BUMP, BUMP]), "roads[1]", "roads[0] again", "several seeds"),
    (lambda: compare(roads=[WHITE, WHITE]), "roads[0]", "a WhiteRoad", "roads.iso8608"),
    (lambda: tune.hypervolume(np.zeros((2, 2)), np.zeros(3)), "reference", "(3,)", "front.reference"),
    (lambda: tune.hypervolume(np.zeros((2, 2)), {"a": 1.0, "b": 2.0}), "reference", "a mapping", "front.names"),
    (lambda: tune.hypervolume(np.zeros((2, 2)), [np.nan, 2.0]), "reference", "[nan, 2.0]", "front.names"),
    (lambda: tune.rescore(tuned(), [BUMP, BUMP]), "roads[1]", "roads[0] again", "several seeds"),
    (lambda: tune.rescore(tuned(), [WHITE]), "roads[0]", "a WhiteRoad", "roads.iso8608"),
    (lambda: tune.CVaR("10%"), "share", "10%", ""),  # pyright: ignore
    (lambda: tune.tolerances({"rate": 0.1}, 2.5), "count", "the number 2.5", ""),  # pyright: ignore
    (lambda: tune.tolerances({"rate": "10%"}, 2), "scatter['rate']", "'10%'", ""),  # pyright: ignore
    (lambda: tune.tolerance_effects(COMFORT, CAR, WHITE, {"rate": 10.0}), "scatter['rate']", "10.0", "0.05 is"),
    (
        lambda: tune.Scenarios([WHITE], [tune.Condition(weight="1")]),  # pyright: ignore
        "conditions['condition 1'].weight",
        "the text '1'",
        "",
    ),
]


@pytest.fixture(autouse=True)
def _as_users_call():
    """Without the run-time type checks of the tests, which users do not have."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.mark.parametrize(
    ("call", "argument", "value", "remedy"), CASES, ids=[f"{i} {c[1]}" for i, c in enumerate(CASES)]
)
def test_the_message_names_argument_value_and_remedy(call, argument, value, remedy):
    with pytest.raises(ValueError) as caught:
        call()
    text = str(caught.value)
    assert (
        text.startswith(f"Argument `{argument}` must ") and value in text.partition(", but is ")[2] and remedy in text
    )
