import dataclasses
import json
from typing import Any, NamedTuple

import jax
import numpy as np
import pytest

from jaxdamp import Ride, dampers, parameters, roads, tune, vehicles
from jaxdamp.dampers import FittedRange, with_fitted_range
from jaxdamp.tune.decisions import _check, _effects


COMFORT, TYRE = "rms_sprung_acceleration", "rms_dynamic_tyre_load"
WHITE = roads.white("C", speed=20.0)
quarter_car = vehicles.presets.quarter_car_000


class Estimate(NamedTuple):
    """What a comparison reads of an estimate."""

    name: str
    tied: tuple[str, ...]


def estimate(name, *tied):
    return Estimate(name, tied)


@dataclasses.dataclass
class Fitted:
    """What a comparison reads of a fit."""

    law: dampers.AbstractDamper
    parameters: list[Estimate]
    covariance: np.ndarray


def fitted(law, names, covariance):
    return Fitted(law, [estimate(n) for n in names], np.array(covariance))


def rate_with_error(rate, error):
    return fitted(dampers.Linear(rate), ["rate"], [[error**2]])


def comfort(rate):
    """The RMS acceleration on the white road, in closed form."""
    k, kt, ms, m = 60e3, 220e3, 1200.0, 1325.0
    return np.sqrt(2 * np.pi**2 * 256e-6 * 0.01 * 20.0 * 0.5 * (kt * rate / ms**2 + m * k**2 / (rate * ms**2)))


def test_parameter_error_is_that_of_the_closed_form():
    found = tune.compare_dampers(
        {"A": rate_with_error(2500.0, 50.0), "B": rate_with_error(3500.0, 80.0)}, quarter_car, WHITE, metrics=[COMFORT]
    )
    step = 1e-3
    a, b = comfort(2500.0), comfort(3500.0)
    slope_a, slope_b = ((comfort(c + step) - comfort(c - step)) / (2 * step) for c in (2500.0, 3500.0))
    d = found.difference(COMFORT)
    assert d.change == pytest.approx(100 * (b / a - 1), rel=1e-8)
    assert found.parameter_errors["A"][COMFORT] == pytest.approx(50.0 * abs(slope_a), rel=1e-6)
    assert d.from_parameters == pytest.approx(100 * np.hypot(80.0 * slope_b / a, 50.0 * b * slope_a / a**2), rel=1e-6)
    assert d.from_roads == 0.0 and d.margin == pytest.approx(1.959964 * d.from_parameters, rel=1e-6)
    assert d.significant and "B has 6.8 ± 1.2 % less" in d.sentence and "less rms_sprung_acceleration" in found.summary


@pytest.fixture(scope="module")
def on_roads():
    """Two dampers on eight short roads, one of them fitted."""
    law = dampers.Bilinear(2600.0, 1400.0)
    covariance = [[120.0**2, -0.5 * 120.0 * 90.0], [-0.5 * 120.0 * 90.0, 90.0**2]]
    laws = {"A": dampers.Bilinear(2500.0, 1500.0), "B": fitted(law, ["rebound_rate", "compression_rate"], covariance)}
    listed = [roads.iso8608("C", speed=20.0, seed=seed) for seed in range(8)]
    return laws, listed, tune.compare_dampers(laws, quarter_car, listed, metrics=[COMFORT, TYRE], duration=2.0, dt=2e-3)


@pytest.mark.slow
def test_roads_are_sampled_once_for_all_dampers(monkeypatch):
    phases = []

    def counted(vehicle, road, *more):
        phases.append(float(road.phase[0]))
        return sampled(vehicle, road, *more)

    from jaxdamp.simulation import ride

    sampled = ride.sampled
    monkeypatch.setattr(ride, "sampled", counted)
    listed = [roads.iso8608("C", speed=20.0, seed=seed) for seed in range(3)]
    laws = {"A": dampers.Linear(2000.0), "B": dampers.Linear(3000.0), "C": dampers.Linear(4000.0)}
    compared = tune.compare_dampers(laws, quarter_car, listed, metrics=[COMFORT], duration=0.2, dt=2e-3)
    first, *others = (float(road.phase[0]) for road in listed)
    assert phases == [first, *others, first, first]  # the first one with each damper, to check the step
    alone = Ride(quarter_car(laws["C"]), listed[2], metrics=[COMFORT], duration=0.2, dt=2e-3)()
    assert compared.values["C"][COMFORT][2] == pytest.approx(float(alone[COMFORT]), rel=1e-9)


def test_values_are_those_of_rides_and_common_roads_cancel(on_roads):
    laws, listed, found = on_roads
    ride = Ride(quarter_car(laws["A"]), listed[3], metrics=[COMFORT, TYRE], duration=2.0, dt=2e-3)
    assert found.values["A"][COMFORT][3] == pytest.approx(float(ride()[COMFORT]), rel=1e-9)
    d = found.difference(COMFORT, "B")
    alone = 100 * found.road_errors["A"][COMFORT] / found.values["A"][COMFORT].mean()
    assert d.from_roads < 0.2 * alone
    assert d.margin > 1.96 * np.hypot(d.from_roads, d.from_parameters)  # Student's t of seven degrees of freedom
    assert found.parameter_errors["A"][COMFORT] == 0.0 and found.parameter_errors["B"][COMFORT] > 0.0


