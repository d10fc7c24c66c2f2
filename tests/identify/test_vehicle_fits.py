"""Vehicles from records of their motion."""

import dataclasses
import re

import jax
import numpy as np
import pytest

from jaxdamp import bench, identify, roads
from jaxdamp._display import Display, shown_in
from jaxdamp.dampers import Bilinear, CoulombFriction, Linear
from jaxdamp.identify import vehicle_residuals
from jaxdamp.identify.model import VehicleTest
from jaxdamp.identify.problem import linearised
from jaxdamp.identify.vehicle_left_out import on_signs
from jaxdamp.identify.vehicle_preparing import drives_of, frozen_paths, per_record_paths, vehicle_test
from jaxdamp.identify.vehicle_residuals import ride_batches
from jaxdamp.parameters import free_parameters, parameters, replace
from jaxdamp.rig import Rig, Sensor
from jaxdamp.vehicles import Guide, Guided, QuarterCar, presets


CAR = QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0))
FREE = ["sprung_mass", "unsprung_mass", "spring_rate", "tyre_stiffness", "damper.rate"]
NOISE = {"sprung_acceleration": 0.05, "stroke": 2e-4}
SENSORS = {"stroke": Sensor(offset=1e-3)}
START = replace(CAR, {"spring_rate": 16e3, "tyre_stiffness": 210e3, "damper.rate": 1100.0, "unsprung_mass": 50.0})
SWEEP = roads.sweep_sine(0.7, 14.0, duration=4.0, velocity_amplitude=0.15)
ZERO = {"stroke": Sensor(offset=0.0)}


@pytest.fixture(scope="module")
def record():
    return identify.virtual_ride(CAR, SWEEP, NOISE, sampling_rate=250.0, finer=4, sensors=SENSORS, name="sweep", seed=2)


@pytest.fixture(scope="module")
def motions(record):
    """From motions only."""
    return identify.fit(replace(START, {"sprung_mass": 330.0}), record, over=FREE, sensors=ZERO, dt=2e-3)


def assert_recovered(result, vehicle, sensors=SENSORS, true_rig=None):
    rows = result.table(vehicle, sensors=sensors, true_rig=true_rig).rows
    away = {str(row[0]): float(str(row[5])) for row in rows}
    assert all(abs(a) < 3.5 for a in away.values()), away


def test_motions_give_all_ratios_and_say_that_the_scale_is_free(motions):
    assert isinstance(motions, identify.VehicleFit) and motions.converged
    assert motions.held == ("vehicle.sprung_mass",) and len(motions.scale_free) == 5
    assert len(motions.warnings) == 1 and "vehicle.sprung_mass was held at 330" in motions.warnings[0]
    larger = {name: 1.1 * float(getattr(CAR, name)) for name in FREE[:-1]} | {"damper.rate": 1.1 * 1500.0}
    assert_recovered(motions, replace(CAR, larger))


def test_the_scale_is_free_in_single_precision_too(record, motions):
    """Rounding was taken for an effect of the scale, and no number was identifiable."""
    with jax.enable_x64(False):
        start = QuarterCar(330.0, 50.0, 16e3, 210e3, Linear(1100.0))
        single = identify.fit(start, record, over=FREE, sensors={"stroke": Sensor(offset=0.0)}, dt=2e-3)
    assert single.held == motions.held and len(single.scale_free) == 5
    for one, other in zip(single.parameters, motions.parameters, strict=True):
        assert abs(one.value - other.value) < 0.3 * other.standard_error


def test_a_name_is_that_of_the_vehicle_alone_if_it_is_a_whole_path_there():
    model = vehicle_test(presets.truck_001(), [], {}, "rest", None)
    assert frozen_paths(model, None, ["pitch_inertia"]) == ["vehicle.pitch_inertia"]
    assert "vehicle.tandem.pitch_inertia" in frozen_paths(model, ["pitch_inertia"], [])
    assert per_record_paths(model, ["pitch_inertia"], 2) == ("vehicle.pitch_inertia",)


