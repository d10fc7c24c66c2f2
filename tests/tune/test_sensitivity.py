"""Sensitivities against differences and closed forms, the cost of tolerances, and robust tunings."""

import json
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, bench, dampers, identify, parameters, plots, roads, tune, vehicles
from jaxdamp.metrics import Metric
from jaxdamp.tune import robust_tuning
from jaxdamp.tune.sensitivities import ForceHats, sensitivity, with_hats


METRICS = ["rms_sprung_acceleration", "rms_dynamic_tyre_load"]
BUMP = roads.cosine_bump(0.05, start=0.02, duration=0.15)
CAR = vehicles.presets.quarter_car_000(dampers.Bilinear(2600.0, 1400.0, knee_width=0.02))
WHITE, LINEAR = roads.white("C", 20.0), vehicles.presets.quarter_car_000()
RUN: dict[str, Any] = {"duration": 0.4, "dt": 2e-3}
BEST = 60e3 * np.sqrt(1325.0 / 220e3)


def _central(function, at: float, step: float) -> np.ndarray:
    far, near = (np.asarray(function(at + s) - function(at - s)) / (2 * s) for s in (2 * step, step))
    return (4 * near - far) / 3


@pytest.fixture(scope="module")
def found() -> tune.Sensitivity:
    road = lambda speed: roads.cosine_bump(0.05, start=0.02, length=3.0, speed=speed)  # noqa: E731
    return tune.sensitivity(METRICS, CAR, road, quantities={"speed": 20.0}, reach=0.6, hats=3, **RUN)


@pytest.fixture(scope="module")
def plain() -> tune.Sensitivity:
    """Of a linear car on a white road, with second derivatives and without curves."""
    return tune.sensitivity(METRICS[0], LINEAR, WHITE, over=["rate"], second_order=True)


def test_derivatives_by_parameters_and_speed_agree_with_differences(found) -> None:
    ride = Ride(CAR, BUMP, metrics=METRICS, **RUN)
    centre = {p: jnp.asarray(x) for p, x in zip(found.parameters, found.point, strict=True) if p != "speed"}

    def at(values: dict[str, Any]) -> np.ndarray:
        speed = values.pop("speed", None)
        if speed is None:
            run = ride
        else:
            run = Ride(CAR, roads.cosine_bump(0.05, start=0.02, length=3.0, speed=float(speed)), metrics=METRICS, **RUN)
        metrics = run({**centre, **values})
        return np.array([metrics[name] for name in METRICS])

    assert [found.values[name] for name in METRICS] == pytest.approx(at({}), rel=1e-9)
    for i, (parameter, value) in enumerate(zip(found.parameters, found.point, strict=True)):
        if value:
            slopes = _central(lambda x, p=parameter: at({p: jnp.asarray(x)}), value, 1e-3 * value)
            within = 2e-3 if parameter == "speed" else 2e-5
            assert [found.gradient[name][i] for name in METRICS] == pytest.approx(slopes, rel=within), parameter
    assert set(found.parameters) == {p.path for p in parameters.parameters(CAR)} | {"speed"}


def test_derivatives_by_the_curve_agree_with_differences(found) -> None:
    hatted = with_hats(CAR, "damper", 0.6, 3)
    ride = Ride(hatted, BUMP, metrics=METRICS, **RUN)
    curve = found.curves["damper"]
    np.testing.assert_allclose(curve.velocity, [-0.6, -0.4, -0.2, 0.2, 0.4, 0.6])
    for i in (2, 3):
        run = lambda force, i=i: ride({"damper.terms.1.forces": jnp.zeros(6).at[i].set(force)})[METRICS[0]]  # noqa: E731
        assert curve.gradient[METRICS[0]][i] == pytest.approx(_central(run, 0.0, 2.0), rel=1e-5)


@pytest.mark.slow
def test_a_line_through_the_hats_is_a_damping_rate() -> None:
    """Hats whose forces are their velocities add a rate of one: their derivatives add up to that by the rate."""
    found = tune.sensitivity(METRICS[0], LINEAR, BUMP, over=["rate"], reach=2.0, hats=2, **RUN)
    curve = found.curves["damper"]
    along = float(np.sum(curve.gradient[METRICS[0]] * curve.velocity))
    assert along == pytest.approx(float(found.gradient[METRICS[0]][0]), rel=1e-9)
    law = ForceHats(0.1, np.array([-3.0, -1.0, 2.0, 4.0]))
    forces = [float(law.force_velocity(v)) for v in (-0.5, -0.15, -0.05, 0.0, 0.1, 0.15, 0.3)]
    np.testing.assert_allclose(forces, [-3.0, -2.0, -0.5, 0.0, 2.0, 3.0, 4.0], atol=1e-12)