@pytest.mark.parametrize("white", [True, False])
def test_laws_beyond_their_records_are_warned_of(white):
    slow = with_fitted_range(dampers.Linear(2500.0), FittedRange(velocity=(-0.05, 0.05)))
    on = WHITE if white else [roads.iso8608("C", 20.0, 30.0, seed=seed) for seed in (1, 2)]
    run: Any = {} if white else {"duration": 0.5, "dt": 2e-3}
    laws = {"A": slow, "B": dampers.Linear(3000.0)}
    (warning,) = tune.compare_dampers(laws, quarter_car, on, metrics=[COMFORT], **run).warnings
    assert warning.startswith("A: On the first road") and "fitted to −0.05 to 0.05 m/s" in warning


def test_table_dictionary_and_picture(on_roads):
    found = on_roads[2]
    rows = found.table().records()
    assert len(rows) == 4 and rows[1]["change"] == found.difference(COMFORT).change
    assert json.loads(json.dumps(found.to_dict()))["differences"][1]["metric"] == TYRE
    figure = found.plot()
    assert [tick.get_text() for tick in figure.axes[0].get_yticklabels()] == [
        "body acceleration, RMS",
        "tyre load variation, RMS",
    ]


@pytest.mark.slow
def test_both_errors_agree_with_monte_carlo(on_roads):
    laws, listed, found = on_roads
    ride = Ride(quarter_car(laws["A"]), listed[0], metrics=[COMFORT], duration=2.0, dt=2e-3)
    many = [
        Ride(ride.vehicle, roads.iso8608("C", speed=20.0, seed=s), metrics=[COMFORT], duration=2.0, dt=2e-3)
        for s in range(256)
    ]
    heights = np.stack([np.asarray(one.heights) for one in many])

    @jax.jit
    def at(rates, heights):
        def one(heights, rates):
            import equinox as eqx

            car = parameters.replace(
                ride.vehicle, {"damper.rebound_rate": rates[0], "damper.compression_rate": rates[1]}
            )
            return eqx.tree_at(lambda r: r.heights, ride.side_by_side().of_vehicle(car), heights)()[COMFORT]

        return jax.vmap(one, in_axes=(0, None))(heights, rates)

    first, other = (np.asarray(at(np.array(rates), heights)) for rates in ((2500.0, 1500.0), (2600.0, 1400.0)))
    draws = np.random.default_rng(0).multivariate_normal([2600.0, 1400.0], laws["B"].covariance, 150)
    changes = [100 * (np.mean(at(draw, heights[:8])) / first[:8].mean() - 1) for draw in draws]
    assert found.difference(COMFORT).from_parameters == pytest.approx(np.std(changes), rel=0.2)
    groups = 100 * (other.reshape(32, 8).mean(axis=1) / first.reshape(32, 8).mean(axis=1) - 1)
    fake = {name: first if name == "A" else other for name in "AB"}
    ratio = fake["B"].mean() / fake["A"].mean()
    spread = 100 * np.std(fake["B"] - ratio * fake["A"], ddof=1) / fake["A"].mean() / np.sqrt(8)
    assert spread == pytest.approx(np.std(groups, ddof=1), rel=0.3)
    assert 0.4 * spread < found.difference(COMFORT).from_roads < 2.0 * spread  # from eight roads alone


def test_estimates_find_their_numbers_in_the_law():
    names = ["a", "b[0]", "b[1]", "c"]
    effects = _effects([estimate("law.b[1]"), estimate("law.a", "law.c"), estimate("rig.moving_mass")], names)
    assert effects.tolist() == [[0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]]
    by_record = _effects([estimate("a[0]"), estimate("a[1]"), estimate("c")], names)
    assert by_record.tolist() == [[0.5, 0.5, 0], [0, 0, 0], [0, 0, 0], [0, 0, 1]]
    within = _effects([estimate("law.rate"), estimate("lag_time")], ["law.rate", "lag_time"])  # a `Lag`
    assert within.tolist() == [[1, 0], [0, 1]]
    with pytest.raises(ValueError, match=r"estimates among a, b.*'rate'"):
        _effects([estimate("rate")], names)


def test_an_undetermined_parameter_that_matters_is_named():
    law = dampers.Linear(2500.0) + dampers.Spring(1000.0)
    blind = fitted(law, ["terms.0.rate", "terms.1.stiffness"], np.diag([100.0, np.inf]))
    found = tune.compare_dampers({"A": dampers.Linear(2500.0), "B": blind}, quarter_car, WHITE, metrics=[COMFORT, TYRE])
    assert "B: terms.1.stiffness is not determined by its records" in found.warnings[0]
    assert not found.difference(COMFORT).significant and found.to_dict()["differences"][0]["margin"] is None
    found.plot()


@pytest.mark.parametrize(
    ("laws", "vehicle", "on", "message"),
    [
        ({"A": dampers.Linear(1.0)}, quarter_car, WHITE, "dampers.*two or more"),
        ({"A": dampers.Linear(1.0), "B": 3.0}, quarter_car, WHITE, r"dampers\['B'\].*damper law or the result"),
        (dict.fromkeys("AB", dampers.Linear(1.0)), quarter_car(), WHITE, "function from a law"),
        (dict.fromkeys("AB", dampers.Linear(1.0)), quarter_car, [roads.white], "two or more roads"),
    ],
)
def test_wrong_calls_are_refused(laws, vehicle, on, message):
    with pytest.raises(ValueError, match=message):
        _check(laws, vehicle, on)
