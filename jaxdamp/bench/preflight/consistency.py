"""Checks of the channels against one another: sign, gas force, velocity, delay, breakaway, drift."""

import numpy as np
from jaxtyping import Float

from jaxdamp._checks import ArgumentError
from jaxdamp.bench.analysis import FoldedCycles
from jaxdamp.bench.evaluation.curve import cycle_figures, measured
from jaxdamp.bench.evaluation.separation import separate_gas_and_friction
from jaxdamp.bench.motion import Samples
from jaxdamp.bench.preflight.finding import CLEAR, Examined, Finding
from jaxdamp.bench.sign import LEAST_LOSS


SMALL = 0.005  # of the force range, below which a drift or a gas force is of no concern
_NO_DAMPER = 30.0  # N s/m: less is no damper of a vehicle
_SMOOTHER = 0.99  # ratio of the relative rates of change of force and stroke
_LEAST_DELAY = 0.1  # sampling steps
_HARMONICS = 9
_ROUNDS = 3  # to turn harmonics back by a delay


def sign(e: Examined) -> list[Finding]:
    """A force that drives the motion, since the work of a cycle is negative, or that is the stroke."""
    if exchanged(e):
        message = "stroke and force look exchanged: the force moves as smoothly as a machine, the stroke has corners"
        remedy = 'Name the columns: `columns={"stroke": ..., "force": ...}`.'
        return e.finding("error", "channels exchanged", message, None, "", None, remedy)
    if not _drives(e):
        return []
    work = e.run.work_per_cycle
    message = f"the force drives the motion: work per cycle {work:+.3g} J, but a damper takes in energy"
    remedy = 'The force counts the other way: read the file with force_sign="opposite".'
    return e.finding("error", "force sign", message, work, "J", None, remedy)


def exchanged(e: Examined) -> bool:
    """Whether the stroke looks like a force and the force like a stroke.

    A machine moves smoothly and a damper answers with corners, so that the stroke is the smoother one of the two. Where
    it is the other way round and the work is negative, or the force small as of no damper, they are exchanged.
    """
    small = float(np.std(e.run.force[e.moving])) < _NO_DAMPER * float(np.std(e.run.velocity[e.moving]))
    return (small or _drives(e)) and _rate(e, e.run.force) < _SMOOTHER * _rate(e, e.run.stroke)


def _drives(e: Examined) -> bool:
    """Whether the work of a cycle is negative."""
    force, stroke = e.run.force[e.moving], e.run.stroke[e.moving]
    return e.run.work_per_cycle < -LEAST_LOSS * 2 * np.pi * float(np.std(force) * np.std(stroke))


def _rate(e: Examined, values: Samples) -> float:
    """RMS of the change per sample relative to that of the values, smoothed over a thirtieth of a period.

    NaN, which is not below any rate, where the values do not change.
    """
    width = max(int(e.samples_per_cycle / 30), 1)
    sums = np.concatenate([[0.0], np.cumsum(values[e.moving] - np.mean(values[e.moving]))])
    smooth = (sums[width:] - sums[:-width]) / width
    deviation = float(np.std(smooth))
    return float(np.sqrt(np.mean(np.diff(smooth) ** 2))) / deviation if deviation > 0.0 else float("nan")


def velocity(e: Examined) -> list[Finding]:
    """A velocity that is not the derivative of the stroke, both over a twelfth of a period, so that noise is small."""
    width = max(int(e.samples_per_cycle / 12), 1)
    covered = np.concatenate([[0.0], np.cumsum(0.5 * (e.run.velocity[1:] + e.run.velocity[:-1]))]) / e.run.sampling_rate
    measured, derived = (values[width:] - values[:-width] for values in (covered, e.run.stroke))
    # Sums rather than np.dot: threads of BLAS would take longer to start than this takes.
    both, power, squares = (
        float(np.sum(a * b)) for a, b in ((measured, derived), (measured, measured), (derived, derived))
    )
    likeness, scale = both / np.sqrt(power * squares) if power * squares > 0 else 0.0, both / squares
    if likeness > 0.99 and 0.93 < scale < 1.07:
        return []
    severity = "error" if likeness < 0.8 or not 0.8 < scale < 1.25 else "warning"
    message = f"the velocity is {scale:.4g} times the derivative of the stroke, correlation {likeness:.3f}"
    remedy = "Is the velocity of another unit, sign or channel? Without it, it is derived from the stroke."
    return e.finding(severity, "velocity not of the stroke", message, scale, "", None, remedy)


