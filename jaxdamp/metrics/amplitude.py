"""Size of a signal, and use of the suspension travel."""

import math

import jax
import jax.numpy as jnp
from jax.scipy.special import erfc

from jaxdamp import _checks
from jaxdamp._limits import largest, root
from jaxdamp._types import Scalar, ScalarLike, SignalLike
from jaxdamp.metrics._signals import as_numbers, as_signal


def rms(signal: SignalLike) -> Scalar:
    """Root mean square, sqrt(mean(x^2)), in the unit of the signal. The mean is not removed.

    The gradient is x/(n rms); for a signal that is zero throughout, where the root has none, it is taken as zero.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> round(float(rms(3.0 * jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100))), 6)  # 3/sqrt(2)
    2.12132
    """
    return root(jnp.mean(as_signal("signal", signal) ** 2))


def peak(signal: SignalLike) -> Scalar:
    """Largest magnitude, max |x|, in the unit of the signal.

    Only the sample that holds the peak has a gradient, of equal ones the first; it jumps where two samples compete.
    Tune on `smooth_peak` instead.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> round(float(peak(jnp.array([0.2, -1.5, 1.0]))), 6)
    1.5
    """
    return largest(jnp.abs(as_signal("signal", signal)))


def smooth_peak(signal: SignalLike, order: ScalarLike | int = 16) -> Scalar:
    """A smooth approximation of `peak`: the power mean (mean |x|^p)^(1/p), in the unit of the signal.

    It is between max |x| / n^(1/p) and max |x| and approaches max |x| with the order p; as a mean over time it does not
    depend on the sampling rate. All large samples have a gradient. A sine gives 0.90 of its peak with p = 16; a
    Gaussian record gives 2.48 standard deviations, its peak some 4. It is computed relative to the largest sample, so
    nothing overflows. The gradient for a signal that is zero throughout is zero.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.
        order: the power p, at least 2; 8 to 16 for tuning.

    Raises:
        ValueError: if the signal is empty or has more than one axis, or `order` is not finite or below 2.

    >>> import jax.numpy as jnp
    >>> x = jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100)
    >>> [round(float(smooth_peak(x, p)), 4) for p in (2, 8, 16, 64)]
    [0.7071, 0.8504, 0.9033, 0.9646]
    """
    x = as_signal("signal", signal)
    _checks.finite("order", order)
    concrete = _checks.concrete(order)
    if concrete is not None and concrete < 2.0:
        _checks.refuse(
            "order", "be at least 2", concrete, "Use `rms` for 2 and larger orders to come closer to the peak."
        )
    p = jnp.asarray(order, x.dtype)
    largest = jax.lax.stop_gradient(jnp.max(jnp.abs(x)))
    zero = largest == 0.0
    scale = jnp.where(zero, jnp.ones_like(largest), largest)
    mean = jnp.mean(jnp.abs(x / scale) ** p)
    safe = jnp.where(zero, jnp.ones_like(mean), mean)
    return jnp.where(zero, jnp.zeros_like(mean), scale * safe ** (1.0 / p))


def crest_factor(signal: SignalLike) -> Scalar:
    """Peak over root mean square, max |x| / sqrt(mean(x^2)) [-]: sqrt(2) for a sine, about 4 for a Gaussian record.

    ISO 2631-1 requires more than the weighted RMS if the crest factor of the weighted acceleration exceeds 9. The
    gradient is that of `peak` and `rms`. A signal that is zero throughout has no crest factor: the result is NaN.

    Arguments:
        signal: uniformly sampled values, shape [time], any unit.

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> round(float(crest_factor(jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100))), 6)
    1.414214
    """
    return peak(signal) / rms(signal)


def working_space_rms(deflection: SignalLike) -> Scalar:
    """Root mean square of the suspension deflection about its own mean [m], sqrt(mean((d - mean(d))^2)).

    It is the standard deviation of the deflection, the usual measure of the working space: of a stationary ride the
    deflection leaves mean +- 3 times this for 0.3 % of the time. A sensor offset or a ride height changes nothing. An
    asymmetric damper shifts the mean ("jacking down"); that is `working_space_mean`. The ride metric of this name is
    the same number. The gradient for a constant deflection is zero.

    Arguments:
        deflection: suspension deflection z_sprung - z_unsprung [m], shape [time].

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> d = 0.2 + 0.03 * jnp.sin(2.0 * jnp.pi * jnp.arange(100.0) / 100)
    >>> round(float(working_space_rms(d)), 6)
    0.021213
    """
    deflection = as_signal("deflection", deflection)
    return rms(deflection - jnp.mean(deflection))


