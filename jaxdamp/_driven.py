"""States of ordinary differential equations by the solvers of diffrax; imported when asked for."""

import dataclasses
from collections.abc import Callable

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array, Float, PyTree

from jaxdamp import _checks
from jaxdamp._jacobian import Mode
from jaxdamp._types import Scalar, Signal, State


STEPS_PER_INSTANT = 1000  # on average: more are a law too fast for the solver, and would take for ever
NEGLIGIBLE = 1e-3  # of the tolerance: smaller Newton steps of an implicit solver are rounding errors


def check_solver(solver: object, rtol: float, atol: float) -> None:
    """Refuse what is no solver of diffrax, and tolerances that are not positive."""
    if not isinstance(solver, diffrax.AbstractSolver):
        _checks.refuse("solver", "be a solver of diffrax", _checks.described(solver), "Pass `diffrax.Kvaerno5()`.")
    _checks.positive("rtol", rtol)
    _checks.positive("atol", atol)


def verdict(result: object) -> str:
    """What a solver says of its end; nothing if it is content."""
    return diffrax.RESULTS[result]


def solve(
    field: Callable[[Scalar, PyTree], PyTree],
    start: PyTree,
    time: Signal,
    solver: diffrax.AbstractSolver,
    rtol: float,
    atol: float,
    *,
    mode: Mode = "forward",
    every: int = 1,
    steps_per_instant: int = STEPS_PER_INSTANT,
) -> tuple[PyTree, PyTree]:
    """States of ẏ = field(t, y) at every so many-th instant, and the solver's verdict.

    Arguments:
        field: smooth between the instants, where steps end.
        start: states at the first instant, any tree.
        time: uniform instants [s].
        solver: of diffrax.
        rtol: relative tolerance.
        atol: absolute tolerance.
        mode: the derivatives that pass; reverse ones drive the run again from checkpoints.
        every: states are saved at one instant in so many.
        steps_per_instant: after so many times the number of instants it gives up.
    """
    forward, solver = mode == "forward", _quiet_at_rest(solver)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: field(jnp.asarray(t), y)),
        solver,
        time[0],
        time[-1],
        0.1 * (time[-1] - time[0]) / (time.size - 1),
        start,
        saveat=diffrax.SaveAt(ts=time[::every]),
        stepsize_controller=diffrax.ClipStepSizeController(
            diffrax.PIDController(rtol=rtol, atol=atol), jump_ts=time[1:-1]
        ),
        max_steps=steps_per_instant * time.size,
        adjoint=diffrax.ForwardMode() if forward else diffrax.RecursiveCheckpointAdjoint(),
        throw=False,
    )
    assert solution.ys is not None
    return (jax.tree.map(_forward_only.bind, solution.ys) if forward else solution.ys), solution.result


def _quiet_at_rest(solver: diffrax.AbstractSolver) -> diffrax.AbstractSolver:
    """An implicit solver whose Newton steps have converged where they are rounding errors.

    By itself it compares two of them, takes the second for divergence if it is the larger one, and shortens its step
    until it gives up: at rest a stiff law would never pass.
    """
    finder = getattr(solver, "root_finder", None)
    if not isinstance(finder, diffrax.VeryChord) or callable(finder.norm):  # a norm of one's own
        return solver

    return dataclasses.replace(solver, root_finder=dataclasses.replace(finder, norm=_without_rounding))


def _without_rounding(errors: PyTree) -> Scalar:
    """The root mean square of errors relative to the tolerance; 0 far below it."""
    size = optx.rms_norm(errors)
    return jnp.where(size < NEGLIGIBLE, jnp.zeros_like(size), size)


_FORWARD_ONLY = "pass no reverse derivatives (`jax.grad`) as they are. Pass `simulation.Adaptive(..., mode='reverse')`"
_forward_only = Primitive("forward_only")
_forward_only.def_impl(lambda x: x)
_forward_only.def_abstract_eval(lambda x: x)
batching.defvectorized(_forward_only)
mlir.register_lowering(_forward_only, lambda context, x: [x])


def _refuse_reverse(cotangent: PyTree, x: PyTree) -> PyTree:
    raise ValueError(
        f"Adaptive engines {_FORWARD_ONLY}, or take `simulation.Exponential()`, which passes forward and reverse ones."
    )


ad.deflinear2(_forward_only, _refuse_reverse)


def hermite(now: Scalar, time: Signal, values: Signal, slopes: Signal) -> tuple[Scalar, Scalar]:
    """Value and slope of the cubic between instants (uniform) that has these values and slopes there."""
    step = (time[-1] - time[0]) / (time.size - 1)
    i = jnp.clip(jnp.floor((now - time[0]) / step).astype(int), 0, time.size - 2)
    s = (now - time[i]) / step
    rise, bend0, bend1 = values[i + 1] - values[i], step * slopes[i], step * slopes[i + 1]
    cubic, square = bend0 + bend1 - 2.0 * rise, 3.0 * rise - 2.0 * bend0 - bend1
    value = values[i] + s * (bend0 + s * (square + s * cubic))
    return value, (bend0 + s * (2.0 * square + 3.0 * s * cubic)) / step


@eqx.filter_jit
def driven_states(
    rate: Callable[..., PyTree],
    start: State,
    time: Signal,
    stroke: Signal,
    velocity: Signal,
    solver: diffrax.AbstractSolver,
    rtol: float,
    atol: float,
    mode: Mode = "forward",
) -> tuple[Float[Array, "time states"], PyTree]:
    """States at the instants, ẏ = rate(x, v, y), and the solver's verdict.

    The stroke is cubic between the instants and v its derivative; steps end at the instants, where v has kinks.
    """

    def field(now: Scalar, state: State) -> State:
        return rate(*hermite(now, time, stroke, velocity), state)

    return solve(field, start, time, solver, rtol, atol, mode=mode)