def test_the_weights_are_the_noise_of_each_channel(motions):
    assert {score.channel: score.rmse for score in motions.scores} == pytest.approx(NOISE, rel=0.06)
    assert motions.inflation == 1.0
    noise, end = motions._evidence.noise, motions._evidence.minimum
    count, free = end.jacobian.shape
    assert float(np.mean(noise.sigma**2)) == pytest.approx(end.squares / (count - free), rel=1e-6)


def test_a_result_shows_itself(motions, record):
    assert motions["stroke.offset"].unit == "m" and motions["damper.rate"].unit == "N s/m"
    with pytest.raises(KeyError, match="No parameter is named 'sprung_mass'"):
        motions["sprung_mass"]
    told = motions.to_dict()
    assert told["converged"] is True and told["scores"][0]["rmse"]["unit"] == "m/s^2"
    assert "vehicle.damper.rate" in repr(motions) and "Channels" in str(motions.scores_table())


def test_a_fitted_vehicle_predicts_a_record_that_it_was_not_fitted_to(motions, record):
    rows = {score.channel: score.rmse for score in motions.scores}
    assert {s.channel: s.rmse for s in motions.score(record)} == pytest.approx(rows, rel=1e-6)
    how = {"sampling_rate": 250.0, "finer": 4, "sensors": SENSORS, "name": "new", "seed": 3}
    new = identify.virtual_ride(CAR, SWEEP, NOISE, **how)
    assert {s.channel: s.rmse for s in motions.score([new])} == pytest.approx(rows, rel=0.1)


@pytest.mark.exhaustive
def test_a_result_is_drawn_and_predicts_its_records(motions, record):
    with shown_in(Display(sign="compression-positive")):
        axes = motions.plot().axes
    turned = [score.channel == "stroke" for score in motions.scores for _ in ("record", "residual")]
    assert [panel.yaxis_inverted() for panel in axes] == turned and len(axes) == 4
    predicted = motions.respond(record)["stroke"]
    assert np.std(predicted - record["stroke"]) == pytest.approx(2e-4, rel=0.05)


@pytest.mark.slow
def test_a_measured_force_shows_the_scale():
    noise = {**NOISE, "dynamic_tyre_load": 20.0}
    loads = identify.virtual_ride(CAR, SWEEP, noise, sampling_rate=250.0, finer=4, sensors=SENSORS, seed=2)
    result = identify.fit_vehicle(START, loads, over=FREE, sensors=ZERO, dt=2e-3)
    assert not result.held and not result.warnings
    assert_recovered(result, CAR)
    assert result["sprung_mass"].standard_error < 3.0


@pytest.mark.slow
def test_measured_wheel_forces_drive_the_vehicle_without_its_tyres():
    road = roads.iso8608("C", speed=20.0, seed=4)
    how = {"sampling_rate": 500.0, "finer": 4, "driven_by": "forces", "duration": 4.0}
    ride = identify.virtual_ride(CAR, road, NOISE, sensors=SENSORS, seed=2, **how)
    over = [name for name in FREE if name != "tyre_stiffness"]
    result = identify.fit_vehicle(replace(START, {"sprung_mass": 250.0}), ride, over=over, sensors=ZERO)
    assert not result.held and not result.warnings
    assert_recovered(result, CAR)


@pytest.mark.exhaustive
def test_bench_and_ride_records_together_beat_either_alone(record, motions):
    runs = bench.VirtualDyno(CAR.damper, force_noise=10.0, gas_force=-80.0, sampling_rate=200.0).run(
        [bench.SineTest(0.02, 1.0), bench.SineTest(0.01, 3.0)]
    )
    begin = Rig(gas_force=-50.0)
    options = {"over": FREE, "sensors": ZERO, "dt": 2e-3}
    alone = identify.fit(START, record, freeze=["sprung_mass"], **options)
    on_bench = identify.fit(Linear(1100.0), runs, rig=begin)
    both = identify.fit(START, record, bench={"damper": runs}, rig=begin, freeze=["sprung_mass"], **options)
    error = both["damper.rate"].standard_error
    assert error < 0.9 * min(alone["damper.rate"].standard_error, on_bench["law.rate"].standard_error)
    # A known mass gives the scale; without one, the force of the bench does.
    assert not alone.warnings and not alone.scale_free
    assert alone["damper.rate"].value == pytest.approx(motions["damper.rate"].value / 1.1, rel=1e-6)
    unknown = identify.fit(START, record, bench={"damper": runs}, rig=begin, **options)
    assert not unknown.held and unknown["sprung_mass"].standard_error < 3.0
    for result in (both, unknown):
        assert_recovered(result, CAR, true_rig=Rig(gas_force=-80.0))


