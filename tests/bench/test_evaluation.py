"""Evaluations against closed forms: linear, bilinear with gas and friction, lagging, with a knee."""

import json
from dataclasses import replace

import numpy as np
import pytest

from jaxdamp._display import Display, shown_in
from jaxdamp.bench import BenchRun, Limit, SineTest, VirtualDyno, evaluate, read, read_limits, separate_gas_and_friction
from jaxdamp.bench.evaluation.limits import UNITS
from jaxdamp.dampers import Bilinear


REBOUND, COMPRESSION, GAS, RATE, FRICTION = 2600.0, 1200.0, -150.0, 800.0, 40.0  # N s/m, N s/m, N, N/m, N
WINDOW = np.sin(np.arccos(0.98)) / np.arccos(0.98)  # mean of a cosine over its samples above 0.98


def sine(amplitude, frequency, force, *, name="", cycles=6, noise=0.0, seed=0, **more):
    """A record of a sine that begins off mid-stroke; `force` takes stroke, velocity and phase."""
    omega = 2 * np.pi * frequency
    time = np.arange(round(800 * cycles)) / (800 * frequency)
    angle = omega * time + 0.4
    stroke, velocity = amplitude * np.sin(angle), omega * amplitude * np.cos(angle)
    values = force(stroke, velocity, angle) + noise * np.random.default_rng(seed).standard_normal(len(time))
    return BenchRun(name or f"{1e3 * amplitude:g} mm {frequency:g} Hz", time, stroke, velocity, values, **more)


def bilinear(x, v, _=None):
    return np.where(v > 0, REBOUND, COMPRESSION) * v + GAS + RATE * x + FRICTION * np.sign(v)


def kneed(x, v, _=None):
    return np.sign(v) * (3000.0 * np.minimum(np.abs(v), 0.15) + 500.0 * np.maximum(np.abs(v) - 0.15, 0.0))


FREQUENCIES = (0.2, 1.0, 2.0, 4.0)  # of 20 mm: 0.025 to 0.50 m/s


@pytest.fixture(scope="module")
def evaluation():
    return evaluate([sine(0.02, f, bilinear, noise=1.0) for f in FREQUENCIES])


# ---- records


def test_energy_and_equivalent_damping_of_each_record(evaluation):
    for frequency in FREQUENCIES:
        omega = 2 * np.pi * frequency
        energy = np.pi * omega * 0.02**2 * (REBOUND + COMPRESSION) / 2 + 4 * FRICTION * 0.02
        record = f"20 mm {frequency:g} Hz"
        assert evaluation.get("energy per cycle", record=record).value == pytest.approx(energy, rel=1e-3)
        damping = evaluation.get("equivalent damping", record=record)
        assert damping.value == pytest.approx(energy / (np.pi * omega * 0.02**2), rel=1e-3)
        assert damping.unit == "N s/m" and damping.count == 5


def test_peak_and_mid_stroke_forces_and_their_ratio(evaluation):
    peak = 2 * np.pi * 4.0 * 0.02
    found = {name: evaluation.get(name, record="20 mm 4 Hz").value for name in (
        "rebound force", "compression force", "mid-stroke rebound force", "rebound/compression ratio")}  # fmt: skip
    rebound, compression = REBOUND * WINDOW * peak + GAS + FRICTION, -COMPRESSION * WINDOW * peak + GAS - FRICTION
    assert found["rebound force"] == pytest.approx(rebound, abs=2.0)
    assert found["compression force"] == pytest.approx(compression, abs=2.0)
    assert found["rebound/compression ratio"] == pytest.approx(-rebound / compression, rel=2e-3)
    central = np.arcsin(0.1)  # within 10 % of the range to both sides together
    middle = REBOUND * peak * np.sin(central) / central + GAS + FRICTION
    assert found["mid-stroke rebound force"] == pytest.approx(middle, rel=2e-3)


