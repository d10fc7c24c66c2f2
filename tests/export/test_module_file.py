import inspect
import json
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, roads, vehicles
from jaxdamp._guesses import shared_names
from jaxdamp.dampers import (
    AbstractMemoryless,
    CoulombFriction,
    FittedRange,
    Lag,
    Linear,
    MotionRatio,
    PiecewiseLinear,
    SeriesSpring,
    Table,
    TemperatureScaled,
    with_fitted_range,
)
from jaxdamp.export import from_json, to_json
from jaxdamp.export._rebuild import known_classes
from jaxdamp.parameters import get, parameter, positive, replace, setting
from jaxdamp.tune import minimise
from jaxdamp.vehicles import Body, Element, Frame, Link, LumpedVehicle, Seat, SeatMass, Wheel, presets


def law():
    inner = PiecewiseLinear([-0.1, 0.1 + 0.2], [500.0, 2000.0 / 3.0, 800.0], knee_width=0.01)
    return Lag(SeriesSpring(inner + 2.0 * CoulombFriction(40.0, 1e-300), 1.5e6), 0.004)


class Orifice(AbstractMemoryless):
    """A law of one's own, with settings of several kinds."""

    size: Any = parameter("N s²/m²", "force over v²", positive)
    width: Any = setting("m/s", "rounding", positive, default=1e-3)
    name: str = "orifice"
    weights: Any = None
    pair: tuple = (1, None, True)

    def force_velocity(self, v):
        return self.size * v * jnp.sqrt(v * v + self.width**2)


def same(a, b):
    return jax.tree.structure(a) == jax.tree.structure(b) and all(
        np.asarray(x).tobytes() == np.asarray(y).tobytes()
        for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True)
    )


def test_text_names_classes_units_and_settings():
    document = json.loads(to_json(law()))
    assert document["format"] == "jaxdamp law" and document["version"] == 1
    outer = document["law"]
    assert outer["class"] == "Lag" and outer["lag_time"] == {"value": 0.004, "unit": "s"}
    terms = outer["law"]["law"]["terms"]
    assert [t["class"] for t in terms] == ["PiecewiseLinear", "Scaled"]
    assert terms[0]["knots"] == {"value": [-0.1, 0.1 + 0.2], "unit": "m/s"}
    assert terms[0]["knee_width"] == {"value": 0.01, "unit": "m/s"} and terms[0]["monotone"] is True


def test_text_and_file(tmp_path):
    path = tmp_path / "front.json"
    text = to_json(law(), path)
    assert path.read_text(encoding="utf-8") == text + "\n"
    for source in (text, "\n  " + text, path, str(path)):
        assert same(from_json(source), law())


def test_an_existing_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "front.json"
    to_json(Linear(1.0), path)
    before = path.read_text(encoding="utf-8")

    def fail(*arguments):
        raise OSError("no space left")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="no space left"):
        to_json(law(), path)
    assert path.read_text(encoding="utf-8") == before
    assert [f.name for f in tmp_path.iterdir()] == ["front.json"]


def test_a_law_of_ones_own(tmp_path):
    for own in (Orifice(2000.0), Orifice(1.0, 0.1, "b", jnp.array([[0.1, 0.2]]), (2.5, "c", Linear(3.0)))):
        assert same(from_json(to_json(MotionRatio(own, 0.7))), MotionRatio(own, 0.7))
        again = from_json(to_json(own))
        assert isinstance(again, Orifice) and again.name == own.name


def test_single_precision_keeps_its_value():
    single = jax.tree.map(lambda a: a.astype(jnp.float32), Linear(0.1))
    assert get(from_json(to_json(single)), "rate") == np.float64(np.float32(0.1))


# ---- what cannot be written


def test_not_a_module():
    with pytest.raises((ValueError, TypeError), match="module"):
        to_json(3.0)  # type: ignore[arg-type]