def wrong(**changed):
    time = np.arange(100) / 250
    given = {"name": "one", "time": time, "road": np.sin(time), "channels": {"stroke": np.sin(3 * time)}} | changed
    return bench.RideRecord(**given)


@pytest.mark.parametrize(
    ("records", "options", "message"),
    [
        ([], {}, "`records` must hold at least one"),
        ({"A": wrong()}, {}, "be one or more records of one vehicle, but is a dict of 1"),
        ([wrong(channels={"strok": np.sin(np.arange(100.0))})], {}, "Did you mean 'stroke'"),
        ([wrong(units={"stroke": "m/s"})], {}, "in the units of the vehicle, m, but is m/s for 'stroke'"),
        ([wrong(road=np.ones((100, 2)) * np.arange(100.0)[:, None])], {}, "a column for each of 1 wheel"),
        ([wrong(), wrong()], {}, "have names that differ"),
        ([wrong()], {"sensors": {"sprung_acceleration": Sensor(offset=0.0)}}, "`sensors` must be one of 'stroke'"),
        ([wrong()], {"bench": {"dampr": []}}, "name laws of the vehicle, which 'dampr' is not"),
        ([wrong()], {"over": ["spring"]}, "No parameter is named 'spring'"),
        ([wrong()], {"start": "moving"}, "`start` must be one of 'rest', 'free'"),
        ([wrong()], {"per_record": ["sprung_mass"]}, "differ between several records"),
        (
            [wrong(), wrong(name="two")],
            {"per_record": ["sprung_mass"], "freeze": ["sprung_mass"]},
            "which is held at its start. Remove it from `freeze`",
        ),
        ([wrong()], {"noise": {"pitch": 1.0}}, "`noise` must be one of 'stroke'"),
        ([wrong()], {"weighting": "runs"}, "weighting"),
        ([wrong()], {"settling": 0.3}, "leave at least half"),
        ([wrong()], {"rig": Rig(gas_force=-1.0)}, "come with bench records"),
    ],
)
def test_wrong_calls_are_refused(records, options, message):
    with pytest.raises((ValueError, TypeError), match=message):
        identify.fit(CAR, records, **options)


@pytest.mark.slow
def test_a_rig_with_friction_in_its_guides_on_a_sweep_and_a_road():
    car = QuarterCar(300.0, 40.0, 20e3, 180e3, Bilinear(1800.0, 900.0), tyre_damping=100.0)
    rig = Guided(car, (Guide(CoulombFriction(40.0, 0.02)),))
    noise = {"sprung_acceleration": 0.05, "unsprung_acceleration": 0.3, "stroke": 1e-4}
    true = {
        "sprung_acceleration": Sensor(offset=0.15, lag=2e-3, high_pass=0.4),
        "unsprung_acceleration": Sensor(offset=-0.3, lag=2e-3),
        "stroke": Sensor(offset=1.5e-3, delay=1e-3),
    }
    road = roads.iso8608("C", speed=20.0, seed=4)
    options = {"sensors": true, "finer": 2, "sampling_rate": 1000.0}
    records = [
        identify.virtual_ride(rig, SWEEP, noise, name="sweep", **options),
        identify.virtual_ride(rig, road, noise, duration=4.0, name="road", **options),
    ]
    changed = {"unsprung_mass": 50.0, "spring_rate": 15e3, "rebound_rate": 1200.0, "compression_rate": 1200.0}
    start = replace(rig, {**changed, "friction_force": 15.0, "tyre_stiffness": 220e3})
    guess = {name: Sensor(offset=0.0, lag=0.0) for name in true} | {"stroke": Sensor(offset=0.0, delay=0.0)}
    guess["sprung_acceleration"] = Sensor(offset=0.0, lag=0.0, high_pass=0.8)
    frozen = ["friction_velocity", "guides.0.stiffness", "guides.0.damping"]
    result = identify.fit(start, records, sensors=guess, freeze=frozen)
    assert result.held == ("vehicle.car.sprung_mass",)
    assert_recovered(result, rig, true)


