import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
from scipy.integrate import solve_ivp

from jaxdamp.metrics import weighted_rms, weighted_signal, weighting_factor, weighting_state_space


DT = 0.002
TIME = np.arange(6000) * DT


def burst(time: np.ndarray) -> np.ndarray:
    """A smooth packet of 5 and 11 Hz about t = 4 s, nothing above 20 Hz."""
    return np.exp(-(((time - 4.0) / 0.4) ** 2)) * (np.sin(10 * np.pi * time) + 0.6 * np.cos(22 * np.pi * time))


@pytest.mark.parametrize("weighting", ["Wb", "Wc", "Wd", "We", "Wf", "Wj", "Wk"])
def test_step_equals_scipy(weighting, rng):
    signal = rng.standard_normal(2000)
    a, b, c, d = (np.asarray(part) for part in weighting_state_space(weighting))
    _, expected, _ = scipy.signal.lsim((a, b[:, None], c[None, :], d[None, None]), signal, DT * np.arange(2000))
    result = weighted_signal(signal, DT, weighting, method="step", remove_mean=False)
    np.testing.assert_allclose(result, expected, atol=1e-11)


@pytest.mark.parametrize("weighting", [pytest.param("Wd", marks=pytest.mark.slow), "Wf", "Wk"])
def test_spectrum_equals_the_differential_equation(weighting):
    # the third form, as an engine would carry it: states joined to an ODE, driven by the continuous burst
    a, b, c, _ = (np.asarray(part) for part in weighting_state_space(weighting))
    solution = solve_ivp(
        lambda t, x: a @ x + b * burst(t), (0.0, TIME[-1]), np.zeros(b.size), "DOP853", TIME,
        rtol=1e-10, atol=1e-13, max_step=0.05,
    )  # fmt: skip
    result = weighted_signal(burst(TIME), DT, weighting, remove_mean=False)
    np.testing.assert_allclose(result, c @ solution.y, atol=1e-8)


def test_both_methods_agree_up_to_the_loss_of_straight_lines():
    signal = burst(TIME)
    spectrum = weighted_signal(signal, DT, "Wk")
    step = weighted_signal(signal, DT, "Wk", method="step")
    # (pi f dt)^2/3 of the amplitude: 0.16 % of 0.6 at 11 Hz and 0.03 % at 5 Hz
    assert 2e-4 < float(jnp.max(jnp.abs(step - spectrum))) < 2e-3
    sine = np.sin(2 * np.pi * 20.0 * np.arange(20000) * 0.001)
    ratio = weighted_rms(sine, 0.001, "Wk", method="step") / weighted_rms(sine, 0.001, "Wk")
    assert float(ratio) == pytest.approx(1 - (np.pi * 0.02) ** 2 / 3, abs=2e-5)


def test_the_end_does_not_run_into_the_beginning():
    signal = np.zeros(501)
    signal[400:] = np.sin(2 * np.pi * 0.5 * np.arange(101) * 0.1)  # still ringing when the record ends
    for weighting in ("Wk", "Wf"):
        early = weighted_signal(signal, 0.1, weighting, remove_mean=False)[:200]
        # the band-limited jump at the end has its own ripples, which fall off as 1/time
        assert float(jnp.max(jnp.abs(early))) < 1e-3


@pytest.mark.parametrize(("weighting", "frequency"), [("Wk", 5.0), ("Wd", 1.0), ("We", 0.5), ("Wb", 12.5), ("Wj", 4.0)])
def test_rms_of_a_sine(weighting, frequency):
    signal = 0.7 * np.sin(2 * np.pi * frequency * np.arange(60000) * 0.002)
    expected = 0.7 / np.sqrt(2) * float(weighting_factor(frequency, weighting))
    # two minutes: the start of the filter, a second long, counts for less than a per cent
    assert float(weighted_rms(signal, 0.002, weighting)) == pytest.approx(expected, rel=6e-3)


def test_rms_of_noise_is_the_integral_over_its_spectrum(rng):
    signal = rng.standard_normal(200_000)
    frequency = np.fft.rfftfreq(200_000, 0.005)
    power = np.abs(np.fft.rfft(signal)) ** 2 * 2 / 200_000**2
    expected = np.sqrt(np.sum(power * np.asarray(weighting_factor(frequency, "Wk")) ** 2))
    assert float(weighted_rms(signal, 0.005, "Wk")) == pytest.approx(expected, rel=1e-3)


def test_gravity_and_offsets_do_not_count():
    signal = burst(TIME)
    for method in ("spectrum", "step"):
        plain = weighted_rms(signal, DT, "Wk", method=method)
        assert float(weighted_rms(signal + 9.81, DT, "Wk", method=method)) == pytest.approx(float(plain), rel=1e-9)
        kept = weighted_rms(signal + 9.81, DT, "Wk", method=method, remove_mean=False)
        assert float(kept) > 2 * float(plain)  # a step of 9.81 m/s^2 at the start


def test_interval_may_be_traced_in_steps_only():
    signal = jnp.asarray(burst(TIME))
    traced = jax.jit(lambda x, dt: weighted_rms(x, dt, "Wk", method="step"))(signal, DT)
    assert float(traced) == pytest.approx(float(weighted_rms(signal, DT, "Wk", method="step")), rel=1e-10)
    with pytest.raises(ValueError, match=r'`dt` must be known.*but is traced.*take method="step"'):
        jax.jit(lambda x, dt: weighted_rms(x, dt, "Wk"))(signal, DT)


def test_a_record_that_is_weighted_already_is_taken_as_it_is():
    assert float(weighted_rms(2.0 + np.zeros(9), 0.01, None)) == 2.0
    with pytest.raises(ValueError, match=r"`dt` must be positive"):
        weighted_rms(np.ones(9), 0.0, None)


def test_no_weighting_is_refused_by_the_filter(unchecked):
    with pytest.raises(ValueError, match=r"`weighting` must be one of 'Wb'.*but is None"):
        weighted_signal(np.ones(9), 0.01, None)  # pyright: ignore[reportArgumentType]


def test_integers_count_as_numbers(unchecked):
    record = np.arange(-50, 50) % 7
    assert float(weighted_rms(record, 0.01, "Wk")) == pytest.approx(float(weighted_rms(record * 1.0, 0.01, "Wk")))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dt": -0.01}, r"`dt` must be positive and finite, but is -0.01. It is the sampling interval in s"),
        ({"dt": np.nan}, r"`dt` must be positive and finite, but is nan"),
        ({"weighting": "Wx"}, r"`weighting` must be one of 'Wb'.*but is 'Wx'"),
        ({"method": "steps"}, r"`method` must be one of 'spectrum', 'step', but is 'steps'. Did you mean 'step'\?"),
        ({"acceleration": np.ones(1)}, r"`acceleration` must hold at least 2 samples, but is of length 1"),
    ],
)
def test_errors(options, message):
    with pytest.raises(ValueError, match=message):
        weighted_rms(**{"acceleration": np.ones(9), "dt": 0.01, "weighting": "Wk", **options})