def gas_force(e: Examined) -> list[Finding]:
    """The static force at mid-stroke: gas pushes the rod out, which counts negative; a positive one is odd."""
    if e.cycles is None:
        return []
    value, scatter, count = measured(cycle_figures(e.cycles)["static force", "N"])
    uncertain = (scatter or e.noise["force"]) / np.sqrt(max(count, 1))
    least = max(CLEAR * uncertain, 4 * SMALL * float(np.ptp(e.run.force[e.moving])))
    try:
        extrapolated = separate_gas_and_friction(e.run).gas_force
    except ArgumentError:
        return []  # too fast a record to say
    # At the ends of a loop with much hysteresis the force is steep, and away from them the damping may be curved.
    if not min(abs(value), abs(extrapolated)) > least or value * extrapolated < 0:
        return []
    if value < 0:
        message = f"gas force (or an offset of the load cell) of {value:.4g} N at mid-stroke"
        remedy = "Laws of velocity have none: subtract it, `process(without=bench.separate_gas_and_friction(run))`."
        return e.finding("note", "gas force", message, value, "N", None, remedy)
    message = f"the static force at mid-stroke is {value:+.4g} N, but gas pushes the rod out, which counts negative"
    remedy = "Has the load cell an offset, or does a mass hang on it, or are rebound and compression exchanged?"
    return e.finding("warning", "static force against gas", message, value, "N", None, remedy)


def delay(e: Examined) -> list[Finding]:
    """A force that is late or early: by the phase of its harmonics against those of a function of the velocity.

    Any function of the velocity of a sine is symmetric about the instants of peak velocity; a delay τ turns its k-th
    harmonic by k ω τ. A spring or a mass turns the first one only, so that the higher ones decide where they are large
    enough to tell.
    """
    if e.cycles is None or len(e.cycles.periods) < 2:
        return []
    first, higher = (_delay(e.cycles, e.noise["force"], orders) for orders in ((1,), range(2, _HARMONICS + 1)))
    (tau, uncertain), clear = (higher, True) if CLEAR * higher[1] < max(abs(first[0]), 1e-12) else (first, False)
    if abs(tau) < max(CLEAR * uncertain, _LEAST_DELAY / e.run.sampling_rate):
        return []
    which = "lags behind" if tau > 0 else "leads"
    cause = "a delay of the channel, or hysteresis of the damper"
    cause = cause if clear else f"{cause}, or a {'spring (gas)' if tau > 0 else 'mass'}"
    message = f"the force {which} the velocity by {1e3 * abs(tau):.3g} ± {1e3 * uncertain:.1g} ms: {cause}"
    remedy = f"If a channel is late, `process(delay={tau:.3g})`; hysteresis needs a law with a lag or a series spring."
    return e.finding("warning", "delay", message, tau, "s", None, remedy)


