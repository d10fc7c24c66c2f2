"""Vibration total value, comfort reactions, and the choice of the method by the shocks in a record."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._limits import root
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.metrics._signals import as_numbers
from jaxdamp.metrics.amplitude import crest_factor, rms
from jaxdamp.metrics.dose import max_transient_value, vibration_dose_value
from jaxdamp.metrics.weighted import as_weighted, weighted_rms


class Axis(NamedTuple):
    """How an axis counts: its weighting and its multiplying factor ([-]; [m/rad] for rotations)."""

    weighting: str
    factor: float


AXES = {
    "comfort": {
        "seat_x": Axis("Wd", 1.0),
        "seat_y": Axis("Wd", 1.0),
        "seat_z": Axis("Wk", 1.0),
        "seat_roll": Axis("We", 0.63),
        "seat_pitch": Axis("We", 0.4),
        "seat_yaw": Axis("We", 0.2),
        "back_x": Axis("Wc", 0.8),
        "back_y": Axis("Wd", 0.5),
        "back_z": Axis("Wd", 0.4),
        "floor_x": Axis("Wk", 0.25),
        "floor_y": Axis("Wk", 0.25),
        "floor_z": Axis("Wk", 0.4),
    },
    "health": {"seat_x": Axis("Wd", 1.4), "seat_y": Axis("Wd", 1.4), "seat_z": Axis("Wk", 1.0)},
}

# From, and below [m/s^2].
_REACTIONS = [
    ("not uncomfortable", 0.0, 0.315),
    ("a little uncomfortable", 0.315, 0.63),
    ("fairly uncomfortable", 0.5, 1.0),
    ("uncomfortable", 0.8, 1.6),
    ("very uncomfortable", 1.25, 2.5),
    ("extremely uncomfortable", 2.0, float("inf")),
]


def _check_axes(argument: str, axes: Mapping[str, object], purpose: str) -> None:
    _checks.one_of("purpose", purpose, AXES)
    if not axes:
        _checks.refuse(argument, "hold at least one axis", "empty", f"Known are {', '.join(AXES[purpose])}.")
    for axis in axes:
        _checks.one_of(f"an axis of {argument}", axis, AXES[purpose])


def vibration_total_value(values: Mapping[str, ScalarLike], purpose: str = "comfort") -> Scalar:
    """Vibration total value of weighted RMS values, a_v = sqrt(sum_i k_i^2 a_wi^2) [m/s^2].

    Each axis of seat, backrest and floor counts with the factor of `metrics.AXES[purpose]`: for comfort 1, 1, 1 on the
    seat, 0.63, 0.4 and 0.2 m/rad for its roll, pitch and yaw, 0.8, 0.5, 0.4 at the back, 0.25, 0.25, 0.4 under the
    feet; for health 1.4, 1.4, 1 on the seat. Axes that are not given count as zero. For health, ISO 2631-1 looks at
    the worst axis, and at this sum where axes are comparable. Differentiable; zero at zero, with zero gradient.

    Arguments:
        values: weighted RMS acceleration by axis [m/s^2] ([rad/s^2] for rotations), each with the weighting of
            `metrics.AXES[purpose]`: Wk for seat z and the floor, Wd for seat x and y and for back y and z, Wc for
            back x, We for rotations.
        purpose: "comfort" or "health".

    Raises:
        ValueError: if an axis or the purpose is unknown, or if there is no axis.

    Source: ISO 2631-1. Its factors for seat, back and floor are confirmed by one public implementation; those for
    rotations and health are quoted from memory and not verified.

    >>> round(float(vibration_total_value({"seat_x": 0.2, "seat_z": 0.5, "floor_z": 0.6})), 4)
    0.5896
    >>> round(float(vibration_total_value({"seat_x": 0.2, "seat_z": 0.5}, "health")), 4)
    0.5731
    """
    _check_axes("values", values, purpose)
    parts = as_numbers(*values.values())
    factors = [AXES[purpose][axis].factor for axis in values]
    squares = [(factor * part) ** 2 for factor, part in zip(factors, parts, strict=True)]
    return root(jnp.sum(jnp.stack(squares)))


def total_vibration(
    accelerations: Mapping[str, SignalLike], dt: ScalarLike | int, purpose: str = "comfort", *, method: str = "spectrum"
) -> Scalar:
    """Vibration total value of records: each weighted by its axis, then added as `vibration_total_value` [m/s^2].

    Arguments:
        accelerations: records by axis, shape [time] each [m/s^2] ([rad/s^2] for rotations); axes see
            `metrics.AXES[purpose]`.
        dt: the sampling interval [s].
        purpose: "comfort" or "health".
        method: "spectrum" or "step"; see `weighted_signal`.

    Raises:
        ValueError: if an axis or the purpose is unknown, if there is no axis, or as `weighted_signal`.

    Source: see `vibration_total_value`.

    >>> import jax.numpy as jnp
    >>> a = jnp.sin(2.0 * jnp.pi * 5.0 * jnp.arange(8000.0) * 0.0025)
    >>> round(float(total_vibration({"seat_z": a, "floor_z": 1.2 * a, "seat_pitch": 0.5 * a}, 0.0025)), 3)
    0.814
    """
    _check_axes("accelerations", accelerations, purpose)
    values = {
        axis: weighted_rms(record, dt, AXES[purpose][axis].weighting, method=method)
        for axis, record in accelerations.items()
    }
    return vibration_total_value(values, purpose)


def comfort_reaction(total_value: ScalarLike) -> tuple[str, ...]:
    """What passengers of public transport are likely to call a vibration total value: one or two words.

    Below 0.315 m/s^2 not uncomfortable, 0.315 to 0.63 a little, 0.5 to 1 fairly, 0.8 to 1.6 uncomfortable, 1.25 to
    2.5 very, from 2 extremely uncomfortable. The ranges overlap on purpose, each holds its lower end, and all that
    apply are returned. They are no limits of the standard. Words have no gradient and do not compile.

    Arguments:
        total_value: weighted RMS or vibration total value [m/s^2].

    Raises:
        ValueError: if it is negative, not finite, or traced.

    Source: ISO 2631-1, comfort annex; the numbers are quoted from memory and not verified.

    >>> comfort_reaction(0.55)
    ('a little uncomfortable', 'fairly uncomfortable')
    """
    concrete = _checks.concrete(total_value)
    if concrete is None:
        _checks.refuse("total_value", "be known: texts cannot be compiled", "traced", "Call it outside compiled code.")
    _checks.nonnegative("total_value", total_value, "It is a weighted RMS acceleration in m/s^2.")
    value = float(concrete)
    return tuple(word for word, low, high in _REACTIONS if low <= value < high)


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
