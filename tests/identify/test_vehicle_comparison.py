"""Vehicles compared on drives that they were not fitted to."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jaxdamp import identify, roads
from jaxdamp.dampers import CoulombFriction, Dahl, Linear
from jaxdamp.identify.rungs import recommendation
from jaxdamp.identify.vehicle_comparing import _smallest, on_drives
from jaxdamp.parameters import get, replace
from jaxdamp.vehicles import Guide, Guided, HalfCar, QuarterCar
from jaxdamp.vehicles.presets import half_car_002


pytestmark = pytest.mark.filterwarnings("ignore:A step of dt")  # of 5 ms, in records and fits alike
CAR = QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0))
NOISE = {"sprung_acceleration": 0.05, "stroke": 1e-4}
FREE = {"over": ["spring_rate", "tyre_stiffness", "damper.rate", "guides.0.law.**"], "freeze": ["friction_velocity"]}


def drives(law, count=2, seed=0):
    car = Guided(CAR, (Guide(law),))
    how = {"duration": 3.0, "sampling_rate": 200.0, "finer": 5, "seed": seed}
    cuts = [roads.iso8608("C", speed=20.0, seed=10 * seed + i) for i in range(count)]
    return [identify.virtual_ride(car, road, NOISE, name=f"drive {i}", **how) for i, road in enumerate(cuts)]


def start(force=30.0):
    begin = {"spring_rate": 18e3, "tyre_stiffness": 200e3, "damper.rate": 1300.0}
    return identify.friction_ladder(Guided(replace(CAR, begin), (Guide(CoulombFriction(force, 0.01)),)))


def compared(law, **options):
    return identify.compare(start(), drives(law, **options), dt=5e-3, **FREE)


@pytest.fixture(scope="module")
def of_giving_friction():
    return compared(Dahl(1.5e5, 60.0))


@pytest.mark.slow
def test_friction_that_gives_before_it_slides_is_recommended_where_it_is_true(of_giving_friction):
    best = of_giving_friction.best
    assert isinstance(of_giving_friction, identify.VehicleComparison) and best.name == "dahl"
    assert best.judged_on == "each of 2 drives predicted by fits without it" and len(best.errors) == 8
    assert of_giving_friction["coulomb"].converged and best.held_out_rmse < 1.1
    errors = {rung.name: rung.held_out_rmse for rung in of_giving_friction.rungs}
    assert errors["none"] > 3.0 * errors["coulomb"] > 4.0 * errors["dahl"]
    found = best.result["guides.0.law.friction_force"]
    assert abs(found.value - 60.0) < 3.5 * found.standard_error
    assert "No other vehicle predicts as well" in str(of_giving_friction)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "best"), [(None, "none"), (CoulombFriction(60.0, 0.01), "coulomb")])
def test_the_simplest_vehicle_is_recommended(law, best):
    assert compared(law).best.name == best


@pytest.mark.slow
def test_a_drive_is_predicted_by_a_fit_of_the_other(of_giving_friction):
    """The errors are those of a fit that never had the drive, from the start."""
    one, other = of_giving_friction.best.result.records
    alone = identify.fit(start()["dahl"], one, dt=5e-3, over=FREE["over"])
    expected = {(s.record, s.channel): s.rmse for s in on_drives(alone, [other])[0]}
    found = {(s.record, s.channel): s.rmse for s in of_giving_friction.best.scores if s.record.startswith("drive 1")}
    assert len(found) == 8 and found == pytest.approx(expected, rel=0.01)


@pytest.mark.slow
def test_drives_given_are_predicted_and_one_drive_is_divided_in_time():
    one, *others = drives(CoulombFriction(60.0, 0.01), count=4)
    forms = {"coulomb": start()["coulomb"]}
    by_others = identify.compare(forms, one, held_out=others, dt=5e-3, **FREE)
    assert by_others.best.judged_on == "3 drives held out" and len(by_others.best.errors) == 3
    in_time = identify.compare(forms, one, dt=5e-3, **FREE).best
    assert in_time.judged_on == "each quarter of the drive predicted by fits without it" and len(in_time.errors) == 4
    assert in_time.held_out_rmse == pytest.approx(1.0, abs=0.1)
    assert by_others.best.held_out_rmse == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_vehicles_are_judged_on_the_same_parts_if_only_some_have_numbers_of_one_drive():
    forms, rides = {name: start()[name] for name in ("none", "coulomb")}, drives(CoulombFriction(60.0, 0.01), count=3)
    found = identify.compare(forms, rides, dt=5e-3, per_record=["friction_force"], **FREE)
    assert [len(rung.errors) for rung in found.rungs] == [12, 12] and found.best.name == "coulomb"


def test_the_form_stands_where_the_friction_is_and_starts_from_it():
    def laws(ladder, of):
        return {name: of(car) for name, car in ladder.items()}

    guided = laws(
        identify.friction_ladder(Guided(CAR, (Guide(CoulombFriction(30.0, 0.02)),))), lambda c: c.guides[0].law
    )
    assert guided["none"] is None and guided["coulomb"] == CoulombFriction(30.0, 0.02)
    assert isinstance(guided["dahl"], Dahl) and float(guided["dahl"].friction_force) == 30.0
    in_sum = replace_damper(CAR, Linear(1500.0) + Dahl(2e5, 40.0))
    inside = laws(identify.friction_ladder(in_sum), lambda c: c.damper)
    assert inside["none"] == Linear(1500.0) and inside["dahl"] == Linear(1500.0) + Dahl(2e5, 40.0)
    assert inside["coulomb"] == Linear(1500.0) + CoulombFriction(40.0, 0.01)
    both = identify.friction_ladder(half_car_002(Linear(1500.0)), ["coulomb"])["coulomb"]
    assert isinstance(both, HalfCar)
    forces = [float(get(both, f"{axle}.damper.terms.1.friction_force")) for axle in ("front", "rear")]
    assert forces == [15.0, 15.0]


def replace_damper(car, law):
    return QuarterCar(car.sprung_mass, car.unsprung_mass, car.spring_rate, car.tyre_stiffness, law)


class Ride(SimpleNamespace):
    def __getitem__(self, name):
        return self.channels[name]


def rung(name, free, error, note=""):
    """A vehicle with errors of two channels in three drives, the second channel ten times as large."""
    scores = [
        identify.ChannelScore(f"drive {i}", channel, "m", size * own, 90.0, 0.0, 1.0)
        for i, own in enumerate(error)
        for channel, size in (("a", 1e-3), ("b", 1e-2))
    ]
    estimates = [SimpleNamespace(note=note)] * free
    wave = np.sin(np.arange(100.0))
    ride = Ride(channels={"a": wave, "b": wave})
    result: Any = SimpleNamespace(parameters=estimates, scores=tuple(scores), records=(ride,), converged=True)
    result.status, result.warnings = identify.Status.CONVERGED, ()
    return identify.VehicleRung(name, result, tuple(scores), "three drives")


def test_errors_of_all_channels_are_multiples_of_the_smallest():
    rungs = [rung("simple", 3, (1.0, 1.2, 1.1)), rung("complex", 5, (1.0, 1.19, 1.1)), rung("bad", 2, (2.0, 2.4, 2.2))]
    noise = _smallest(rungs)
    assert noise == pytest.approx({"a": 1.0985e-3, "b": 1.0985e-2}, rel=1e-3)
    simple, complex_, bad = (one._replace(noise=noise) for one in rungs)
    assert bad.rmse == pytest.approx(2.0 * simple.rmse) and simple.errors[1] == pytest.approx(1.2 / 1.0985, rel=1e-3)
    assert recommendation([complex_, bad, simple]).rung is simple
    doubted = rung("doubted", 3, (1.0, 1.2, 1.1), "not identifiable")._replace(noise=noise)
    assert recommendation([complex_, doubted]).rung is complex_


@pytest.mark.parametrize(
    ("vehicles", "options", "message"),
    [
        ({"a": CAR, "b": Linear(1500.0)}, {}, r"`laws\['b'\]` must be a vehicle"),
        ({"a": CAR}, {"over": ["sprin"]}, "No parameter is named 'sprin'"),
    ],
)
def test_wrong_comparisons_are_refused(vehicles, options, message):
    with pytest.raises((ValueError, TypeError), match=message):
        identify.compare(vehicles, drives(None, count=1), dt=5e-3, **options)


def test_an_unknown_form_is_refused():
    with pytest.raises(ValueError, match="`forms` must be one of 'none', 'coulomb', 'dahl'"):
        identify.friction_ladder(CAR, ["stribek"])
