"""Dynamic stiffness and damping of a law over frequency and amplitude, as test machines measure them."""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Complex, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp._periodic import Shot, shoot, steady_state, with_derivatives
from jaxdamp._quickly import compiled_for_loops
from jaxdamp._results import drawn_by
from jaxdamp._sharded import varying_as
from jaxdamp._steady_cycles import AbstractSteadyCycles, checked_points, is_steady, span
from jaxdamp._tables import Column, Table, plain
from jaxdamp._traced import behind
from jaxdamp._types import Scalar, ScalarLike, Signal, State
from jaxdamp.dampers import AbstractDamper
from jaxdamp.rig.strokes import refuse_strokes


SAMPLES = 256  # of a period
LONGEST_STEP = 1e-3  # s
MOST_STEPS = 2**16  # in a period


@final
class DynamicStiffness(AbstractSteadyCycles):
    """The steady force of a law on the stroke x = x₀ + X sin 2πft, for every frequency and amplitude.

    With the first harmonic F₁ of the force the complex stiffness is K* = F₁/X = K′ + i K″. Where the force does not
    settle, all these are NaN.

    Attributes:
        frequency: f [Hz], shape (frequencies,).
        amplitude: X [m], shape (..., frequencies).
        force: over a cycle that begins in the middle of extension [N], shape (..., frequencies, samples).
        mean: x₀ [m].
        monodromy: derivatives of the states of the law by their values a period earlier.
        change: the largest change of the states over a period, relative to their largest values in it.
    """

    frequency: Float[Array, " frequencies"]
    amplitude: Float[Array, "... frequencies"]
    force: Float[Array, "... frequencies samples"]
    mean: Scalar
    monodromy: Float[Array, "... frequencies state state"]
    change: Float[Array, "... frequencies"]

    @property
    def complex_stiffness(self) -> Complex[Array, "... frequencies"]:
        """K* [N/m], first harmonic of the force over the amplitude of the stroke."""
        angle = 2.0 * jnp.pi * jnp.arange(float(self.force.shape[-1])) / self.force.shape[-1]
        phase = jax.lax.complex(jnp.cos(angle), -jnp.sin(angle))
        return 2j / phase.size * (self.force.astype(phase.dtype) @ phase) / self.amplitude.astype(phase.dtype)

    @property
    def stiffness(self) -> Float[Array, "... frequencies"]:
        """Dynamic stiffness |K*| [N/m]."""
        return jnp.abs(self.complex_stiffness)

    @property
    def loss_angle(self) -> Float[Array, "... frequencies"]:
        """δ, by which the force leads the stroke [rad]; π/2 for a dashpot, 0 for a spring."""
        return jnp.angle(self.complex_stiffness)

    @property
    def damping(self) -> Float[Array, "... frequencies"]:
        """Equivalent damping K″/(2πf) [N s/m], which dissipates the energy of a cycle, ∮ F dx = πωX² times it."""
        return jnp.imag(self.complex_stiffness) / (
            2.0 * jnp.pi * jnp.broadcast_to(self.frequency, self.amplitude.shape)
        )

    @property
    def summary(self) -> str:
        """What was swept, and the range of stiffness and damping."""
        if not self.steady.any():
            return f"No steady force at any of {self.change.size} points."
        stiffness, damping = (np.asarray(values)[self.steady] for values in (self.stiffness, self.damping))
        return (
            f"Dynamic stiffness {span(1e-3 * stiffness)} N/mm, equivalent damping {span(damping)} N s/m at "
            f"{span(np.asarray(self.frequency))} Hz and amplitudes of {span(1e3 * np.asarray(self.amplitude))} mm."
        )

    def table(self) -> Table:
        """A row for every amplitude and frequency."""
        columns = (
            Column("amplitude", "mm"), Column("frequency", "Hz"), Column("dynamic stiffness", "N/mm"),
            Column("loss angle", "deg", ".1f"), Column("equivalent damping", "N s/m"),
        )  # fmt: skip
        frequency = jnp.broadcast_to(self.frequency, self.amplitude.shape)
        numbers = (
            1e3 * self.amplitude,
            frequency,
            1e-3 * self.stiffness,
            180.0 / np.pi * self.loss_angle,
            self.damping,
        )
        rows = np.stack([np.asarray(values).ravel() for values in numbers], axis=1)
        return Table("Dynamic stiffness", columns, tuple(tuple(plain(row)) for row in rows))

    plot = drawn_by(
        "dynamic_stiffness", "Stiffness, loss angle and damping over frequency, a curve for each amplitude."
    )


@final
class _Stroke(eqx.Module):
    """A law on a sine, a period in so many steps."""

    law: AbstractDamper
    frequency: Scalar
    amplitude: Scalar
    mean: Scalar
    samples: int = eqx.field(static=True)
    substeps: int = eqx.field(static=True)

    def at(self, turns: Array) -> tuple[Array, Array]:
        """Stroke [m] and velocity [m/s] after so many periods."""
        phase, rate = 2.0 * np.pi * turns, 2.0 * np.pi * self.frequency
        return self.mean + self.amplitude * jnp.sin(phase), rate * self.amplitude * jnp.cos(phase)

    def states(self, state: State) -> tuple[State, Float[Array, "samples state"]]:
        """The states after a period from this one, and those at the samples."""
        count = self.samples * self.substeps
        x, v = self.at(jnp.arange(count + 1.0) / count)
        dt = 1.0 / (self.frequency * count)

        def step(state: State, ends: tuple[Array, ...]) -> tuple[State, None]:
            x0, v0, x1, v1 = ends
            return self.law.advance(x0, v0, x1, v1, state, dt), None

        def sample(state: State, ends: tuple[Array, ...]) -> tuple[State, State]:
            return jax.lax.scan(step, state, ends)[0], state

        ends = tuple(values.reshape(self.samples, self.substeps) for values in (x[:-1], v[:-1], x[1:], v[1:]))
        return jax.lax.scan(sample, varying_as(state, ends), ends)


