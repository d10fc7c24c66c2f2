"""No function takes more arguments than one can keep in mind; typed keywords, described once, come beside them."""

import inspect
from collections.abc import Callable, Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Unpack, get_args, get_origin

import numpy as np
import pytest

import jaxdamp
from jaxdamp import bench, identify, report, rig, roads, simulate, sweep, tune, vehicles
from jaxdamp._guesses import shared_names
from jaxdamp.dampers import Bilinear, Linear


MOST = 8
MORE = {"roads.iso8608": 10, "export.to_explorer": 9}  # each a quantity of its own, used by itself
PACKAGES = [m.name for m in iter_modules(jaxdamp.__path__) if m.ispkg and not m.name.startswith("_")]
LAW, CAR = Bilinear(2600.0, 1200.0), vehicles.presets.quarter_car_000()
WRONG: dict[str, Callable[[], object]] = {  # calls with a mistyped keyword, by the one that is meant
    "freeze": lambda: identify.fit(LAW, [], freze=["friction"]),  # pyright: ignore[reportCallIssue]
    "rig": lambda: identify.fit(LAW, [], rgi="offset"),  # pyright: ignore[reportCallIssue]
    "shared": lambda: identify.fit(LAW, {"A": []}, shard=["friction"]),  # pyright: ignore[reportCallIssue]
    "loss": lambda: identify.fit_many(LAW, {"A": []}, los="huber"),  # pyright: ignore[reportCallIssue]
    "settling": lambda: identify.fit(CAR, [], setling=0.5),  # pyright: ignore[reportCallIssue]
    "held_out": lambda: identify.compare({"linear": Linear}, [], heldout=[]),  # pyright: ignore
    "scatter": lambda: tune.robust("comfort", CAR, tune.Scenarios([roads.iso8608("C", 20.0, seed=1)]), scater={}),  # pyright: ignore[reportCallIssue]
    "per_record": lambda: identify.fit_vehicle(CAR, [], per_records=["offset"]),  # pyright: ignore[reportCallIssue]
    "bounds": lambda: identify.fit_targets(len, LAW, {}, bound={}),  # pyright: ignore
    "common": lambda: identify.fit_scheduled(LAW, [], comon=["friction"]),  # pyright: ignore[reportCallIssue]
    "weighting": lambda: identify.prepare(LAW, [], weighing="runs"),  # pyright: ignore[reportCallIssue]
    "patience": lambda: identify.train(LAW, [], held_out=[], patiense=3),  # pyright: ignore[reportCallIssue]
    "strokes": lambda: identify.design_experiment(LAW, force_noise=1.0, stroke=3),  # pyright: ignore[reportCallIssue]
    "sensors": lambda: identify.virtual_ride(CAR, roads.sine(0.01, frequency=1.0), {}, sensor=None),  # pyright: ignore
    "duration": lambda: simulate(CAR, roads.sine(0.01, frequency=1.0), durations=1.0),  # pyright: ignore
    "substeps": lambda: rig.respond(LAW, np.arange(2.0), np.arange(2.0), substep=2),  # pyright: ignore
    "devices": lambda: sweep(dict, {}, device=1),  # pyright: ignore
    "columns": lambda: bench.read("nothing.csv", colums={}),  # pyright: ignore[reportCallIssue]
    "units": lambda: bench.read_rides("nothing.csv", unit={}),  # pyright: ignore[reportCallIssue]
    "fresh_roads": lambda: tune.minimise("comfort", CAR, roads.white("C", 20.0), fresh_road=3),  # pyright: ignore
    "title": lambda: report.ride_report({}, titel="A ride"),  # pyright: ignore[reportCallIssue]
}


def functions() -> Iterator[tuple[str, Callable[..., object]]]:
    """The public functions by their names."""
    for package in PACKAGES:
        module = import_module(f"jaxdamp.{package}")
        for name in [*module.__all__, *shared_names(module)]:
            function = getattr(module, name)
            if inspect.isfunction(function) and function.__module__.startswith("jaxdamp"):
                yield f"{package}.{name}", function


def written(function: Callable[..., object]) -> list[inspect.Parameter]:
    """The parameters of a function as its definition has them."""
    return list(inspect.signature(inspect.unwrap(function)).parameters.values())


def test_no_function_takes_more_than_eight_arguments_beside_typed_keywords() -> None:
    counts = {name: sum(p.kind is not p.VAR_KEYWORD for p in written(function)) for name, function in functions()}
    assert {name: count for name, count in counts.items() if count > MOST} == MORE


TYPED = {n: f for n, f in functions() if any(get_origin(p.annotation) is Unpack for p in written(f))}


@pytest.mark.parametrize("name", TYPED)
def test_help_and_completion_know_every_keyword_with_its_default(name: str) -> None:
    *own, settings = written(TYPED[name])
    kinds = get_args(settings.annotation)[0].__annotations__
    shown = inspect.signature(TYPED[name]).parameters
    assert set(shown) <= {*kinds, *(p.name for p in own)} and len(shown) > len(own)
    assert all(shown[p.name] == p for p in own)
    added = [p for p in shown.values() if p not in own]
    assert all(p.kind is p.KEYWORD_ONLY and p.default is not p.empty and p.annotation is not p.empty for p in added)


def test_the_keywords_of_a_fit_stand_in_its_signature() -> None:
    shown = inspect.signature(identify.fit).parameters
    assert list(shown)[:4] == ["law", "runs", "rig", "over"] and shown["max_steps"].default == 200
    assert inspect.signature(tune.pareto).parameters["fresh_roads"].default == 3  # its own, 32 of `minimise`


@pytest.mark.parametrize("meant", WRONG)
def test_a_mistyped_keyword_is_named_with_the_near_one(meant: str) -> None:
    with pytest.raises(TypeError, match=rf"has no argument '\w+': did you mean '{meant}'\?"):
        WRONG[meant]()


def test_keywords_kept_for_several_calls_are_those_of_a_call() -> None:
    how = identify.FitSettings(freeze=["friction"], max_steps=3)
    with pytest.raises(TypeError, match="'max_step': did you mean 'max_steps'"):
        identify.fit(LAW, [], **how, max_step=1)  # pyright: ignore[reportCallIssue]
    with pytest.raises(TypeError, match="multiple values for keyword argument 'max_steps'"):
        identify.fit(LAW, [], **how, **identify.Search(max_steps=1))  # pyright: ignore[reportCallIssue]
