"""Frequency response of a vehicle whose laws are not linear: its steady motion on a sine of given amplitude."""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._limits import largest
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._steady_cycles import AbstractSteadyCycles, checked_points, is_steady, span
from jaxdamp._tables import Column, Contents, Table, with_unit
from jaxdamp._traced import behind
from jaxdamp._types import Figure, ScalarLike
from jaxdamp.dampers import has_fitted_range, warn_outside
from jaxdamp.simulation.harmonic_cycle import Cycle, Excitation, sweep
from jaxdamp.simulation.notes import range_sentences, range_uses
from jaxdamp.simulation.run import refuse_stacked
from jaxdamp.simulation.stability import known_cars, known_system, step_need
from jaxdamp.simulation.step_size import USUAL
from jaxdamp.vehicles import AbstractVehicle, ChannelKind, Layout, delays_of, refuse_controller, static_equilibrium


SAMPLES = 256
MOST_STEPS = 2**18  # in a period


@final
class HarmonicResponse(AbstractSteadyCycles):
    """The steady motion of a vehicle on a sine under its wheels, at every frequency.

    `result["sprung_acceleration"]` is a channel over the steady cycles, whose first instant is where the road under the
    front axle rises through zero. `result.gain(channel)` is to be compared with `vehicles.frequency_response`. Where no
    steady motion was found, all these are NaN.

    Attributes:
        layout: names and units of the vehicle.
        frequency: [Hz], in the order of the sweep, shape (frequencies,).
        amplitude: of the road [m], shape (..., frequencies).
        cycles: all channels, shape (..., frequencies, samples, channels).
        monodromy: derivatives of motion, states of laws, and memory of the steps, by their values a period earlier.
        change: the largest change over a period, relative to the largest values in it.
        substeps: steps from one sample to the next.
    """

    layout: Layout = eqx.field(static=True)
    frequency: Float[Array, " frequencies"]
    amplitude: Float[Array, "... frequencies"]
    cycles: Float[Array, "... frequencies samples channels"]
    monodromy: Float[Array, "... frequencies state state"]
    change: Float[Array, "... frequencies"]
    substeps: int = eqx.field(static=True)

    def __getitem__(self, channel: str) -> Float[Array, "... frequencies samples"]:
        """A channel over the steady cycles, in its unit."""
        _checks.one_of("channel", channel, self.layout.numbers)
        return self.cycles[..., self.layout.numbers[channel]]

    def harmonics(self, channel: str) -> Complex[Array, "... frequencies orders"]:
        """Complex amplitudes Y_k of a channel in its unit, y(t) = Y_0 + Im Σ Y_k exp(2πi k f t).

        The mean, the first harmonic, and the superharmonics 2f, 3f ...; the road is Im A exp(2πift).
        """
        values = self[channel]
        spectrum = jnp.fft.rfft(values, axis=-1) / values.shape[-1]
        orders = spectrum[..., : values.shape[-1] // 2]
        return jnp.concatenate([orders[..., :1], 2j * orders[..., 1:]], axis=-1)

    def gain(self, channel: str) -> Complex[Array, "... frequencies"]:
        """First harmonic of a channel over the amplitude of the road, in its unit per metre: the transmissibility."""
        first = self.harmonics(channel)[..., 1]
        return first / self.amplitude.astype(first.dtype)

    def peak(self, channel: str) -> Float[Array, "... frequencies"]:
        """Half of the difference between the highest and the lowest value of a channel in a cycle, in its unit."""
        values = self[channel]
        return 0.5 * (largest(values, axis=-1) + largest(-values, axis=-1))

    def distortion(self, channel: str) -> Float[Array, "... frequencies"]:
        """RMS of the superharmonics of a channel over that of its first harmonic."""
        squares = jnp.abs(self.harmonics(channel)) ** 2
        return jnp.sqrt(jnp.sum(squares[..., 2:], axis=-1) / squares[..., 1])

    @property
    def summary(self) -> str:
        """What was swept, and how many steady motions were found."""
        frequency, size = np.asarray(self.frequency), np.asarray(self.amplitude)
        rows = int(np.prod(size.shape[:-1]))
        several = f", {rows} amplitudes" if rows > 1 else ""
        return (
            f"Steady response to a sine from {frequency[0]:.4g} to {frequency[-1]:.4g} Hz, {frequency.size} frequencies"
            f"{several}, amplitude {span(1e3 * size)} mm: {int(self.stable.sum())} of {size.size} steady and stable."
        )

    def table(self) -> Table:
        """The largest response of every channel: where, with its gain and its superharmonics."""
        columns = (
            Column("channel"), Column("unit"), Column("largest half range"), Column("frequency", "Hz"),
            Column("road amplitude", "mm"), Column("gain per metre"), Column("superharmonics", "%", ".2g"),
        )  # fmt: skip
        rows = []
        for channel in self.layout.channels:
            if channel.kind is ChannelKind.ROAD_HEIGHT:
                continue
            peak = np.asarray(self.peak(channel.name))
            if np.all(np.isnan(peak)):
                continue
            at = np.unravel_index(int(np.nanargmax(peak)), peak.shape)
            gain, share = np.abs(self.gain(channel.name))[at], 100.0 * np.asarray(self.distortion(channel.name))[at]
            numbers = (peak[at], self.frequency[at[-1]], 1e3 * self.amplitude[at], gain, share)
            rows.append((channel.name, channel.unit, *map(float, numbers)))
        return Table("Largest steady response", columns, tuple(rows))

    def content(self) -> Contents:
        """Frequencies, amplitudes, status, and first harmonics and half ranges of every channel, ready for JSON."""
        units = self.layout.units
        return {
            "frequency": with_unit(np.asarray(self.frequency), "Hz"),
            "amplitude": with_unit(np.asarray(self.amplitude), "m"),
            "largest_multiplier": with_unit(np.abs(self.multipliers[..., 0]), ""),
            "first_harmonic": {
                name: with_unit(np.abs(np.asarray(self.harmonics(name)[..., 1])), unit) for name, unit in units.items()
            },
            "half_range": {name: with_unit(np.asarray(self.peak(name)), unit) for name, unit in units.items()},
        }

    def plot(self, channels: Sequence[str] | None = None) -> Figure:
        """First harmonic per metre of road over frequency, one curve for each amplitude (`plots.harmonic_response`).

        Arguments:
            channels: to draw; acceleration of the body, stroke and tyre load if left out.
        """
        from jaxdamp import plots

        return plots.harmonic_response(self, channels)


def harmonic_response(
    vehicle: AbstractVehicle,
    frequency: ArrayLike | Sequence[float],
    amplitude: ArrayLike | Sequence[float] | Sequence[Sequence[float]],
    *,
    speed: ScalarLike | None = None,
    in_phase: bool = False,
    samples: int = SAMPLES,
    substeps: int | None = None,
) -> HarmonicResponse:
    """The steady motion of a vehicle on the road z = A sin 2πft, with all its laws as they are.

    `vehicles.frequency_response` is that of small motion, or of equivalent linear laws; this one is exact for laws of
    any kind: friction, hysteresis, blow-off, bump stops, tyres that lift off. The state s in which the vehicle is again
    after one period, s = P(s), is searched by Newton's method (shooting) with the monodromy matrix J = ∂P/∂s, or by
    driving on where that leads away. The steps are those of `simulate`. Derivatives by every parameter of the vehicle,
    frequency and amplitude are those of the implicit function theorem, (1 − J)⁻¹ ∂P.

    Frequencies are taken in the order given, each from the motion at the one before, as in a swept sine test: where
    several motions are possible, rising and falling frequencies give different ones. Motions that are unstable are left
    as on a test rig, unless no stable one is found.

    Arguments:
        vehicle: any vehicle.
        frequency: [Hz], in the order of the sweep, shape (frequencies,).
        amplitude: A [m], one, or one for each frequency (`v / (2 * np.pi * frequency)` for an amplitude v of the
            velocity), or rows of them for several sweeps: shape (..., frequencies), or (..., 1).
        speed: of the vehicle [m/s], with which one axle comes after the other; not needed for a single axle.
        in_phase: the road is under all axles at once, instead of a speed.
        samples: of a period that are kept; superharmonics up to half as many.
        substeps: steps from one sample to the next; left out, as many as the steepest law needs at the lowest
            frequency, and steps of 1 ms at most. Must be given where numbers are not known, inside `jax.jit`.

    Returns:
        The steady cycles, with gains, superharmonics, multipliers, and a status for each frequency.

    Raises:
        ValueError: frequencies or amplitudes that are not positive or do not fit together; a vehicle without
            equilibrium; laws that need too many steps in a period.

    Valid for motions that repeat with each period of the road. A car that moves differently from period to period
    (subharmonics, chaos) has none that is stable, and its status says so. The error is that of the steps: double
    `substeps` to see it.

    Source: Nayfeh and Balachandran, Applied Nonlinear Dynamics (1995), chapters 3 and 6.

    >>> from jaxdamp.dampers import CoulombFriction, Linear
    >>> from jaxdamp.vehicles.presets import quarter_car_000
    >>> car = quarter_car_000(Linear(1000.0) + CoulombFriction(60.0, 0.01))
    >>> result = harmonic_response(car, np.linspace(0.5, 2.5, 21), np.array([[0.002], [0.02]]))
    >>> [round(float(gain), 2) for gain in abs(result.gain("z_sprung")).max(axis=1)]  # friction breaks loose
    [5.22, 11.75]
    """
    check_module("vehicle", vehicle, (AbstractVehicle,), "harmonic_response(vehicle, frequency, amplitude)")
    refuse_controller(vehicle, "a periodic response")
    refuse_stacked(vehicle)
    points, sizes = checked_points(frequency, amplitude)
    behind_front = jnp.stack([wheel.behind for wheel in vehicle.frame().wheels])
    delays = delays_of(behind_front, max(vehicle.layout.axles) + 1, speed, in_phase)
    if not isinstance(samples, int | np.integer) or samples < 16 or samples % 2:
        _checks.refuse("samples", "be an even whole number, 16 or more", repr(samples))
    substeps = _substeps(vehicle, points, int(samples), substeps)
    cycles, change, monodromy = _swept(vehicle, points, sizes, delays, int(samples), substeps)
    channels = jnp.where(is_steady(change)[..., None, None], cycles.channels, jnp.nan)
    concrete = _checks.concrete(cycles.motion)
    if concrete is not None and not np.any(np.isfinite(concrete)):
        static_equilibrium(vehicle)  # which refuses one that has none
    if concrete is not None and has_fitted_range(vehicle):
        flat = [values.reshape(-1, values.shape[-1]) for values in cycles[1:]]
        motion, force, road, rate = flat
        warn_outside(range_sentences(range_uses(vehicle, vehicle.system().form, motion, road, rate, force)))
    return HarmonicResponse(
        layout=vehicle.layout, frequency=points, amplitude=sizes, cycles=channels, monodromy=monodromy, change=change,
        substeps=substeps,
    )  # fmt: skip


def _substeps(vehicle: AbstractVehicle, frequency: Array, samples: int, wanted: int | None) -> int:
    """Steps from one sample to the next: as many as the laws need at the lowest frequency, or as the caller says."""
    if wanted is not None:
        if not isinstance(wanted, int | np.integer) or wanted < 1:
            _checks.refuse("substeps", "be a whole number, 1 or more", repr(wanted))
        return int(wanted)
    concrete = behind(frequency)
    lowest = 1.0 if concrete is None else float(np.min(concrete))
    dt = 1.0 / (lowest * samples)
    cars = None if concrete is None else known_cars(known_system(vehicle), dt)
    if cars is None:
        remedy = "Pass as many as `harmonic_response(...).substeps` says outside the compiled function."
        _checks.refuse("substeps", "be given where the numbers of the vehicle are traced", None, remedy)
    needed = max(step_need(*car, dt, most=np.inf).substeps for car in cars)
    count = max(needed, int(np.ceil(dt / USUAL * (1.0 - 1e-9))))
    if count * samples > MOST_STEPS:
        must = f"need at most {MOST_STEPS} steps in a period"
        remedy = "Begin at a higher frequency, or widen the velocity over which the force of a law changes sign."
        _checks.refuse("vehicle", must, f"one that needs {count * samples} at {lowest:.4g} Hz", remedy)
    return count


@compiled_for_loops
def _swept(
    vehicle: AbstractVehicle, frequency: Array, amplitude: Array, delays: Array, samples: int, substeps: int
) -> tuple[Cycle, Array, Array]:
    """Steady cycles, their change over a period, and the monodromy matrices."""
    one = jnp.ones((), frequency.dtype)
    excitation = Excitation(vehicle.system(), one, one, delays, samples, substeps)
    rows = amplitude.reshape(-1, frequency.size)
    cycles, shots = jax.vmap(lambda row: sweep(excitation, frequency, row))(rows)
    result = cycles, shots.change, shots.monodromy
    return jax.tree.map(lambda values: values.reshape(*amplitude.shape, *values.shape[2:]), result)