def test_hysteresis_of_a_lag_and_of_a_spring():
    lag, peak = 0.3, 2 * np.pi * 2.0 * 0.01
    loop = evaluate(sine(0.01, 2.0, lambda x, v, angle: 2000.0 * peak * np.cos(lag) * np.cos(angle - lag)))
    size = 2000.0 * peak * np.cos(lag) * np.sin(lag)
    assert loop.get("hysteresis area").value == pytest.approx(np.pi * peak * size, rel=1e-3)
    assert loop.get("hysteresis width").value == pytest.approx(2 * size, rel=2e-3)
    spring = evaluate(sine(0.01, 2.0, lambda x, v, _: 2000.0 * v + 5000.0 * x))
    assert spring.get("hysteresis width").value == pytest.approx(2 * 5000.0 * 0.01, rel=2e-3)
    # ∮ k x dv of a spring is −k times the area of the orbit
    assert spring.get("hysteresis area").value == pytest.approx(5000.0 * np.pi * 0.01 * peak, rel=1e-3)


def test_scatter_is_that_of_the_cycles():
    heating = sine(0.02, 1.0, lambda x, v, angle: 2000.0 * v * (1 - 0.02 * np.floor((angle + 1e-9) / (2 * np.pi))))
    damping = evaluate(heating).get("equivalent damping")
    assert damping.count == 5
    assert damping.scatter == pytest.approx(2000.0 * 0.02 * np.std(np.arange(5), ddof=1), rel=0.1)


# ---- gas and friction


BENT = {
    "straight": lambda v: np.where(v > 0, 2600.0, 1200.0) * v,
    "digressive": lambda v: np.where(v > 0, 900.0, -400.0) * (1 - np.exp(-np.abs(v) / 0.06)) + 400.0 * v,
    "orifice": lambda v: np.where(v > 0, 4e4, -1.5e4) * v**2 + 300.0 * v,
}


@pytest.mark.parametrize("law", BENT)
def test_uncertainty_holds_gas_and_friction_where_damping_bends(law):
    time = np.arange(0.0, 12.0, 1 / 400)
    velocity = 0.02 * np.pi * np.cos(np.pi * time)
    for seed in range(10):
        noise = 3.0 * np.random.default_rng(seed).standard_normal(len(time))
        force = BENT[law](velocity) - 150.0 + 40.0 * np.tanh(velocity / 0.002) + noise
        found = separate_gas_and_friction(BenchRun.from_arrays("slow", time, 0.02 * np.sin(np.pi * time), force))
        named = {m.quantity: m for m in found.measurements}
        for quantity, truth, most in (("gas force", -150.0, 16.0), ("friction", 40.0, 36.0)):
            uncertainty = named[quantity].uncertainty
            assert uncertainty is not None
            assert abs(named[quantity].value - truth) <= uncertainty <= most, (quantity, seed)


def test_gas_and_friction_of_a_slow_record(evaluation):
    found = evaluation.gas_and_friction[""]
    assert found.record == "20 mm 0.2 Hz" and not found.note
    assert found.gas_force == pytest.approx(GAS, abs=1.0)
    assert found.gas_rate == pytest.approx(RATE, rel=0.02)
    assert found.friction == pytest.approx(FRICTION, abs=1.0)
    assert evaluation.get("rebound bleed rate").value == pytest.approx(REBOUND, rel=0.02)
    peak = 2 * np.pi * 0.2 * 0.02
    middle = len(found.stroke) // 2
    assert found.odd[middle] == pytest.approx(FRICTION + 0.5 * (REBOUND + COMPRESSION) * peak, abs=1.5)
    assert found.even[middle] == pytest.approx(GAS + 0.5 * (REBOUND - COMPRESSION) * peak, abs=1.5)
    np.testing.assert_allclose(found.static_force(np.array([0.0, 0.01])), [GAS, GAS + 0.01 * RATE], atol=1.5)


def test_under_a_triangle_the_friction_contains_the_damping_and_it_is_said():
    time = np.arange(4000) / 500
    stroke = 0.01 * (2 * np.abs(2 * ((time / 2 + 0.13) % 1.0) - 1) - 1)
    velocity = 0.02 * np.sign(np.gradient(stroke))
    run = BenchRun("quasi-static", time, stroke, velocity, bilinear(stroke, velocity))
    found = separate_gas_and_friction(run)
    assert "friction contains the damping at 0.02 m/s" in found.note
    assert found.friction == pytest.approx(FRICTION + 0.02 * 0.5 * (REBOUND + COMPRESSION), rel=0.01)
    assert "bleed" not in "".join(m.quantity for m in found.measurements if np.isfinite(m.value))