def test_not_a_number(tmp_path):
    broken = jax.tree.map(lambda a: a * jnp.nan, Linear(1.0))
    with pytest.raises(ValueError, match=r"`Linear\.rate` must be finite, but is nan"):
        to_json(broken, tmp_path / "law.json")
    assert not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match=r"`Orifice\.pair\[0\]` must be finite"):
        to_json(Orifice(1.0, pair=(np.inf,)))


def test_a_traced_law():
    with pytest.raises(ValueError, match=r"`Linear\.rate` must have a known value.*outside `jax.jit`"):
        jax.jit(lambda rate: to_json(Linear(rate)) and rate)(1.0)


def test_a_field_that_is_no_plain_value():
    with pytest.raises(ValueError, match=r"`Orifice\.weights` must be a law, a number, .*, but is a builtin_function"):
        to_json(Orifice(1.0, weights=len))
    with pytest.raises(ValueError, match=r"`Orifice\.weights` must hold floating-point numbers, but is of type int"):
        to_json(Orifice(1.0, weights=np.arange(3)))


def test_two_laws_of_one_name():
    own = type("Linear", (AbstractMemoryless,), {"force_velocity": lambda self, v: v})
    with pytest.raises(
        ValueError, match="must be of a class that can be found by its name, but is a Linear that differs"
    ):
        to_json(own())
    assert type(from_json(to_json(Linear(1.0)))) is Linear


def test_no_folder(tmp_path):
    with pytest.raises(ValueError, match=r"`path` must lie in a folder that exists.*Make the folder first"):
        to_json(Linear(1.0), tmp_path / "no" / "law.json")


# ---- what cannot be read


def test_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"There is no file .*front\.json"):
        from_json(tmp_path / "front.json")
    with pytest.raises(FileNotFoundError, match="There is no file"):
        from_json("front.json")


def changed(change):
    document = json.loads(to_json(Lag(Linear(1500.0), 0.004)))
    change(document)
    return json.dumps(document)


READ_ERRORS = {
    "not JSON": ("{oops", "It must be written in JSON, but the text is not: Expecting property name"),
    "another file": ('{"format": "PDF"}', '`path_or_text` must begin with "format": "jaxdamp law"'),
    "version": (changed(lambda d: d.update(version=4)), "`version` must be 1, 2 or 3, but is 4"),
    "no law": (
        changed(lambda d: d.pop("law")),
        "must hold format, version, law, but is of format, version",
    ),
    "unknown law": (
        changed(lambda d: d["law"]["law"].update({"class": "Linaer"})),
        "of a class that is known, but is 'Linaer'. Did you mean 'Linear'. Import the module of your own classes first",
    ),
    "abstract law": (
        changed(lambda d: d["law"].update({"class": "AbstractDamper"})),
        "must be of a class that is known",
    ),
    "missing": (
        changed(lambda d: d["law"].pop("lag_time")),
        "`Lag` must hold class, law, lag_time, but is lacks lag_time",
    ),
    "too many": (changed(lambda d: d["law"].update(gain=1.0)), "`Lag` must hold .* but is has gain too many"),
    "no class": (changed(lambda d: d["law"]["law"].pop("class")), 'must be written as {"class"'),
    "NaN": (changed(lambda d: d["law"]["lag_time"].update(value=np.nan)), "finite numbers only, but the text has NaN"),
    "too large": (
        changed(lambda d: d["law"]["lag_time"].update(value=1)).replace('"value": 1,', '"value": 1e999,'),
        r"`Lag\.lag_time` must be finite",
    ),
    "negative": (changed(lambda d: d["law"]["lag_time"].update(value=-1.0)), r"`Lag\.lag_time` must be positive \[s\]"),
    "unit": (
        changed(lambda d: d["law"]["lag_time"].update(unit="ms")),
        r"`Lag\.lag_time` must be in 's', but is in 'ms'",
    ),
    "no unit": (
        changed(lambda d: d["law"]["lag_time"].pop("unit")),
        'must be written as {"value": "...", "unit": "s"}',
    ),
    "a bare number": (changed(lambda d: d["law"].update(lag_time=0.004)), "must be written as"),
    "a word": (changed(lambda d: d["law"]["lag_time"].update(value="x")), "must be a number or a list of numbers"),
    "ragged": (changed(lambda d: d["law"]["lag_time"].update(value=[1, [2]])), "must be a number or a list"),
    "a list": (changed(lambda d: d["law"]["lag_time"].update(value=[1.0, 2.0])), r"`Lag\.lag_time` must be one number"),
}