@pytest.mark.slow
def test_what_sensors_add_and_the_fit_leaves_out_is_named_with_its_size():
    true = {"sprung_acceleration": Sensor(lag=2e-3, offset=0.1), "stroke": Sensor(gain=1.05, delay=-1e-3)}
    ride = identify.virtual_ride(CAR, SWEEP, NOISE, sampling_rate=250.0, finer=4, sensors=true, seed=2)
    result = identify.fit(START, ride, over=FREE, freeze=["sprung_mass"], dt=2e-3)
    told = " ".join(result.warnings)
    for text in (
        r"sprung_acceleration comes (1\.[6-9]|2\.[0-4])\d* ms too late",
        r"a zero error of 0\.(09|10)\d* m/s\^2",
    ):
        assert re.search(text, told), told
    for text in (r"stroke comes (0\.[7-9]|1\.[0-3])\d* ms too early", r"stroke has a gain of 1\.0[45]"):
        assert re.search(text, told), told


@pytest.mark.parametrize(("rate", "steps"), [(250.0, 4), (300.0, 4), (500.0, 2), (1000.0, 2)])
def test_virtual_records_take_steps_of_a_millisecond_or_less(rate, steps):
    def drive(**how):
        return identify.virtual_ride(CAR, SWEEP, {"unsprung_acceleration": 0.0}, sampling_rate=rate, **how)

    found, same, exact = (d["unsprung_acceleration"] for d in (drive(), drive(finer=steps), drive(finer=32)))
    np.testing.assert_array_equal(found, same)
    assert np.std(found - exact) < 1e-3 * np.std(exact)