def test_a_record_that_is_too_fast_to_separate_is_said():
    time = np.arange(90) / 300
    angle = 30 * np.pi * time + 0.1
    quick = BenchRun.from_arrays("few samples", time, 0.05 * np.sin(angle), np.cos(angle))
    evaluation = evaluate(quick)
    assert not evaluation.gas_and_friction and "`up_to` must leave four samples" in evaluation.notes[0]


# ---- the curve


@pytest.mark.parametrize("method", ["interpolation", "loop"])
def test_forces_at_stated_velocities(method, evaluation):
    if method == "loop":
        evaluation = evaluate(evaluation.runs, method="loop", velocities=(0.131, 0.262, 2.0))
    assert evaluation.method == method
    for velocity in (0.131, 0.262):
        rebound = evaluation.get("rebound force", velocity=velocity)
        assert rebound.value == pytest.approx(REBOUND * velocity + GAS + FRICTION, abs=2.0)
        compression = evaluation.get("compression force", velocity=velocity).value
        assert compression == pytest.approx(-COMPRESSION * velocity + GAS - FRICTION, abs=2.0)
        assert rebound.scatter is not None and rebound.scatter < 3.0
        ratio = evaluation.get("rebound/compression ratio", velocity=velocity).value
        assert ratio == pytest.approx(-rebound.value / compression)
    if method == "loop":
        assert np.isnan(evaluation.get("rebound force", velocity=2.0).value)  # never extrapolated
    else:
        assert evaluation.velocities == (0.052, 0.131, 0.262, 0.393)


def test_records_that_reach_no_usual_velocity_state_another_and_say_so():
    dyno = VirtualDyno(Bilinear(2000.0, 1000.0))
    runs = dyno.run([SineTest(0.02, f) for f in (1.4, 1.65)])  # 0.176 and 0.207 m/s
    between = evaluate(runs)
    assert between.velocities == (0.2,) and len(between.table().rows) == 3
    assert between.get("rebound force", velocity=0.2).value == pytest.approx(400.0, rel=1e-3)
    assert "the records give forces from 0.175 to 0.206 m/s. Forces are stated at 0.2 m/s." in between.notes[0]
    slow = evaluate(dyno.run([SineTest(0.005, 1.0)]))  # 0.0314 m/s, on its loop
    assert slow.velocities == (0.031,)
    assert slow.get("compression force", velocity=0.031).value == pytest.approx(-31.0, rel=0.01)
    beyond = evaluate(runs, velocities=(0.2, 0.3))
    assert beyond.notes[0] == "No force at 0.3 m/s: the records give forces from 0.175 to 0.206 m/s."
    assert len(beyond.table().rows) == 3


def test_a_window_takes_records_near_the_stated_velocity_only(evaluation):
    found = evaluate(evaluation.runs, method="window", window=0.06, velocities=(0.131, 0.2))
    near = found.get("rebound force", velocity=0.131)
    assert near.value == pytest.approx(REBOUND * WINDOW * 2 * np.pi * 0.02 + GAS + FRICTION, abs=2.0)
    assert np.isnan(found.get("rebound force", velocity=0.2).value)


def test_rates_and_knee():
    found = evaluate([sine(0.02, 4.0, kneed, noise=2.0), sine(0.02, 0.5, kneed, noise=2.0)])
    for direction in ("rebound", "compression"):
        assert found.get(f"{direction} low-speed rate").value == pytest.approx(3000.0, rel=0.01)
        assert found.get(f"{direction} high-speed rate").value == pytest.approx(500.0, rel=0.02)
        knee = found.get(f"{direction} knee velocity")
        assert knee.value == pytest.approx(0.15, rel=0.01) and knee.scatter is not None


def test_a_straight_curve_has_one_rate_and_no_knee(evaluation):
    assert evaluation.get("rebound rate").value == pytest.approx(REBOUND, rel=0.01)
    with pytest.raises(ValueError, match="`quantity` must be one of"):
        evaluation.get("rebound knee velocity")


# ---- settings, repeats, limits