@pytest.mark.parametrize("name", READ_ERRORS)
def test_read_errors(name):
    text, message = READ_ERRORS[name]
    with pytest.raises(ValueError, match=message):
        from_json(text)


def test_a_file_of_several_faults_is_named(tmp_path):
    path = tmp_path / "law.json"
    path.write_text("[1, 2", encoding="utf-8")
    with pytest.raises(ValueError, match=r"law\.json is not"):
        from_json(path)


def test_every_class_of_the_package_is_found_by_its_name():
    kinds = [getattr(door, name) for door in (dampers, roads, vehicles) for name in door.__all__ + shared_names(door)]
    kinds = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, eqx.Module)]
    kinds = [kind for kind in kinds if not inspect.isabstract(kind) and not kind.__name__.startswith("Abstract")]
    assert len(kinds) > 60 and all(known_classes()[kind.__name__] is kind for kind in kinds)


# ---- vehicles, roads, other modules


PRESETS = [
    name for name, make in inspect.getmembers(presets, inspect.isfunction) if make.__module__ == presets.__name__
]


@pytest.mark.parametrize("name", PRESETS)
def test_every_published_vehicle_comes_back_bit_for_bit(name, tmp_path):
    car = getattr(presets, name)()
    to_json(car, tmp_path / "car.json")
    assert json.loads((tmp_path / "car.json").read_text(encoding="utf-8"))["format"] == "jaxdamp vehicle"
    assert same(from_json(tmp_path / "car.json"), car)


def test_a_vehicle_of_parts_and_one_with_everything_come_back():
    body, wheel = Body("sprung", 300.0), Body("unsprung", 40.0)
    suspension = Link("", body.at() - wheel.at(), stiffness=20e3, elements=(Element("damper", law()),))
    parts = LumpedVehicle(Frame((body, wheel), (suspension,), (Wheel("", wheel.at(), 180e3),)))
    fitted = with_fitted_range(Linear(1500.0), velocity=(-0.5, 0.5))
    seat = Seat((SeatMass(80.0, 12e3, Linear(600.0)),))
    full = replace(presets.quarter_car_000(fitted, tyre_lifts=True), {"tyre_damping": 10.0 / 3.0})
    full = eqx.tree_at(lambda car: car.seats, full, (seat,), is_leaf=lambda x: isinstance(x, tuple))
    for car in (parts, full):
        again = from_json(to_json(car))
        assert same(again, car) and again.static_wheel_loads() == car.static_wheel_loads()
    assert json.loads(to_json(full))["version"] == 2


def test_a_tuned_vehicle_is_saved():
    road = roads.white("C", 20.0)
    tuned = minimise("rms_sprung_acceleration", presets.quarter_car_000(), road, max_steps=2).vehicle
    assert same(from_json(to_json(tuned)), tuned)


def test_a_file_may_lack_fields_that_a_class_was_given_later():
    document = json.loads(to_json(presets.quarter_car_000()))
    for name in ("friction", "seats", "damper_count"):
        del document["vehicle"][name]
    assert same(from_json(json.dumps(document)), presets.quarter_car_000())


def test_a_vehicle_is_checked_as_its_constructor_checks_it():
    document = json.loads(to_json(presets.quarter_car_000(TemperatureScaled(Linear(1.0), temperature=330.0))))
    document["vehicle"]["damper"]["sensitivity"]["value"] = 0.1
    with pytest.raises(ValueError, match="sensitivity"):
        from_json(json.dumps(document))
    document = json.loads(to_json(presets.quarter_car_000()))
    document["vehicle"]["damper"] = json.loads(to_json(roads.sine(0.01, frequency=1.0)))["road"]
    with pytest.raises(ValueError, match=r"`QuarterCar\.damper` must be a damper law"):
        from_json(json.dumps(document))
    with pytest.raises(ValueError, match="`law` must be a law"):
        from_json(json.dumps({"format": "jaxdamp law", "version": 1, "law": document["vehicle"]["damper"]}))


