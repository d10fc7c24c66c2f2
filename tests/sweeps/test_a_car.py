import jax.numpy as jnp
import numpy as np
import pytest

import jaxdamp
from jaxdamp import roads, vehicles
from jaxdamp.parameters import replace
from jaxdamp.simulation import Exponential
from jaxdamp.sweeps import SweepFunction
from jaxdamp.sweeps.axes import as_points
from jaxdamp.sweeps.function import HasDerivatives, HasDomain, HasLanes, HasSequence, HasSideBySide, HasUnits
from jaxdamp.sweeps.running import Computation


pytestmark = pytest.mark.users_flags


@pytest.mark.slow
def test_a_simulated_quarter_car(tmp_path):
    car, road = vehicles.presets.quarter_car_000(), roads.step(0.02, start=0.05)

    def ride(point):
        run = jaxdamp.simulate(replace(car, point), road, duration=0.3, dt=2e-3, substeps=1)
        return {name: run.metrics()[name] for name in ("rms_sprung_acceleration", "working_space_rms")}

    axes = {"damper.rate": [1000.0, 3000.0, 5000.0], "sprung_mass": [1000.0, 1200.0]}
    data = jaxdamp.sweep(ride, axes, gradients=True, file=tmp_path / "ride.nc")
    assert jaxdamp.sweep(ride, axes, gradients=True, file=tmp_path / "ride.nc").identical(data)
    point = {"damper.rate": jnp.asarray(3000.0), "sprung_mass": jnp.asarray(1200.0)}
    for name, value in ride(point).items():
        np.testing.assert_allclose(data[name].sel({"damper.rate": 3000.0, "sprung_mass": 1200.0}), value, rtol=1e-11)
    h = 1.0
    near = [float(ride(point | {"damper.rate": jnp.asarray(3000.0 + s)})["working_space_rms"]) for s in (-h, h)]
    slope = data["d_working_space_rms"].sel({"damper.rate": 3000.0, "sprung_mass": 1200.0, "parameter": "damper.rate"})
    np.testing.assert_allclose(slope, (near[1] - near[0]) / (2 * h), rtol=1e-5)


@pytest.mark.slow
def test_a_ride_is_swept_with_its_units():
    car, road = vehicles.presets.quarter_car_000(), roads.step(0.02, start=0.05)
    ride = jaxdamp.Ride(car, road, metrics=["rms_sprung_acceleration", "working_space_rms"], duration=0.2, dt=2e-3)
    axes = {"rate": [1000.0, 3000.0], "sprung_mass": [1000.0, 1200.0, 1400.0]}
    data = jaxdamp.sweep(ride, axes, gradients=True, chunk=6)
    assert data["rate"].attrs["units"] == "N s/m" and data["rms_sprung_acceleration"].attrs["units"] == "m/s^2"
    alone = ride({"damper.rate": 3000.0, "sprung_mass": 1400.0})
    for name, value in alone.items():  # other code is compiled for cars side by side
        np.testing.assert_allclose(data[name].sel(rate=3000.0, sprung_mass=1400.0), value, rtol=1e-11)
    backward = jaxdamp.sweep(ride, {"rate": [3000.0], "sprung_mass": [1400.0]}, gradients="reverse")
    forward = data["d_working_space_rms"].sel(rate=3000.0, sprung_mass=1400.0)
    np.testing.assert_allclose(forward, backward["d_working_space_rms"][0, 0], rtol=1e-9)


def test_a_ride_says_all_that_a_sweep_asks():
    function: SweepFunction = jaxdamp.Ride(
        vehicles.presets.quarter_car_000(), roads.step(0.02, start=0.05), duration=0.1
    )
    asked = (HasUnits, HasLanes, HasDerivatives, HasSideBySide, HasSequence, HasDomain)
    assert all(isinstance(function, protocol) for protocol in asked)
    assert not any(isinstance(lambda point: point, protocol) for protocol in asked)