@pytest.fixture(scope="module")
def two_settings():
    def soft(x, v, _):
        return 0.5 * bilinear(x, v)

    runs = [sine(0.02, f, law, name=f"{name} {f:g} Hz", command=command)
            for command, name, law in ((3.0, "hard", bilinear), (1.0, "soft", soft)) for f in (0.5, 2.0)]  # fmt: skip
    return evaluate([*runs, replace(runs[1], name="hard again", force=1.1 * runs[1].force)])


def test_settings_stand_side_by_side_in_the_order_of_their_command(two_settings):
    assert list(two_settings.settings) == ["1", "3"]
    table = two_settings.table()
    assert [c.name for c in table.columns] == ["quantity", "unit", "1", "3", "change"]
    row = next(row for row in table.records() if row["quantity"] == "rebound force at 0.131 m/s")
    assert float(row["change"]) == pytest.approx(100 * (float(row["3"]) / float(row["1"]) - 1))
    gas = next(row for row in two_settings.settings_table().records() if row["quantity"] == "gas force")
    assert (float(gas["1"]), float(gas["3"])) == pytest.approx((GAS / 2, GAS), abs=1.0)
    other = evaluate(two_settings.runs, by=lambda run: run.name.split()[0])
    assert set(other.settings) == {"hard", "soft"}


def test_repeated_records_are_averaged_with_their_scatter(two_settings):
    rows = two_settings.tables()["repeats"].records()
    energy = next(row for row in rows if row["quantity"] == "energy per cycle")
    one = two_settings.get("energy per cycle", record="hard 2 Hz").value
    assert energy["records"] == "hard 2 Hz, hard again"
    assert energy["mean"] == pytest.approx(1.05 * one) and energy["scatter"] == pytest.approx(0.1 * one / np.sqrt(2))


def test_limits_from_a_table_pass_and_fail(two_settings, tmp_path):
    path = tmp_path / "limits.csv"
    path.write_text(
        "quantity;velocity [mm/s];setting;minimum [daN];maximum [daN]\n"
        "rebound force;131;3;20,0;30,0\n"
        "gas force;;*;-20,0;-10,0\n"
        "rebound force;5e3;;0;\n"
        "compression force;188,0;3;-44,0;-39,0\n"  # at none of the usual velocities
    )
    limits = read_limits(path)
    assert limits[0] == Limit("rebound force", 200.0, 300.0, 0.131, "3")
    check = two_settings.check(limits)
    verdicts = [row["verdict"] for row in check.table().records()]
    assert verdicts == ["passed", "FAILED", "passed", "NOT MEASURED", "NOT MEASURED", "passed"] and not check.passed
    assert check.warnings[1].startswith(
        "rebound force at 5 m/s of setting 1: NOT MEASURED: the records give forces from"
    )
    stated = evaluate(two_settings.runs, velocities=[0.188]).get("compression force", setting="3", velocity=0.188)
    assert check.results[-1][1] == stated
    assert two_settings.check([Limit("friction", maximum=50.0)]).passed
    assert json.loads(json.dumps(check.to_dict(), allow_nan=False))["passed"] is False
    energy = two_settings.check([Limit("energy per cycle", minimum=0.0, record="hard*")])
    assert len(energy.results) == 3


def test_limits_are_shown_in_the_units_and_the_sign_of_a_shop(evaluation):
    check = evaluation.check([Limit("rebound force", 700, 760, velocity=9), Limit("friction", 0.0, 50.0, record="x")])
    with shown_in(Display("imperial", "compression-positive")):
        force, friction = check.table().shown().records()
    pound = 4.4482216152605
    assert (force["velocity"], force["unit"]) == (pytest.approx(9 / 0.0254), "lbf")
    assert (force["minimum"], force["maximum"]) == pytest.approx((-760 / pound, -700 / pound))
    assert friction["maximum"] == pytest.approx(50 / pound) and friction["verdict"] == "NOT MEASURED"


