"""Loops over steps printed as C for many points side by side give the numbers of `jax.lax.scan`."""

import ctypes
import re
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import Ride, roads, sweep, vehicles
from jaxdamp.codegen import _lanes, _native, _scan, compiler, printed_scan
from jaxdamp.dampers import Besinger, BoucWen, Lag, PiecewiseLinear, PowerLaw, SeriesSpring
from jaxdamp.metrics import Metric
from jaxdamp.simulation import Exponential, simulate
from jaxdamp.sweeps import running


pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")
SCANS = printed_scan, lambda step, carry, rows: by_jax(step, carry, rows)
ROWS = jnp.asarray(np.sin(np.arange(40.0)).reshape(20, 2), float)
RATE = "damper.rebound_rate"


def oscillator(scan):
    """Carried values of every kind: the same for all points, of each, and of each only after some steps."""

    def run(stiffness, shared=2.0):
        start = {"x": jnp.array([1.0, 0.0]), "clock": jnp.asarray(0.5), "late": jnp.zeros(3), "largest": 0.0 * shared}
        # `late` is passed on from entry to entry, so that its last one differs between points from the third step on

        def step(now, row):
            x, v = now["x"]
            force = jnp.tanh(stiffness * x) + shared * jnp.sum(row) + jnp.where(v > 0, 0.1, -0.2) * now["clock"]
            v = v - 0.1 * force
            late = jnp.stack([x, now["late"][0], now["late"][1]])
            after = {"x": jnp.stack([x + 0.1 * v, v]), "clock": now["clock"] * 1.01, "late": late}
            return after | {"largest": jnp.maximum(now["largest"], x)}

        return scan(step, start, ROWS)

    return run


def by_jax(step, carry, rows):
    return jax.lax.scan(lambda c, row: (step(c, row), None), carry, rows)[0]


@pytest.mark.parametrize("count", [1, 33])
def test_equal_to_scan(count):
    stiffness = jnp.linspace(0.5, 3.0, count)
    printed, plain = (jax.jit(jax.vmap(oscillator(scan)))(stiffness) for scan in (printed_scan, by_jax))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12), printed, plain)


def test_one_point_alone():
    jax.tree.map(
        lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12),
        jax.jit(oscillator(printed_scan))(1.5),
        oscillator(by_jax)(1.5),
    )


def test_what_is_not_finite_stays_in_its_lane():
    stiffness = jnp.linspace(0.5, 3.0, 40).at[7].set(jnp.nan)
    found = np.asarray(jax.vmap(oscillator(printed_scan))(stiffness)["x"])
    assert np.isnan(found[7]).all() and np.isfinite(np.delete(found, 7, axis=0)).all()


def test_limits_and_numbers_that_are_not_finite():
    """A limit, or what it limits, that is NaN gives NaN, as in JAX."""
    limit = jnp.linspace(0.5, 3.0, 40).at[3].set(jnp.nan).at[4].set(jnp.inf)
    start = jnp.linspace(0.0, 2.0, 40).at[5].set(jnp.nan)

    def step(limit, now, row):
        x, y = now
        return jnp.maximum(jnp.minimum(x + row[0], limit), -limit + row[1]), jnp.minimum(limit, y + row[0])

    def run(scan):
        def of_point(limit, start):
            return jnp.stack(scan(partial(step, limit), (start, start), ROWS))

        return np.asarray(jax.vmap(of_point)(limit, start))

    printed, plain = run(printed_scan), run(by_jax)
    assert np.isnan(printed[[3, 5]]).all() and np.isfinite(np.delete(printed, [3, 5], axis=0)).all()
    np.testing.assert_allclose(printed, plain, rtol=1e-14)


def test_a_value_at_the_end_of_a_step_is_that_at_the_beginning_of_the_next(monkeypatch):
    texts = []
    monkeypatch.setattr(_scan, "registered", lambda text: (texts.append(text), _native.registered(text))[1])

    def run(scan, rate):
        def force(v):
            return jnp.tanh(rate * v) + 0.5 * v - 0.1 * v * rate

        def step(now, row):
            v, lagged = now
            after = 0.9 * v - 0.01 * lagged + row[0] - 0.2 * rate * row[1]
            return after, 0.7 * lagged + 0.1 * force(v) + 0.2 * force(after)

        return scan(step, (jnp.asarray(1.0), jnp.asarray(0.0)), ROWS)

    rates = jnp.linspace(0.5, 3.0, 5)
    printed, plain = (jax.vmap(lambda rate, scan=scan: run(scan, rate))(rates) for scan in (printed_scan, by_jax))
    assert "KEPT = 1 " in texts[-1]
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12), printed, plain)