def _delay(cycles: FoldedCycles, noise: float, orders: "range | tuple[int, ...]") -> tuple[float, float]:
    """Delay [s] by harmonics of these orders, mean over the cycles, and its standard error."""
    count, points = cycles.force.shape
    omega = 2 * np.pi / float(cycles.periods.mean())
    stroke, force = (np.fft.rfft(values, axis=1) * 2 / points for values in (cycles.stroke, cycles.force))
    angle = np.angle(stroke[:, 1]) + np.pi / 2  # of the velocity
    number = np.array([k for k in orders if k < points // 3])
    turned = force[:, number] * np.exp(-1j * angle[:, None] * number)
    level = turned.real.mean(axis=0)
    weight = number * omega * level
    power = float(np.sum(weight**2))
    if power <= 0.0:
        return 0.0, float("inf")
    each = -(turned.imag @ weight) / power
    for _ in range(_ROUNDS):  # turned back by what is known of it
        back = turned * np.exp(1j * number * omega * each[:, None])
        each = each - (back.imag @ weight) / power
    least = noise * np.sqrt(2.0 / (points * count)) / np.sqrt(power)
    change, drifts = _trend(cycles.starts, cycles.force.mean(axis=1)) if count > 2 else (0.0, False)
    # The ramp of a drift has harmonics of the size ramp / (π k), of which the phase is not known.
    ramp = drifts * abs(change) / (count - 1) * float(np.sum(np.abs(weight) / number)) / (np.pi * power)
    return float(each.mean()), max(float(each.std(ddof=1)) / np.sqrt(count), float(least)) + ramp / CLEAR


def breakaway(e: Examined) -> list[Finding]:
    """Stick-slip: behind each reversal the force first rises to a peak, then falls although the velocity grows."""
    if e.cycles is None:
        return []
    velocity, force = e.cycles.velocity.mean(axis=0), e.cycles.force.mean(axis=0)
    noise = e.noise["force"] / np.sqrt(len(e.cycles.periods))
    drops = []
    for turn in (1.0, -1.0):
        v, f = turn * velocity / np.max(turn * velocity), turn * force
        start = int(np.argmin(np.where(v > 0, v, np.inf) + np.where(np.gradient(v) > 0, 0.0, np.inf)))
        v, f = np.roll(v, -start), np.roll(f, -start)
        f = 0.25 * np.roll(f, 1) + 0.5 * f + 0.25 * np.roll(f, -1)
        stop = max(int(np.argmax(v)), 3)
        near = f[1:stop][v[1:stop] < 0.3]
        if len(near) > 2:
            top = 1 + int(np.argmax(near))
            drops.append(float(f[top] - f[top:stop].min()))
    if len(drops) < 2 or min(drops) < max(CLEAR * noise + e.noise["force"], 2 * SMALL * np.ptp(force)):
        return []
    hum = sum(size for lines in e.mains["force"].values() for _, size in lines)
    if min(drops) < 2.0 * hum + CLEAR * noise:
        return []  # the waves of the mains are seen, not the damper
    size = float(np.mean(drops))
    message = f"behind each reversal the force falls by {size:.3g} N although the velocity grows: stick-slip"
    remedy = "Seals or bearings hold more at rest: add `StribeckFriction` to the law, or lubricate and align."
    return e.finding("warning", "stick-slip", message, size, "N", None, remedy)


def drift(e: Examined) -> list[Finding]:
    """Damping or static force that changes from cycle to cycle, as a damper does that grows warm.

    Where the command varies it says nothing.
    """
    if e.cycles is None or len(e.cycles.periods) < 5 or e.run.command_channel is not None:
        return []
    figures = {name: values for (name, _), values in cycle_figures(e.cycles).items()}
    time = e.cycles.starts - e.cycles.starts[0]
    place = (e.moving.start, min(e.moving.stop, len(e.run)) - 1)
    findings = []
    change, clear = _trend(time, figures["equivalent damping"])
    relative = change / float(figures["equivalent damping"].mean())
    if clear and abs(relative) > SMALL:
        message = f"the damping changes by {100 * relative:+.2g} % over the record, as by heat"
        remedy = 'Warm the damper up, record shorter, or fit the heat beside the law, `rig="heat"`.'
        findings += e.finding("warning", "drift of damping", message, relative, "", place, remedy)
    change, clear = _trend(time, figures["static force"])
    if clear and abs(change) > SMALL * np.ptp(e.cycles.force):
        message = f"the static force changes by {change:+.3g} N over the record, as gas that grows warm, or a load cell"
        findings += e.finding(
            "warning", "drift of static force", message, change, "N", place, "Let the damper settle first."
        )
    return findings


def _trend(time: Float[np.ndarray, " cycles"], values: Float[np.ndarray, " cycles"]) -> tuple[float, bool]:
    """Change over the record by a straight line, and whether it is beyond what scatter makes once in 10 000 times."""
    from scipy.special import stdtrit

    t = time - time.mean()
    slope = float(np.dot(t, values) / np.dot(t, t))
    residual = values - values.mean() - slope * t
    error = float(np.sqrt(np.sum(residual**2) / (len(t) - 2) / np.dot(t, t)))
    return slope * float(time[-1] - time[0]), bool(abs(slope) > float(stdtrit(len(t) - 2, 1 - 5e-5)) * error)