def test_few_cars_are_driven_one_after_the_other(monkeypatch):
    """With the numbers of a single ride; many, or with a chunk of one's own, side by side."""
    car, road, (name,) = vehicles.presets.quarter_car_000(), roads.step(0.02, start=0.05), ["working_space_rms"]
    ride, rates = jaxdamp.Ride(car, road, metrics=[name], duration=0.1, dt=2e-3), np.array([1000.0, 2000.0, 3000.0])
    monkeypatch.setattr("jaxdamp.simulation.ride.SEQUENCE", 3 * 50)
    assert ride.sequential_points == 3
    alone = [float(ride({"damper.rate": rate})[name]) for rate in rates]
    np.testing.assert_allclose(jaxdamp.sweep(ride, {"damper.rate": rates})[name], alone, rtol=1e-12)
    np.testing.assert_allclose(jaxdamp.sweep(ride, {"damper.rate": rates}, chunk=2)[name], alone, rtol=1e-11)
    of_three, of_four = (as_points({"damper.rate": 1000.0 * np.arange(1.0, size)}) for size in (4.0, 5.0))
    assert Computation(ride, of_three).is_sequence and not Computation(ride, of_four).is_sequence
    assert not Computation(ride, of_three, chunk=2).is_sequence
    printed = jaxdamp.Ride(car, road, metrics=[name], duration=0.1, dt=2e-3, engine=Exponential(printed=True))
    white = jaxdamp.Ride(car, roads.white("C", 20.0), metrics=["rms_dynamic_tyre_load"])
    assert printed.sequential_points == white.sequential_points == 0


def test_cars_that_cannot_exist_fail_with_a_reason():
    car, road = vehicles.presets.quarter_car_000(), roads.step(0.02, start=0.05)
    ride = jaxdamp.Ride(car, road, metrics=["working_space_rms"], duration=0.1, dt=2e-3)
    with pytest.warns(UserWarning, match="4 of 6 points of the sweep failed"):
        data = jaxdamp.sweep(ride, {"rate": [-1000.0, 1000.0], "sprung_mass": [0.0, 1000.0, 1200.0]})
    rate, mass = "damper.rate must be positive [N s/m]", "sprung_mass must be positive [kg]"
    assert data["reason"].values.tolist() == [[rate, rate, rate], [mass, "", ""]]
    np.testing.assert_array_equal(data["failed"], data["working_space_rms"].isnull())
    with pytest.raises(ValueError, match=r"damper\.rate must be positive \[N s/m\].* but is rate from -2 to -1"):
        jaxdamp.sweep(ride, {"rate": [-2.0, -1.0]})


def test_the_steepest_end_of_the_axes_sets_the_steps_of_a_sweep():
    car, road, (name,) = vehicles.presets.quarter_car_000(), roads.step(0.02, start=0.05), ["working_space_rms"]
    ride, steep = jaxdamp.Ride(car, road, metrics=[name], duration=0.3, dt=2e-3), {"damper.rate": 200e3}
    with pytest.warns(UserWarning, match="1 of 3 points of the sweep failed.* a law is too steep for 4 steps in 0.002"):
        data = jaxdamp.sweep(ride, {"damper.rate": [1500.0, 200e3, 1e9]})
    assert data["failed"].values.tolist() == [False, False, True]
    alone = jaxdamp.Ride(replace(car, steep), road, metrics=[name], duration=0.3, dt=2e-3)
    assert alone.substeps == 4 and float(data[name][1]) == pytest.approx(float(alone()[name]), rel=1e-9)
    rate, mass = np.array([1500.0, 200e3]), np.array([20.0, 60.0])
    both = [{"damper.rate": rate, "unsprung_mass": mass}, {"unsprung_mass": mass, "damper.rate": rate}]
    lightest = replace(car, steep | {"unsprung_mass": 20.0})
    needed = jaxdamp.simulation.substeps_needed(lightest, 2e-3)
    assert [ride.reaching(columns).substeps for columns in both] == [needed, needed]
    fixed = jaxdamp.Ride(car, road, metrics=[name], duration=0.3, dt=2e-3, substeps=1)
    assert fixed.reaching(both[0]) is fixed
    assert ["too steep" in reason for reason in fixed.out_of_domain({"damper.rate": rate})] == [False, True]


def test_combinations_that_no_step_can_follow_fail_where_each_value_alone_could():
    """Their travel was a number without meaning."""
    car, road, (name,) = vehicles.presets.quarter_car_000(), roads.step(0.02, start=0.05), ["working_space_rms"]
    ride = jaxdamp.Ride(car, road, metrics=[name], duration=0.1, dt=2e-3)
    axes = {"damper.rate": [1500.0, 2.4e6], "unsprung_mass": [1.0, 40.0]}
    with pytest.warns(UserWarning, match="with these values together a law is too steep for 64 steps in 0.002 s"):
        data = jaxdamp.sweep(ride, axes)
    assert data["failed"].values.tolist() == [[False, False], [True, False]]


def test_a_ride_takes_one_number_for_each_parameter():
    ride = jaxdamp.Ride(vehicles.presets.quarter_car_000(), roads.step(0.02, start=0.05), duration=0.1)
    with pytest.raises(ValueError, match=r"point\['rate'\]` must be one number for one car, .*`jaxdamp\.sweep"):
        ride({"rate": (5000, 9000)})