# ---- the range of the fitted records


def test_a_range_stands_with_its_law_and_comes_back_in_all_digits():
    slow = FittedRange(velocity=(-0.1 / 3, 0.2), stroke=(-0.02, 0.02), force=(-300.0, 500.0), frequency=(1.0, 3.0))
    warm = FittedRange(temperature=(290.0, 310.0), command=(0.0, 2.0))
    fitted = with_fitted_range(Lag(with_fitted_range(Linear(1500.0), slow), 0.004), warm)
    document = json.loads(to_json(fitted))
    assert document["version"] == 2 and document["law"]["fitted_to"] == {
        "temperature": {"value": [290.0, 310.0], "unit": "K"},
        "command": {"value": [0.0, 2.0], "unit": ""},
    }
    assert document["law"]["law"]["fitted_to"]["velocity"] == {"value": [-0.1 / 3, 0.2], "unit": "m/s"}
    assert same(from_json(to_json(fitted)), fitted)


def test_a_law_of_ones_own_and_one_with_an_init_keep_their_range():
    for law in (Orifice(3.0), Table([-1.0, 0.0, 1.0], [-800.0, 0.0, 900.0])):
        fitted = with_fitted_range(law, velocity=(-0.5, 0.5))
        assert same(from_json(to_json(fitted)), fitted) and same(from_json(to_json(law)), law)


def test_files_without_a_range_are_as_before_and_read_as_before():
    assert json.loads(to_json(law()))["version"] == 1
    text = (
        '{"format": "jaxdamp law", "version": 1, "law": {"class": "Linear", "rate": {"value": 1.0, "unit": "N s/m"}}}'
    )
    assert from_json(text).fitted_to is None


@pytest.mark.parametrize(
    ("covered", "message"),
    [
        ([1.0, 2.0], "`Linear.fitted_to` must be written as"),
        ({"velocty": {"value": [0.0, 1.0], "unit": "m/s"}}, "Did you mean 'velocity'"),
        ({"velocity": {"value": [0.0, 1.0], "unit": "mm/s"}}, "`Linear.fitted_to.velocity` must be in 'm/s'"),
        ({"velocity": {"value": [0.0], "unit": "m/s"}}, "be the lowest and the highest value"),
        ({"velocity": {"value": [1.0, 0.0], "unit": "m/s"}}, "two finite numbers in order"),
    ],
)
def test_a_range_that_makes_no_sense_is_refused(covered, message):
    document = json.loads(to_json(with_fitted_range(Linear(1500.0), velocity=(-0.5, 0.5))))
    document["law"]["fitted_to"] = covered
    with pytest.raises(ValueError, match=message):
        from_json(json.dumps(document))


def test_a_range_in_a_file_of_the_first_version_is_refused():
    document = json.loads(to_json(with_fitted_range(Linear(1500.0), velocity=(-0.5, 0.5))))
    with pytest.raises(ValueError, match="have no 'fitted_to' in version 1"):
        from_json(json.dumps(document | {"version": 1}))


def test_classes_of_the_package_have_names_of_their_own():
    """By which a file finds them: two of one name could not be written."""
    modules, waiting = list[type[eqx.Module]](), [eqx.Module]
    while waiting:
        waiting += (found := waiting.pop().__subclasses__())
        modules += [c for c in found if c.__module__.startswith("jaxdamp.") and not inspect.isabstract(c)]
    homes: dict[str, set[str]] = {}
    for own in modules:
        homes.setdefault(own.__name__, set()).add(own.__module__)
    assert not {name: places for name, places in homes.items() if len(places) > 1 and not name.startswith("_")}