def working_space_mean(deflection: SignalLike) -> Scalar:
    """Mean suspension deflection [m]: how far the body rides above (positive) or below its static position.

    A damper that is stiffer in rebound than in compression pulls the body down on a rough road ("jacking down"): the
    mean is negative, and that travel in compression is lost. Counted from the static position, which the deflection of
    a measured record must be too.

    Arguments:
        deflection: suspension deflection z_sprung - z_unsprung from the static position [m], shape [time].

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> round(float(working_space_mean(jnp.array([0.0, -0.02, 0.01, -0.03]))), 6)
    -0.01
    """
    return jnp.mean(as_signal("deflection", deflection))


def working_space_peak_to_peak(deflection: SignalLike) -> Scalar:
    """Peak-to-peak suspension deflection [m], max(d) - min(d): the travel that the wheel has used. Not half of it.

    Independent of offsets. Only the two extreme samples have a gradient.

    Arguments:
        deflection: suspension deflection z_sprung - z_unsprung [m], shape [time].

    Raises:
        ValueError: if the signal is empty or has more than one axis.

    >>> import jax.numpy as jnp
    >>> round(float(working_space_peak_to_peak(jnp.array([0.0, 0.04, -0.02, 0.01]))), 6)
    0.06
    """
    deflection = as_signal("deflection", deflection)
    return largest(deflection) + largest(-deflection)


def _check_range(lower: ScalarLike | int, upper: ScalarLike | int) -> None:
    _checks.finite("lower", lower)
    _checks.finite("upper", upper)
    low, high = _checks.concrete(lower), _checks.concrete(upper)
    if low is not None and high is not None and not low < high:
        _checks.refuse("upper", f"be above `lower` ({low})", high, "`lower` is the bump side and mostly negative.")


def working_space_exceedance(deflection: SignalLike, lower: ScalarLike | int, upper: ScalarLike | int) -> Scalar:
    """The part of the time, from 0 to 1, during which the deflection lies below `lower` or above `upper` [-].

    It counts samples, so its gradient is zero everywhere: tune on
    `gaussian_exceedance(mean(d), working_space_rms(d), lower, upper)` instead.

    Arguments:
        deflection: suspension deflection z_sprung - z_unsprung [m], shape [time]; extension is positive.
        lower: the end of the travel in compression [m], negative where deflections count from the static position.
        upper: the end of the travel in extension [m].

    Raises:
        ValueError: if the signal is empty or has more than one axis, or `lower` is not below `upper`.

    >>> import jax.numpy as jnp
    >>> round(float(working_space_exceedance(jnp.array([0.0, 0.05, -0.02, -0.07]), -0.06, 0.04)), 6)
    0.5
    """
    d = as_signal("deflection", deflection)
    _check_range(lower, upper)
    outside = (d < jnp.asarray(lower, d.dtype)) | (d > jnp.asarray(upper, d.dtype))
    return jnp.mean(jnp.where(jnp.isnan(d), d, outside.astype(d.dtype)))


def gaussian_exceedance(
    mean: ScalarLike | int, standard_deviation: ScalarLike | int, lower: ScalarLike | int, upper: ScalarLike | int
) -> Scalar:
    """The part of the time that a Gaussian deflection spends outside [lower, upper], Q((u - m)/s) + Q((m - l)/s) [-].

    With limits at -x and x about a zero mean it is 2 Q(x/s); Q is the upper tail of the normal distribution. Real
    suspensions stiffen towards their stops, so it overestimates large excursions. Differentiable in all arguments.

    Arguments:
        mean: mean deflection [m].
        standard_deviation: its standard deviation [m], positive: `working_space_rms`, or a stationary response.
        lower: the end of the travel in compression [m].
        upper: the end of the travel in extension [m].

    Raises:
        ValueError: if `standard_deviation` is not positive, anything is not finite, or `lower` is not below `upper`.

    >>> round(float(gaussian_exceedance(0.0, 0.02, -0.06, 0.06)), 6)  # three standard deviations
    0.0027
    """
    _checks.finite("mean", mean)
    _checks.positive("standard_deviation", standard_deviation, "It is that of the deflection in m.")
    _check_range(lower, upper)
    centre, spread, low, high = as_numbers(mean, standard_deviation, lower, upper)
    width = spread * math.sqrt(2.0)
    return 0.5 * (erfc((high - centre) / width) + erfc((centre - low) / width))
