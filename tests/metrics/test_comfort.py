import jax
import numpy as np
import pytest

from jaxdamp.metrics import AXES, comfort_reaction, total_vibration, vibration_total_value, weighting_factor


TIME = np.arange(20000) * 0.002


def test_factors():
    comfort = {name: axis.factor for name, axis in AXES["comfort"].items()}
    assert [comfort[f"seat_{axis}"] for axis in ("x", "y", "z", "roll", "pitch", "yaw")] == [1, 1, 1, 0.63, 0.4, 0.2]
    assert [comfort[f"back_{axis}"] for axis in "xyz"] == [0.8, 0.5, 0.4]
    assert [comfort[f"floor_{axis}"] for axis in "xyz"] == [0.25, 0.25, 0.4]
    assert [axis.factor for axis in AXES["health"].values()] == [1.4, 1.4, 1.0]
    assert {axis.weighting for name, axis in AXES["comfort"].items() if name[-1] in "lhw"} == {"We"}


def test_root_of_squares():
    assert float(vibration_total_value({"seat_z": 0.3, "seat_x": 0.4})) == pytest.approx(0.5, rel=1e-15)
    health = np.sqrt(1.4**2 * 0.4**2 + 0.3**2)
    assert float(vibration_total_value({"seat_z": 0.3, "seat_x": 0.4}, "health")) == pytest.approx(health, rel=1e-15)
    assert float(vibration_total_value({"seat_z": 0.0})) == 0.0
    gradient = jax.jit(jax.grad(lambda a: vibration_total_value({"seat_z": a, "floor_z": 0.5})))(0.0)
    assert float(gradient) == 0.0


def test_records_are_weighted_by_axis():
    sine = np.sin(2 * np.pi * 4.0 * TIME)
    records = {"seat_z": sine, "seat_pitch": 3.0 * sine, "back_x": 0.5 * sine}
    wk, we, wc = (float(weighting_factor(4.0, weighting)) for weighting in ("Wk", "We", "Wc"))
    expected = np.sqrt(wk**2 + (0.4 * 3.0 * we) ** 2 + (0.8 * 0.5 * wc) ** 2) / np.sqrt(2)
    # 40 s, of which the filters take one to settle
    assert float(total_vibration(records, 0.002)) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.0, ("not uncomfortable",)),
        (0.3, ("not uncomfortable",)),
        (0.315, ("a little uncomfortable",)),
        (0.55, ("a little uncomfortable", "fairly uncomfortable")),
        (0.7, ("fairly uncomfortable",)),
        (0.9, ("fairly uncomfortable", "uncomfortable")),
        (1.1, ("uncomfortable",)),
        (1.3, ("uncomfortable", "very uncomfortable")),
        (1.8, ("very uncomfortable",)),
        (2.2, ("very uncomfortable", "extremely uncomfortable")),
        (30.0, ("extremely uncomfortable",)),
    ],
)
def test_reactions_overlap(value, words):
    assert comfort_reaction(value) == words


def test_errors():
    with pytest.raises(ValueError, match=r"`an axis of values` must be one of 'seat_x'.*Did you mean 'seat_z'\?"):
        vibration_total_value({"seatz": 0.3})
    with pytest.raises(ValueError, match=r"`an axis of values` must be one of 'seat_x', 'seat_y', 'seat_z', but"):
        vibration_total_value({"floor_z": 0.3}, "health")
    with pytest.raises(ValueError, match=r"`purpose` must be one of 'comfort', 'health', but is 'helth'. Did you"):
        vibration_total_value({"seat_z": 0.3}, "helth")
    with pytest.raises(ValueError, match=r"`accelerations` must hold at least one axis, but is empty"):
        total_vibration({}, 0.01)
    for value in (-0.1, np.nan):
        with pytest.raises(ValueError, match=r"`total_value` must be finite and not negative"):
            comfort_reaction(value)
    with pytest.raises(ValueError, match=r"`total_value` must be known: texts cannot be compiled, but is traced"):
        jax.jit(lambda x: len(comfort_reaction(x)))(0.5)