def _period(state: State, stroke: _Stroke) -> tuple[State, State]:
    """The states a period later, and their largest values in it."""
    after, states = stroke.states(state)
    return after, jnp.max(jnp.abs(states), axis=0)


def dynamic_stiffness(
    law: AbstractDamper,
    frequency: ArrayLike | Sequence[float],
    amplitude: ArrayLike | Sequence[float] | Sequence[Sequence[float]],
    *,
    mean: ScalarLike = 0.0,
    samples: int = SAMPLES,
    substeps: int | None = None,
) -> DynamicStiffness:
    """Dynamic stiffness, loss angle and equivalent damping of a law on a sine, once its force repeats.

    The states with which the law is again after one period are searched by Newton's method (shooting), not by waiting
    for many cycles. Differentiable by the parameters of the law, frequency, amplitude and mean.

    Arguments:
        law: the damper law.
        frequency: [Hz], shape (frequencies,).
        amplitude: of the stroke [m]: one, one for each frequency, or rows of them (`sizes[:, None]`).
        mean: stroke about which the law moves [m].
        samples: of a period that are kept.
        substeps: steps of laws with states from one sample to the next; left out, so many that a step takes 1 ms at
            most. Must be given where the frequencies are not known, inside `jax.jit`.

    Returns:
        Forces over a cycle, complex stiffness, damping, and a status for every point.

    Raises:
        ValueError: frequencies or amplitudes that are not positive or do not fit together, or too low a frequency;
            a stroke outside the limits of the law.

    Valid for forces that repeat with the stroke; a law that goes on heating up or drifting is not steady, as its status
    says. Only the first harmonic counts: of friction F_c alone, K″ = 4 F_c/(πX) and K′ = 0.

    Source: ISO 10846-1 (dynamic transfer stiffness); Den Hartog, Trans. ASME 53 (1931), for friction.

    >>> from jaxdamp.dampers import Linear, SeriesSpring
    >>> result = dynamic_stiffness(SeriesSpring(Linear(2000.0), stiffness=4e5), np.array([1.0, 30.0]), 0.001)
    >>> [round(float(c)) for c in result.damping]  # c/(1 + (ωc/k)²)
    [1998, 1059]
    """
    check_module("law", law, (AbstractDamper,), "dynamic_stiffness(law, frequency, amplitude)")
    _checks.finite("mean", mean)
    points, sizes = checked_points(frequency, amplitude)
    count = _substeps(law, points, samples, substeps)
    middle = jnp.asarray(mean, dtype=float)
    refuse_strokes(law, "amplitude", middle - sizes, middle + sizes)
    force, shots = _forces(law, points, sizes, middle, samples, count)
    force = jnp.where(is_steady(shots.change)[..., None] & jnp.isfinite(force), force, jnp.nan)
    return DynamicStiffness(
        frequency=points, amplitude=sizes, force=force, mean=middle, monodromy=shots.monodromy, change=shots.change
    )


def _substeps(law: AbstractDamper, frequency: Array, samples: int, wanted: int | None) -> int:
    if not isinstance(samples, int | np.integer) or samples < 16 or samples % 2:
        _checks.refuse("samples", "be an even whole number, 16 or more", repr(samples))
    if wanted is not None:
        if not isinstance(wanted, int | np.integer) or wanted < 1:
            _checks.refuse("substeps", "be a whole number, 1 or more", repr(wanted))
        return int(wanted)
    if not law.initial_state().size:
        return 1
    concrete = behind(frequency)
    if concrete is None:
        _checks.refuse("substeps", "be given where the frequencies are traced", None, "Pass `substeps=4`.")
    lowest = float(np.min(concrete))
    count = int(np.ceil(1.0 / (lowest * samples * LONGEST_STEP) * (1.0 - 1e-9)))
    if count * samples > MOST_STEPS:
        remedy = "Pass `substeps`, or begin at a higher frequency."
        _checks.refuse("frequency", f"be above {1.0 / (MOST_STEPS * LONGEST_STEP):.2g} Hz", lowest, remedy)
    return max(count, 1)


@compiled_for_loops
def _forces(
    law: AbstractDamper, frequency: Array, amplitude: Array, mean: Scalar, samples: int, substeps: int
) -> tuple[Float[Array, "... frequencies samples"], Shot]:
    """Steady forces, and a period of the states."""

    def steady(frequency: Scalar, amplitude: Scalar) -> tuple[Signal, Shot]:
        stroke = _Stroke(law, frequency, amplitude, mean, samples, substeps)
        x, v = stroke.at(jnp.arange(float(samples)) / samples)
        start = law.initial_state()
        if not start.size:
            still = jnp.zeros((), x.dtype)
            return jax.vmap(lambda x, v: law.force(x, v, start))(x, v), Shot(start, jnp.zeros((0, 0), x.dtype), still)
        fixed = jax.lax.stop_gradient(stroke)
        state = steady_state(_period, _period(fixed.law.initial_state(), fixed)[0], fixed)
        shot = shoot(_period, state, fixed)
        states = stroke.states(with_derivatives(_period, state, stroke))[1]
        return jax.vmap(law.force)(x, v, states), jax.lax.stop_gradient(shot)

    rows = jnp.broadcast_to(frequency, amplitude.shape).ravel(), amplitude.ravel()
    forces = jax.vmap(steady)(*rows)
    return jax.tree.map(lambda values: values.reshape(*amplitude.shape, *values.shape[1:]), forces)