def test_second_derivatives_say_how_flat_an_optimum_is(plain) -> None:
    """Closed form: the variance is a/c + b c, so that the RMS rises by 1 % where (r + 1/r)/2 = 1.01²."""
    best = vehicles.presets.quarter_car_000(dampers.Linear(BEST))
    found = tune.sensitivity(METRICS[0], best, WHITE, over=["rate"], second_order=True)
    assert found.elasticities(METRICS[0])["damper.rate"] == pytest.approx(0.0, abs=1e-9)
    assert found.hessian is not None
    scaled = found.hessian[METRICS[0]][0, 0] * BEST**2 / found.values[METRICS[0]]
    assert scaled == pytest.approx(0.5, rel=1e-6)
    (sentence,) = found.flatness(METRICS[0])
    assert sentence == "rms_sprung_acceleration rises by 1 % at ±20 % along +1.00 damper.rate."
    assert "has a slope here, 0.28 % for 1 %" in plain.flatness(METRICS[0])[0]


def test_a_negative_value_rises_and_falls_as_a_positive_one(plain) -> None:
    """A metric less a constant has its derivatives, and its minimum."""

    def below(values: Mapping[str, jax.Array]) -> jax.Array:
        return values[METRICS[0]] - 3.0

    found = tune.sensitivity(below, LINEAR, WHITE, over=["rate"], metrics=METRICS[:1], second_order=True)
    share = plain.values[METRICS[0]] / abs(found.values["below"])
    assert found.values["below"] < 0.0
    assert found.elasticities("below")["damper.rate"] == pytest.approx(
        share * plain.elasticities(METRICS[0])["damper.rate"]
    )
    best = tune.sensitivity(
        below,
        vehicles.presets.quarter_car_000(dampers.Linear(BEST)),
        WHITE,
        over=["rate"],
        metrics=METRICS[:1],
        second_order=True,
    )
    assert best.flatness("below")[0].startswith("below rises by 1 % at ±")
    (effect,) = tune.tolerance_effects(below, LINEAR, WHITE, {"damper.rate": 0.05}, metrics=METRICS[:1])
    assert effect.mean > 0.0 and "costs" in effect.sentence("below")


@pytest.mark.slow
def test_the_value_in_the_worst_scenario_is_the_true_one() -> None:
    """Of two equal scenarios, value and derivatives are those of one."""
    both = tune.Scenarios([WHITE, WHITE], risk="worst")
    found, alone = (tune.sensitivity(METRICS[0], LINEAR, road, over=["rate"], dampers=None) for road in (both, WHITE))
    assert found.values[METRICS[0]] == pytest.approx(alone.values[METRICS[0]], rel=1e-9)
    assert found.gradient[METRICS[0]][0] == pytest.approx(alone.gradient[METRICS[0]][0], rel=1e-9)


def test_results_show_themselves(found) -> None:
    rows = found.table().records()
    assert rows[0]["parameter"] == "sprung_mass" and rows[-1][METRICS[0]] is None  # tyre damping is zero
    assert found.curve_table().columns[2].name == METRICS[0]
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["curves"]["damper"]["velocity"][0] == pytest.approx(-0.6) and data["elasticities"]
    figure = plots.sensitivity(found)
    assert figure.axes[0].get_title(loc="left") == "damper: body acceleration, RMS"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"metric": "rms_acceleration"}, "did you mean|Did you mean"),
        ({"metric": []}, "`metric` must be metrics by name"),
        ({"over": ["rat"]}, "did you mean 'rate'"),
        ({"dampers": "rear.*"}, r"`dampers` must name a law of the vehicle \(damper\)"),
        ({"metric": "lift_off_fraction"}, "must have a slope"),
    ],
)
def test_wrong_uses_are_refused(change, message) -> None:
    arguments = {"metric": METRICS[0], "vehicle": LINEAR, "road": BUMP} | RUN | change
    with pytest.raises(ValueError, match=message):
        sensitivity(**arguments)


def test_what_was_not_computed_is_refused(found, plain) -> None:
    with pytest.raises(ValueError, match="have second derivatives"):
        found.flatness(METRICS[0])
    with pytest.raises(ValueError, match="must have curves"):
        plain.curve_table()


