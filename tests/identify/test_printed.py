"""Fits by printed C: the numbers of XLA, from one compiled program for records of any number and length."""

import logging

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import identify
from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.codegen import _native
from jaxdamp.dampers import Besinger, Lag, Linear, LuGre, SeriesSpring, Spring
from jaxdamp.identify import printed, search
from jaxdamp.identify.traces import Batch
from jaxdamp.parameters import get
from jaxdamp.rig import Rig, printed as printed_laws, quasi_static


TRUTH = LuGre.guess(np.array([-0.3, 0.0, 0.3]), np.array([-600.0, 100.0, 900.0])) + Linear(1500.0) + Spring(2000.0)
TESTS = [SineTest(0.01, 2.0, cycles=2), SineTest(0.02, 2.0, cycles=2), SineTest(0.02, 4.0, cycles=3)]
PLAIN = ("piecewise_linear", "besinger_lag", "table")
THINNED = "thinned_visco_plastic"
LAWS = [pytest.param(n, marks=() if n in PLAIN else pytest.mark.slow) for n in (*identify.LAWS, THINNED)]


@pytest.fixture(scope="module")
def runs():
    return VirtualDyno(TRUTH, sampling_rate=400.0, force_noise=10.0).run(TESTS[:2])


@pytest.fixture
def without_c(monkeypatch):
    """Everything by XLA from here on, in functions that this calls."""

    def leave():
        monkeypatch.setattr(search, "evaluator", lambda *_: None)
        monkeypatch.setattr("jaxdamp.identify.fitting.evaluator", lambda *_: None)
        monkeypatch.setattr("jaxdamp.identify.predicting.predicted_by_c", lambda *_: None)

    return leave


LATE = Rig(force_delay=1.3e-3)
EARLY = Rig(force_delay=-2.7e-3, moving_mass=2.0, force_lag=3e-3, gas_force=-100.0, stroke_offset=1e-3)
MACHINES = [
    ("besinger", LATE),
    *(
        pytest.param(name, EARLY, marks=pytest.mark.slow)
        for name in ("besinger_lag", "besinger_series_spring", "lugre_spring")
    ),
    pytest.param("piecewise_linear", Rig(moving_mass=2.0, force_lag=1e-7), marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("name", "rig"), MACHINES)
def test_delay_mass_and_lag_of_a_machine_are_those_of_xla(name, rig, runs) -> None:
    assert_as_xla(name, rig, runs)


@pytest.mark.parametrize("name", LAWS)
def test_residual_jacobian_and_prediction_are_those_of_xla(name, runs) -> None:
    assert_as_xla(name, ["offset", "gas", "stroke_offset"], runs)


def assert_as_xla(name, rig, runs) -> None:
    start = identify.default_ladder(runs, [name])[name]
    problem = identify.prepare(start, runs, rig=rig)
    by_c = printed.evaluator(problem.free, problem.residuals)
    assert by_c is not None
    coordinates = problem.coordinates
    y = np.asarray(coordinates.from_physical(1.01 * np.asarray(problem.free.values)))
    to_values = coordinates.on_host()
    assert to_values is not None
    values, units = to_values(y)
    expected = list(map(np.asarray, search._evaluated(coordinates, jnp.asarray(y), problem.residuals)))
    whole = by_c(values)
    conditions, slopes = by_c.margins(values)
    answers = [values, whole, units, conditions, slopes @ units]
    for answer, right in zip(answers, expected, strict=True):
        assert answer.shape == right.shape
        scale = np.max(np.abs(right), axis=0, initial=1e-300)
        scale = np.maximum(scale, 1e-9 * np.max(scale, initial=0.0))  # of a column that is zero to rounding
        assert np.all(np.abs(answer - right) <= 1e-9 * scale)
    reduced = by_c.triangle(whole)
    assert np.allclose(reduced.T @ reduced, whole.T @ whole, rtol=1e-9, atol=1e-9 * np.max(np.abs(whole)) ** 2)
    model = problem.free.build(jnp.asarray(values))
    for batch in problem.residuals:
        assert isinstance(batch, Batch)
        forces, right = printed.predicted(batch, model), np.asarray(batch.settled_forces(model)[0])
        assert forces is not None and np.abs(forces - right).max() <= 1e-9 * np.abs(right).max()


VALVE = Besinger(1500.0, 1500.0, 1000.0, 0.12, 0.06)
CASES = {
    "tied": (
        Lag(VALVE, 0.003),
        {"tie": {"law.law.rebound_rate": "law.law.compression_rate"}, "freeze": ["transition_velocity"]},
    ),
    "a value for each record": (Lag(Linear(1500.0), 0.003), {"per_record": ["rig.force_offset", "law.law.rate"]}),
    "robust": (Lag(Linear(1500.0), 0.003), {"loss": "huber"}),
    "a record left out behind a lag": (Linear(1500.0), {"rig": ["offset", "lag"], "weighting": [1.0, np.inf]}),
    "a delay for each record": (Linear(1500.0), {"rig": ["offset", "delay"], "per_record": ["rig.force_delay"]}),
}


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=[pytest.mark.slow] * (case in ("tied", "a delay for each record"))) for case in CASES],
)
def test_a_fit_has_the_standard_errors_of_xla(case, without_c, monkeypatch) -> None:
    truth = Lag(Besinger(1600.0, 1600.0, 900.0, 0.13, 0.05), 0.004)
    runs = VirtualDyno(truth, sampling_rate=400.0, force_noise=10.0).run(TESTS[1:])
    start, how = CASES[case]
    by_c = []
    monkeypatch.setattr(search, "evaluator", lambda *a: by_c.append(printed.evaluator(*a)) or by_c[-1])
    how = {"rig": "offset", **how}
    fitted = identify.fit(start, runs, starts=1, **how)
    assert by_c and all(by_c)
    without_c()
    expected = identify.fit(start, runs, starts=1, **how)
    assert fitted.rmse == pytest.approx(expected.rmse, rel=1e-9)
    for one, other in zip(fitted.parameters, expected.parameters, strict=True):
        assert one.value == pytest.approx(other.value, abs=1e-4 * other.standard_error)
        assert one.standard_error == pytest.approx(other.standard_error, rel=1e-6)