@pytest.mark.slow
def test_payload_and_offset_of_each_record_and_its_initial_motion():
    loads, records = (300.0, 360.0), []
    for mass, offset in zip(loads, (0.1, -0.2), strict=True):
        sensors = {"sprung_acceleration": Sensor(offset=offset)}
        car = replace(CAR, {"sprung_mass": mass})
        ride = identify.virtual_ride(
            car,
            SWEEP,
            NOISE,
            sampling_rate=250.0,
            finer=4,
            sensors=sensors,
            name=f"{mass:g} kg",
            start={"z_sprung": 0.02},
        )
        records.append(ride)
    result = identify.fit_vehicle(
        START,
        records,
        over=FREE,
        freeze=["spring_rate"],
        sensors={"sprung_acceleration": Sensor(offset=0.0)},
        per_record=["sprung_mass", "offset"],
        start="free",
        dt=2e-3,
    )
    scale = 16e3 / 20e3  # the rate that was frozen is wrong, and all masses follow it
    for i, mass in enumerate(loads):
        found = result[f"sprung_mass[{i}]"]
        assert abs(found.value - scale * mass) < 3.5 * found.standard_error
        assert f"{mass:g} kg" in found.meaning
        begin = result[f"starts.{i}.position[0]"]
        assert abs(begin.value - 0.02) < 3.5 * begin.standard_error
    assert result["offset[1]"].value == pytest.approx(-0.2, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("reversed_channel", ["stroke", "sprung_acceleration"])
def test_a_reversed_channel_is_named(record, reversed_channel):
    channels = dict(record.channels) | {reversed_channel: -record[reversed_channel]}
    wrong_sign = dataclasses.replace(record, channels=channels)
    result = identify.fit(START, wrong_sign, over=FREE, freeze=["sprung_mass"], sensors=ZERO, dt=2e-3)
    against = r"(fitted vehicle|vehicle of the start) \(correlation -0"
    assert re.search(rf"{reversed_channel} of sweep runs against the {against}", " ".join(result.warnings))


def test_of_two_channels_that_run_against_each_other_the_start_tells_the_wrong_one():
    """A fit to a reversed stroke bends the car, so that the acceleration, which is right, runs against it."""

    def scores(*pairs: tuple[float, float]) -> list[identify.ChannelScore]:
        each = zip(("sprung_acceleration", "stroke"), pairs, strict=True)
        return [identify.ChannelScore("sweep", name, "", 1.0, percent, 1.0, alike) for name, (percent, alike) in each]

    (note,) = on_signs(scores((0.0, -0.64), (43.5, 0.8)), scores((20.0, 0.61), (0.0, -0.77)))
    assert note.startswith("stroke of sweep runs against the vehicle of the start (correlation -0.77)")
    (unsure,) = on_signs(scores((0.0, -0.64), (43.5, 0.8)), scores((0.0, 0.1), (0.0, 0.2)))
    assert unsure.startswith("sprung_acceleration of sweep runs against the fitted vehicle")


@pytest.mark.slow
@pytest.mark.parametrize("size", [10.0, 1.0 / 9.80665])
def test_a_channel_in_another_unit_is_named(record, size):
    channels = dict(record.channels) | {"sprung_acceleration": size * record["sprung_acceleration"]}
    wrong = dataclasses.replace(record, channels=channels)
    how = {"over": FREE, "freeze": ["sprung_mass"], "dt": 2e-3}
    told = identify.fit(START, wrong, sensors=ZERO, **how).warnings
    (named,) = (
        float(found[1]) for text in told if (found := re.match(r"sprung_acceleration of sweep is (\S+) times", text))
    )
    assert named == pytest.approx(size, rel=0.4)
    assert not any("stroke of sweep is" in text or "has a gain" in text for text in told)
    gain = ZERO | {"sprung_acceleration": Sensor(gain=1.0)}
    assert not any(
        "times what the vehicle" in text for text in identify.fit(START, wrong, sensors=gain, **how).warnings
    )


@pytest.mark.slow
def test_numbers_of_sensors_need_no_tangents_through_the_vehicle(record):
    """The columns of sensors are derivatives of what the simulation gave, and those of the vehicle do not change."""
    sensors = {"stroke": Sensor(offset=1e-3, gain=1.1), "sprung_acceleration": Sensor(offset=0.1, lag=2e-3)}
    model = VehicleTest(CAR, sensors)
    (part,) = ride_batches((record,), drives_of(CAR, (record,), 2e-3), NOISE)
    held = [f"sensors.{name}.{p.path}" for name, s in sensors.items() for p in parameters(s) if p.path not in s.given]
    free = free_parameters(model, over=["sensors.**", "damper.rate", "spring_rate"], freeze=held)
    widths = list[int]()

    def noted(tangent):
        widths.append(1 if tangent.ndim == 1 else len(tangent))
        return tangent

    @jax.custom_jvp
    def counted(values):
        return values

    @counted.defjvp
    def _(values, tangents):
        kind = jax.ShapeDtypeStruct(tangents[0].shape, tangents[0].dtype)
        return values[0], jax.pure_callback(noted, kind, tangents[0], vmap_method="expand_dims")

    settled = vehicle_residuals.settled
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vehicle_residuals, "settled", lambda system, heights: counted(settled(system, heights)))
        residual, jacobian = linearised(free, free.values, (part,))
    assert widths == [2]  # the rates of the vehicle, none of the numbers of its sensors
    for i, (name, value) in enumerate(zip(free.names, np.asarray(free.values), strict=True)):
        step = 1e-4 * max(abs(float(value)), 1e-2)
        ends = [part(free.build(free.values.at[i].set(value + side * step))) for side in (-1.0, 1.0)]
        slope = np.asarray(ends[1] - ends[0]) / (2.0 * step)
        assert np.linalg.norm(slope - jacobian[:, i]) < 1e-5 * np.linalg.norm(slope), name
    np.testing.assert_allclose(residual, part(model), rtol=1e-9, atol=1e-9)