def test_knees_take_exponentials_only_where_they_are_rounded(monkeypatch):
    """A choice between numbers in memory is one of two that were read, not of two places."""
    texts = []
    monkeypatch.setattr(_scan, "registered", lambda text: (texts.append(text), _native.registered(text))[1])

    def run(scan, rate, width, other):
        def step(x, row):
            safe = jnp.where(width > 0.0, width, 1.0)
            knee = jnp.where(width > 0.0, safe * jnp.log1p(jnp.exp(x / safe)), jnp.maximum(x, 0.0))
            return 0.5 * x - 0.1 * rate * knee + row[0] * jnp.where(x > 0.0, width, other)

        return scan(step, jnp.asarray(0.3), ROWS)

    rates = jnp.linspace(0.5, 3.0, 40)
    program = {scan: jax.jit(jax.vmap(partial(run, scan), (0, None, None))) for scan in SCANS}
    for width in (0.0, 0.2, np.nan):
        printed, plain = (program[scan](rates, width, 2.0) for scan in SCANS)
        np.testing.assert_allclose(printed, plain, rtol=1e-12)
    simple, rounded = re.findall(r"IN_TURN\(\) \{(.*?)\n {16}\}", texts[-1], re.DOTALL)
    assert "exp(" not in simple and "exp(" in rounded and "? loaded0 : loaded1" in simple
    widths = jnp.tile(jnp.array([0.0, 0.2]), 20)  # side by side there are sharp and rounded ones
    each = [jax.jit(jax.vmap(partial(run, scan), (0, 0, None)))(rates, widths, 2.0) for scan in SCANS]
    np.testing.assert_allclose(*each, rtol=1e-12)


def searching(scan):
    """A step with loops in loops, each of another length for each point, and one of a fixed length."""

    def nested(now):
        left, x, rounds = now
        small, count = jax.lax.while_loop(
            lambda n: (0.5 * n[0] > 0.05) & (n[1] < 40), lambda n: (0.5 * n[0] + 0.01, n[1] + 1), (x, 0)
        )
        return left - 1.0, 0.7 * x + 0.1 * small + 0.001 * count, rounds + count

    def run(length, limit=2.0):
        def step(x, row):
            _, x, rounds = jax.lax.while_loop(lambda now: now[0] > 0.0, nested, (3.0 * length + row[0], x, 0))
            x = jnp.minimum(jax.lax.fori_loop(0, 3, lambda i, x: 0.9 * x + 0.01 * i, x), limit)
            return x + 0.1 * jnp.sin(row[1]) + 1e-4 * rounds

        return scan(step, jnp.asarray(1.0), ROWS)

    return run


@pytest.mark.parametrize("count", [1, 41])  # the last vectors have points of their own in part
def test_loops_inside_a_step(count):
    """Points that are done wait for the others; a condition of NaN ends the loop of its point only."""
    length = jnp.linspace(0.0, 30.0, count).at[count // 2].set(jnp.nan)
    printed, plain = (jax.jit(jax.vmap(searching(scan)))(length) for scan in (printed_scan, by_jax))
    np.testing.assert_allclose(printed, plain, rtol=1e-14)
    assert np.isfinite(printed).all() and (count == 1 or np.ptp(printed) > 0.01)


@pytest.mark.slow
def test_laws_with_functions():
    """Powers are exponentials of logarithms, in vectors; two searches in a step, which take exponentials."""
    with_its_loops(PowerLaw(1800.0, 0.55, 900.0, 1.8) + SeriesSpring(PiecewiseLinear([-0.1], [9e2, 2e3], 0.01), 1e6))


def test_the_kernel_compiled_as_c(monkeypatch):
    """The text that a GPU runs, with a loop in place of threads."""
    monkeypatch.setattr(_lanes.Loop, "text", property(lambda loop: loop.kernel))
    stiffness = jnp.linspace(0.5, 3.0, 5)
    printed, plain = (jax.jit(jax.vmap(oscillator(scan)))(stiffness) for scan in (printed_scan, by_jax))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12), printed, plain)


def with_its_loops(law):
    """The kernel of some steps of a ride, compiled as C in place of vectors, beside the numbers of XLA."""
    car, over = vehicles.presets.quarter_car_000(law), {"sprung_mass": np.linspace(250.0, 300.0, 5)}
    metric, engines = "rms_sprung_acceleration", [Exponential(printed=p) for p in (False, True)]
    plain, printed = (sweep(Ride(car, ROAD, metrics=[metric], duration=0.1, engine=e), over)[metric] for e in engines)
    np.testing.assert_allclose(printed, plain, rtol=1e-10)