def test_one_program_serves_records_of_any_number_and_length(runs) -> None:
    made = []
    for some in (runs, VirtualDyno(TRUTH, sampling_rate=300.0).run(TESTS)):
        problem = identify.prepare(Lag(Linear(1000.0), 0.003), some, rig="offset")
        made.append(printed.evaluator(problem.free, problem.residuals))
    assert made[0].law is made[1].law and made[0].size != made[1].size


def test_without_a_compiler_xla_computes_it_and_the_log_says_so(runs, monkeypatch, caplog) -> None:
    monkeypatch.setattr(_native, "compiler", lambda: None)
    monkeypatch.setattr(_native, "_lasting_folder", lambda: None)  # nor one compiled earlier
    _native.library.cache_clear()
    for memory in ("_laws", "_refused"):
        monkeypatch.setattr(printed_laws, memory, {})
    printed_laws.say.cache_clear()
    problem = identify.prepare(Linear(1000.0), runs)
    with caplog.at_level(logging.INFO, "jaxdamp.printed"):
        assert printed.evaluator(problem.free, problem.residuals) is None
        assert printed.evaluator(problem.free, problem.residuals) is None
    assert [record.message.startswith("Linear is computed by XLA.") for record in caplog.records] == [True]
    assert identify.fit(Linear, runs).converged


def test_what_was_changed_on_disk_is_not_loaded(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(_native, "_lasting_folder", lambda: tmp_path)
    text = "double answer(void) { return 42.0; } // "
    _native.library.__wrapped__(text)
    (kept,) = tmp_path.glob("c_*.so")
    was = kept.read_bytes()
    assert _native.library.__wrapped__(text) and list(tmp_path.glob("c_*.so")) == [kept]
    kept.unlink()
    kept.write_bytes(was[:-1] + b"!")
    monkeypatch.setattr(_native, "compiler", lambda: None)
    with pytest.raises(NotImplementedError, match="compiler"):
        _native.library.__wrapped__(text)


def test_without_configure_a_fit_is_computed_by_c_too(monkeypatch) -> None:
    """C computes in double precision, so that the numbers are those of a process that was configured."""
    runs = VirtualDyno(SeriesSpring(Linear(2000.0), 3e5), sampling_rate=400.0, force_noise=10.0).run(TESTS[1:])
    found = []
    for double in (True, False):
        with jax.enable_x64(double):
            result = identify.fit(SeriesSpring(Linear(1500.0), 2e5), runs)
            curve = quasi_static(result.law, np.array([-0.3, 0.1, 0.4])).force
            kind = np.float64 if double else np.float32
            assert curve.dtype == get(result.law, "law.rate").dtype == kind
        found.append([*curve, *(n for p in result.parameters for n in (p.value, p.standard_error)), result.rmse])
        monkeypatch.setattr(search, "_by_xla", None)  # which is not called
        monkeypatch.setattr("jaxdamp.rig.constant_velocity._held_by_xla", None)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-4)


@pytest.mark.slow
def test_a_second_ladder_of_other_records_compiles_next_to_nothing(runs) -> None:
    """Of a first one all programs but a few are single operations; the laws themselves are C."""
    names = ["piecewise_linear", "besinger_lag"]
    identify.compare(identify.default_ladder(runs, names), runs, starts=1)
    programs: list[str] = []

    def note(event: str, duration_secs: float, **_: str | int) -> None:
        if event == "/jax/core/compile/backend_compile_duration":
            programs.append(event)

    others = VirtualDyno(TRUTH, sampling_rate=300.0, force_noise=10.0).run(TESTS)
    jax.monitoring.register_event_duration_secs_listener(note)
    try:
        identify.compare(identify.default_ladder(others, names), others, starts=1)
    finally:
        jax.monitoring.unregister_event_duration_listener(note)
    assert len(programs) <= 5