def test_tolerances_cost_what_a_sample_says() -> None:
    scatter = 0.05
    (effect,) = tune.tolerance_effects(METRICS[0], LINEAR, WHITE, {"damper.rate": scatter})
    normal = np.random.default_rng(0).normal(size=200_000)
    rates = 2500.0 * (1.0 + scatter * normal)
    acceleration = np.sqrt(BEST / rates + rates / BEST)  # up to a factor
    nominal = np.sqrt(BEST / 2500.0 + 2500.0 / BEST)
    assert effect.mean == pytest.approx(acceleration.mean() / nominal - 1.0, rel=0.15)
    assert effect.deviation == pytest.approx(acceleration.std() / nominal, rel=0.02)
    assert effect.sentence("comfort").startswith("A 5 % scatter of damper.rate costs 0.08")


@pytest.mark.exhaustive
def test_the_cost_of_scatter_is_said_of_every_objective_of_a_tuning() -> None:
    """Short names, and functions of further metrics."""
    scenarios = tune.Scenarios([roads.white("C", 20.0)])
    weighted = Metric("sprung_acceleration", "rms", "Wd")
    by_name = tune.robust("comfort", LINEAR, scenarios, scatter={"damper.rate": 0.1})
    named = tune.robust("weighted_rms_sprung_acceleration", LINEAR, scenarios, scatter={"damper.rate": 0.1})
    assert by_name.tolerances == named.tolerances
    further = tune.robust(
        lambda m: m[weighted.name], LINEAR, scenarios, metrics=[weighted], scatter={"damper.rate": 0.1}
    )
    assert further.tolerances[0].deviation > 0.0 and further.tolerances != named.tolerances


def test_unknown_scatter_is_refused_before_the_search(monkeypatch) -> None:
    monkeypatch.setattr(robust_tuning, "minimise", None)
    with pytest.raises(ValueError, match="No parameter is named 'rat': did you mean 'rate'"):
        tune.robust("comfort", LINEAR, tune.Scenarios([roads.white("C", 20.0)]), scatter={"rat": 0.1})


@pytest.mark.slow
def test_a_robust_tuning_meets_the_worst_case_better() -> None:
    """Two payloads want different rates; the tuning for the worst case has the smaller largest value."""
    loads = {"empty": tune.Condition(), "laden": tune.Condition({"sprung_mass": 1800.0})}
    scenarios = tune.Scenarios([WHITE], loads)
    results = [
        tune.robust("rms_dynamic_tyre_load", LINEAR, scenarios, risk=risk, scatter={"rate": 0.1})
        for risk in ("mean", "worst")
    ]
    largest = [max(each.after["rms_dynamic_tyre_load"]) for r in results if (each := r.scenarios)]
    assert largest[1] <= largest[0] * (1 + 1e-9)
    assert "Largest in 'road 1, laden'" in results[1].summary
    assert results[1].sentences[0].startswith("A 10 % scatter of damper.rate costs")
    assert json.dumps(results[1].to_dict(), allow_nan=False) and results[1].tolerance_table().rows


@pytest.mark.slow
def test_the_gradient_passes_from_bench_samples_through_a_fit_to_a_metric() -> None:
    """Least squares of a bilinear law to forces, put into a car on a bump: against differences of the forces."""
    velocity = jnp.linspace(-0.5, 0.5, 21)
    force = jnp.where(velocity > 0, 2600.0, 1400.0) * velocity
    shape = jnp.sin(7.0 * velocity)
    ride = Ride(CAR, BUMP, metrics=METRICS[:1], **RUN)

    def metric(size):
        noisy = force + size * shape
        rates = [
            jnp.sum(jnp.where(side, velocity * noisy, 0.0)) / jnp.sum(jnp.where(side, velocity**2, 0.0))
            for side in (velocity > 0, velocity < 0)
        ]
        return ride({"rebound_rate": rates[0], "compression_rate": rates[1]})[METRICS[0]]

    slope = float(jax.grad(metric)(jnp.asarray(20.0)))
    assert slope == pytest.approx(_central(metric, 20.0, 5.0), rel=1e-6)
    run = bench.VirtualDyno(dampers.Bilinear(2600.0, 1400.0), sampling_rate=200.0).run([bench.SineTest(0.01, 4.0)])
    law = identify.fit(dampers.Bilinear, run).law
    assert float(parameters.get(law, "rebound_rate")) == pytest.approx(2600.0, rel=1e-3)