# registers of a thread, of 255, and bytes that do not fit into them
LAWS = {
    "lag": (lambda law: Lag(law, 0.005), 180, 0),
    "series_spring": (lambda law: SeriesSpring(law, 1e6, 1e8), 220, 0),  # with loops
    "bouc_wen": (lambda law: BoucWen(1500.0, 2000.0, 300.0, 1e-3, exponent=1.5), 200, 0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_the_kernel_of_a_ride(monkeypatch, name):
    """The numbers of XLA from the text that a GPU runs, with its own loops; all of a thread stays in registers."""
    loops = []
    monkeypatch.setattr(_lanes.Loop, "text", property(lambda loop: (loops.append(loop), loop.kernel)[1]))
    law, registers, spilt = LAWS[name]
    with_its_loops(law(CAR.damper))
    for architecture in (80, 90):
        used = usage(loops[-1].kernel, architecture)
        assert used[0] <= registers and used[1] <= spilt, used


def usage(text, architecture):
    """Registers of a thread and bytes spilt."""
    report = _native.kernel(text, architecture).report
    return [int(re.findall(pattern, report)[0]) for pattern in (r"Used (\d+) registers", r"(\d+) bytes spill stores")]


def test_the_kernel_for_a_device(monkeypatch):
    """Compiled for its own architecture; what launches it compiles, and refuses to run on a processor."""
    pytest.importorskip("nvidia.cuda_nvrtc")
    devices = [SimpleNamespace(platform="gpu", compute_capability=number) for number in ("8.0", "9.0", "9.0")]
    kernels = []
    monkeypatch.setattr(_native.jax, "local_devices", lambda: devices)
    monkeypatch.setattr(_native.jax, "default_backend", lambda: "gpu")
    monkeypatch.setattr(
        _native, "launcher", lambda images, real=_native.launcher: (kernels.append(images), real(images))[1]
    )
    with pytest.raises(jax.errors.JaxRuntimeError, match=r"printed for the GPU, and runs on a processor.*default_dev"):
        jax.block_until_ready(jax.vmap(oscillator(printed_scan))(jnp.linspace(0.5, 3.0, 5)))
    assert [image[:4] for image in kernels[0]] == [b"\x7fELF"] * 2 and kernels[0][0] != kernels[0][1]
    with jax.default_device(jax.devices("cpu")[0]):
        assert not _native.on_gpu()


def test_the_right_compiler_of_several(monkeypatch):
    def installed(*versions):
        found = [_native.Compiler(ctypes.CDLL(None), (major, 0), frozenset(known)) for major, known in versions]
        monkeypatch.setattr(_native, "compilers", lambda: found)

    installed((12, [80, 90]), (13, [90, 100]), (11, [80]))
    monkeypatch.setattr(_native, "driver_version", lambda: None)
    assert [_native.compiler_for(a).version[0] for a in (80, 90, 100)] == [12, 13, 13]
    monkeypatch.setattr(_native, "driver_version", lambda: (12, 4))
    assert [_native.compiler_for(a).version[0] for a in (80, 90)] == [12, 12]
    message = r"for sm_100 and a driver of CUDA 12\.4: installed: 12\.0 \(up to sm_90\), 13\.0 \(up to sm_100\)"
    with pytest.raises(NotImplementedError, match=message):
        _native.compiler_for(100)
    installed()
    with pytest.raises(NotImplementedError, match=r"none is installed\. Install `nvidia-cuda-nvrtc-cu12`"):
        _native.compiler_for(90)


def test_a_text_that_is_no_kernel():
    pytest.importorskip("nvidia.cuda_nvrtc")
    with pytest.raises(NotImplementedError, match=r"NVRTC does not compile.*error"):
        _native.kernel("nothing", 90)


def test_refused_by_name(monkeypatch):
    def run(step, start, rows=ROWS):
        return jax.vmap(lambda x: printed_scan(lambda c, row: step(c, row, x), start, rows))(jnp.arange(3.0))

    with pytest.raises(NotImplementedError, match="A branch inside a step"):
        run(lambda c, row, x: jax.lax.cond(c < x, lambda c: c + row[0], lambda c: c, c), jnp.asarray(0.0))
    with pytest.raises(NotImplementedError, match="An array that loops read or write"):
        run(lambda c, row, x: jax.lax.scan(lambda c, y: (c + y, None), c, x + ROWS[:, 0])[0], jnp.asarray(0.0))
    with pytest.raises(NotImplementedError, match="loop in the condition of a loop"):
        run(
            lambda c, row, x: jax.lax.while_loop(
                lambda c: jax.lax.while_loop(lambda c: c < x, lambda c: c + 1.0, c) < 9.0, lambda c: c + 1.0, c
            ),
            jnp.asarray(0.0),
        )
    with pytest.raises(NotImplementedError, match="'rem' of whole numbers"):
        run(lambda c, row, x: c + (jax.lax.while_loop(lambda i: i < x, lambda i: i + 1, 0) % 2), jnp.asarray(0.0))
    with pytest.raises(NotImplementedError, match="int"):
        run(lambda c, row, x: c + 1, jnp.asarray(0))
    with pytest.raises(NotImplementedError, match=r"one table of rows for all .* Leave `printed` out"):
        jax.vmap(lambda rows: printed_scan(lambda c, row: c + row[0], jnp.asarray(0.0), rows))(jnp.ones((3, 5, 1)))
    with monkeypatch.context() as patched, pytest.raises(NotImplementedError, match=r"loaded here .* TMPDIR"):
        for folder in ("_lasting_folder", "_folder"):
            patched.setattr(_native, folder, lambda: Path("/nowhere"))
        run(lambda c, row, x: c + 0.321 * row[0] * x, jnp.asarray(0.0))
    monkeypatch.setattr(_native, "compiler", lambda: None)
    with pytest.raises(NotImplementedError, match="No C compiler"):
        run(lambda c, row, x: c + 0.123 * row[0] * x, jnp.asarray(0.0))


ROAD = roads.iso8608("C", speed=20.0, seed=1)
CAR = vehicles.presets.quarter_car_000(Besinger(1600.0, 4200.0, 900.0, limit_velocity=0.13, transition_velocity=0.05))


@pytest.mark.slow
def test_a_sweep_of_all_ride_metrics():
    over = {RATE: np.linspace(2e3, 5e3, 5), "sprung_mass": [250.0, 300.0]}
    plain, printed = (sweep(Ride(CAR, ROAD, duration=0.4, engine=Exponential(printed=p)), over) for p in (False, True))
    for name in plain.data_vars:
        np.testing.assert_allclose(printed[name], plain[name], rtol=1e-11, atol=1e-14, err_msg=str(name))


def test_a_sweep_prints_its_loop_and_a_long_one_compares(monkeypatch):
    """With the numbers of XLA, which does all where derivatives, functions or a missing compiler stand in the way."""
    windowed = Metric("sprung_acceleration", "peak", window=(0.1, 0.3))
    metric, names = "rms_sprung_acceleration", ["rms_sprung_acceleration", windowed]
    ride = Ride(CAR, ROAD, metrics=names, duration=0.4)
    tried, original = [], running._Pace

    class Slow(original):
        def __setattr__(self, name, value):
            super().__setattr__(name, np.inf if name == "seconds" else value)

    monkeypatch.setattr(running, "_Pace", lambda program: tried.append(program) or original(program))

    def swept(function=ride, **options):
        tried.clear()
        data = sweep(function, {RATE: np.linspace(2e3, 5e3, 20)}, chunk=1, **options)
        return data, len(tried), data.attrs["loop"]

    by_xla = Ride(CAR, ROAD, metrics=names, duration=0.4, engine=Exponential(printed=False))
    plain = swept(by_xla)[0]
    printed, *what = swept()
    assert what == [1, "printed as C"]
    for name in (metric, windowed.name):
        np.testing.assert_allclose(printed[name], plain[name], rtol=1e-12)
    monkeypatch.setattr(running, "LONG", 0.0)
    monkeypatch.setattr(running, "TURNS", 1)
    assert swept()[1] == 2
    made = iter((Slow, original))
    with monkeypatch.context() as patched:
        patched.setattr(running, "_Pace", lambda program: next(made)(program))
        compared, _, loop = swept()
    assert loop == "compiled by XLA"
    np.testing.assert_allclose(compared[metric], plain[metric], rtol=1e-12)
    xla = [1, "compiled by XLA"]
    monkeypatch.setattr(running, "LONG", 60.0)
    assert [*swept(gradients=True)[1:]] == [*swept(by_xla)[1:]] == xla
    assert swept(Ride(CAR, ROAD, metrics=names, duration=0.4, engine=Exponential(printed=True)))[2] == "printed as C"
    monkeypatch.setattr("jaxdamp.simulation.ride.compiler", lambda: None)
    assert [*swept()[1:]] == xla


def test_runs_that_cannot_be_printed():
    ride = Ride(CAR, ROAD, metrics=["rms_sprung_acceleration"], duration=0.4, engine=Exponential(printed=True))
    with pytest.raises(ValueError, match="passes none in a sweep"):
        sweep(ride, {RATE: [2e3, 3e3]}, gradients=True)
    with pytest.raises(NotImplementedError, match=r"Instants are saved.*Leave `printed` out"):
        simulate(CAR, ROAD, duration=0.4, engine=Exponential(printed=True))