def test_limits_know_the_unit_of_every_quantity(evaluation, two_settings):
    straight = evaluate([sine(0.02, f, kneed) for f in (0.5, 2.0)])
    measured = {m.quantity: m.unit for e in (evaluation, two_settings, straight) for m in e.measurements}
    assert measured == UNITS


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,minimum\nx,1\n", "line 1: there is no column 'quantity'"),
        ("quantity,least\nx,1\n", "column 'least' is unknown"),
        ("quantity,minimum\nfriction,1\ngas force,five\n", "line 3: the minimum is 'five', which is no number"),
        ("quantity,minimum [mm]\nfriction,1\n", "2: .*`minimum` must have a unit of 'friction' .*'N', but is 'mm'"),
        ("quantity,minimum [N]\nrebound/compression ratio,2\n", "`minimum` must have no unit for 'rebound/compression"),
        ("quantity,velocity,minimum\nrebound force,-0.1,1\n", "`velocity` must be positive"),
        ("quantity;minimum\nfriction;1,200\n", "line 2: the comma in '1,200' may be a decimal sign"),
        ("quantity,minimum,maximum\nfriction,,\n", "line 2: .*`minimum` must be given"),
        ("quantity,minimum,maximum\nfriction,1,2\nfriction,nan,2\n", "line 3: .*`minimum` must be finite, but is nan"),
        ("quantity,minimum,maximum\nfriction,1,inf\n", "line 2: .*`maximum` must be finite.*Leave it out where"),
        ("quantity,minimum,maximum\nfriction,3,2\n", "line 2: .*`minimum` must be at most"),
    ],
)
def test_limits_that_are_wrong_are_refused_with_their_place(text, message, tmp_path):
    (tmp_path / "limits.csv").write_text(text)
    with pytest.raises(ValueError, match=message):
        read_limits(tmp_path / "limits.csv")


def test_a_mistyped_quantity_is_not_silently_unmeasured(evaluation):
    with pytest.raises(ValueError, match="Did you mean 'gas force'"):
        evaluation.check([Limit("gas forse", minimum=0.0)])


# ---- what cannot be evaluated


def test_what_cannot_be_evaluated_is_refused_or_said(evaluation):
    time = np.arange(50) / 100
    half = BenchRun.from_arrays("half", time, 0.01 * np.sin(2 * time), np.cos(2 * time))
    assert "half has no full cycle" in evaluate([half, sine(0.01, 1.0, bilinear)]).notes[0]
    with pytest.raises(ValueError, match="record with a full cycle, but is only 'half'"):
        evaluate(half)
    with pytest.raises(ValueError, match="`velocities` must be positive"):
        evaluate(evaluation.runs, velocities=(-0.1,))
    with pytest.raises(ValueError, match="Did you mean 'loop'"):
        evaluate(evaluation.runs, method="lop")
    with pytest.raises(ValueError, match=r"name one measurement.*there are 4"):
        evaluation.get("mean force")


def test_plain_data_text_and_pictures(two_settings):
    plain = json.loads(json.dumps(two_settings.to_dict(), allow_nan=False))
    assert len(plain["measurements"]) == len(two_settings.measurements)
    assert "Forces of each record" in repr(two_settings) and "±" in repr(two_settings)
    check = two_settings.check([Limit("rebound force", 0.0, 1.0, velocity=0.131)])
    figure = two_settings.plot(baseline=two_settings, limits=check)
    assert {axes.get_title(loc="left") for axes in figure.axes} >= {"Force over stroke", "Force over acceleration"}
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[:3] == ["baseline", "setting 1", "setting 3"] and labels[-1] == "limits, not kept"
    over_time = next(axes for axes in figure.axes if axes.get_title(loc="left") == "Force over time")
    bands, loops = over_time.collections, len(two_settings.runs) + len(two_settings.runs)  # of the baseline too
    assert (
        "± scatter over cycles" in labels
        and len([band for band in bands if band.get_paths()[0].vertices.size]) == loops
    )
    assert two_settings.gas_and_friction["1"].plot().axes
    assert two_settings.gas_and_friction["1"].to_dict()["record"] == "soft 0.5 Hz"


def test_measured_records_by_current(data):
    commands = {"*_0A": 0.0, "*_0.5A": 0.5, "*_1.0A": 1.0}
    found = evaluate(read(sorted((data / "mr_damper").glob("*.csv")), sign="rebound-positive", command=commands))
    friction = [found.get("friction", setting=setting).value for setting in ("0", "0.5", "1")]
    assert friction == sorted(friction) and 100.0 < friction[0] < 200.0 and friction[2] > 900.0
