"""The evaluation method required by ISO 2631-1: is the weighted RMS sufficient?"""

import math
from typing import NamedTuple

import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._limits import root
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.metrics.amplitude import crest_factor, rms
from jaxdamp.metrics.dose import vibration_dose_value
from jaxdamp.metrics.running import max_transient_value
from jaxdamp.metrics.weighted import as_weighted


# Above these limits the weighted RMS underestimates the effect of the vibration.
CREST_FACTOR_LIMIT, TRANSIENT_LIMIT, DOSE_LIMIT = 9.0, 1.5, 1.75


class ShockRatios(NamedTuple):
    """Three ratios that measure shocks in a record [-].

    Attributes:
        crest_factor: largest weighted acceleration over its RMS [-].
        transient_ratio: largest running RMS over the weighted RMS [-].
        dose_ratio: vibration dose value over weighted RMS times T^(1/4) [-].
    """

    crest_factor: Scalar
    transient_ratio: Scalar
    dose_ratio: Scalar


class Evaluation(NamedTuple):
    """The evaluation method required by ISO 2631-1, in words, and the three ratios it follows from [-].

    Attributes:
        method: in words.
        crest_factor: largest weighted acceleration over its RMS [-].
        transient_ratio: largest running RMS over the weighted RMS [-].
        dose_ratio: vibration dose value over weighted RMS times T^(1/4) [-].
    """

    method: str
    crest_factor: float
    transient_ratio: float
    dose_ratio: float


def shock_ratios(acceleration: SignalLike, dt: ScalarLike | int, weighting: str | None) -> ShockRatios:
    """The three ratios of ISO 2631-1 for shocks, all of the weighted acceleration [-].

    Crest factor max |a_w(t)|/a_w, MTVV/a_w with linear averaging over 1 s, and VDV/(a_w T^(1/4)). A steady sine has
    1.414, 1 and 1.107; Gaussian vibration about 4, little above 1 and 1.316. The gradient is that of `peak` and
    `max_transient_value`, at one sample or window each; VDV/(a_w T^(1/4)) is smooth. NaN for a record of zeros.

    Arguments:
        acceleration: acceleration [m/s^2], shape [time], at least 1 s.
        dt: the sampling interval [s].
        weighting: "Wk" and so on (see `weighting_response`), or None for a record that is weighted already.

    Raises:
        ValueError: as `weighted_signal` and `running_rms`.

    Source: ISO 2631-1, applicability of the basic evaluation and additional methods.

    >>> import jax.numpy as jnp
    >>> ratios = shock_ratios(jnp.sin(2.0 * jnp.pi * jnp.arange(1600.0) / 100), 0.01, None)
    >>> [round(float(ratio), 3) for ratio in ratios]
    [1.414, 1.0, 1.107]
    """
    signal = as_weighted(acceleration, dt, weighting)
    size = rms(signal)
    duration = signal.size * jnp.asarray(dt, signal.dtype)
    transient = max_transient_value(signal, dt, None) / size
    dose = vibration_dose_value(signal, dt, None) / (size * root(duration, 4))
    return ShockRatios(crest_factor(signal), transient, dose)


def evaluation_method(acceleration: SignalLike, dt: ScalarLike | int, weighting: str | None) -> Evaluation:
    """The evaluation method required by ISO 2631-1, in words.

    The weighted RMS is enough unless the crest factor exceeds 9, MTVV/a_w exceeds 1.5 or VDV/(a_w T^(1/4)) exceeds
    1.75; then MTVV or VDV is to be given as well. Words have no gradient and do not compile: use `shock_ratios` there.

    Arguments:
        acceleration: acceleration [m/s^2], shape [time], at least 1 s.
        dt: the sampling interval [s].
        weighting: "Wk" and so on (see `weighting_response`), or None for a record that is weighted already.

    Raises:
        ValueError: as `shock_ratios`; if the record is zero, holds NaN, or is traced.

    Source: ISO 2631-1, applicability of the basic evaluation and additional methods.

    >>> import jax.numpy as jnp
    >>> time = jnp.arange(20000.0) * 0.001
    >>> smooth = evaluation_method(jnp.sin(2.0 * jnp.pi * 6.0 * time), 0.001, "Wk")
    >>> smooth.method
    'weighted RMS'
    >>> kick = jnp.exp(-2.0 * time) * jnp.sin(2.0 * jnp.pi * 6.0 * time)
    >>> evaluation_method(kick[:8000], 0.001, "Wk").method
    'weighted RMS and MTVV or VDV: MTVV/a_w exceeds 1.5, VDV/(a_w T^0.25) exceeds 1.75'
    """
    ratios = shock_ratios(acceleration, dt, weighting)
    if any(_checks.concrete(ratio) is None for ratio in ratios):
        remedy = "Use `shock_ratios` in compiled code."
        _checks.refuse("acceleration", "be known: texts cannot be compiled", "traced", remedy)
    crest, transient, dose = (float(ratio) for ratio in ratios)
    if not all(map(math.isfinite, (crest, transient, dose))):
        remedy = "Fill the gaps of the record; one of zeros has no ratios."
        _checks.refuse("acceleration", "be finite and not zero throughout", "without shock ratios", remedy)
    tests = [
        ("the crest factor", crest, CREST_FACTOR_LIMIT),
        ("MTVV/a_w", transient, TRANSIENT_LIMIT),
        ("VDV/(a_w T^0.25)", dose, DOSE_LIMIT),
    ]
    reasons = [f"{name} exceeds {limit:g}" for name, value, limit in tests if value > limit]
    words = f"weighted RMS and MTVV or VDV: {', '.join(reasons)}" if reasons else "weighted RMS"
    return Evaluation(words, crest, transient, dose)
