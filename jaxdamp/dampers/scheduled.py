"""Any law with parameters that depend on a command: coil current, valve current, clicks."""

from typing import final

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_field_types
from jaxdamp._limits import within
from jaxdamp._types import Number, Vector
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.fitted_range import without_fitted_ranges
from jaxdamp.dampers.traits import Traits
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import increasing, setting


@final
class Scheduled(AbstractWrapper):
    """A law whose parameters are interpolated between laws of equal structure, given at commands uₖ.

    p(u) = pₖ + (pₖ₊₁ − pₖ)(u − uₖ)/(uₖ₊₁ − uₖ) for every parameter p. For a law that is linear in its parameters, such
    as a table, this interpolates the force. Parameters stay in their domains, since between two positive numbers all
    are positive. The command is constant during a run, like a coil current on the bench. It can be any quantity, in the
    unit of the levels; commands outside the levels are refused (inside compiled code the nearest level is used). States
    are those of the law. Put a wrapper outside if its parameters do not depend on the command: `Lag(Scheduled(...),
    lag_time)`.

    `identify.fit` fits records at several commands (`bench.read(..., command=...)`) by one law, each record at its own
    command. With as many levels as commands, every command has its own parameters; with fewer, the fit interpolates.

    Arguments:
        laws: two or more laws of equal structure.
        levels: strictly increasing commands uₖ of these laws, shape (laws,).
        command: the present command u.

    >>> from jaxdamp.dampers import Bilinear
    >>> law = Scheduled((Bilinear(900.0, 500.0), Bilinear(4900.0, 2500.0)), levels=[0.0, 2.0], command=0.5)
    >>> float(law.force(0.0, 1.0, law.initial_state()))
    1900.0
    """

    laws: tuple[AbstractDamper, ...]
    levels: Vector = setting("", "commands of the laws", increasing)
    command: Number = setting("", "command, in the unit of the levels", command=True)

    def __check_init__(self) -> None:
        check_field_types(self)
        if len(self.laws) < 2 or self.levels.shape != (len(self.laws),):
            must = "contain two or more laws, with a level for each"
            _checks.refuse("laws", must, f"{len(self.laws)} laws and levels of shape {self.levels.shape}")
        structures = {
            (jax.tree.structure(law), tuple(jnp.shape(leaf) for leaf in jax.tree.leaves(law))) for law in self.laws
        }
        if len(structures) > 1:
            remedy = "Use one law class with vectors of equal length, such as tables over the same velocities."
            _checks.refuse("laws", "be of equal structure", ", ".join(map(repr, self.laws)), remedy)
        command, levels = _checks.concrete(self.command), _checks.concrete(self.levels)
        if command is not None and levels is not None and not levels[0] <= command <= levels[-1]:
            must = f"be between the levels {levels[0]:g} and {levels[-1]:g}"
            _checks.refuse("command", must, f"{command:g}", "Add a law at a level further out.")

    def shares(self) -> Float[Array, " laws"]:
        """Weight of each law in the interpolation; the sum is one."""
        climbed = within((self.command - self.levels[:-1]) / jnp.diff(self.levels), 0.0, 1.0)
        edges = jnp.concatenate([jnp.ones(1, climbed.dtype), climbed, jnp.zeros(1, climbed.dtype)])
        return edges[:-1] - edges[1:]

    def at_command(self) -> AbstractDamper:
        """The law with the parameters at the command."""
        shares, laws = self.shares(), without_fitted_ranges(self.laws)
        return jax.tree.map(lambda *leaves: jnp.tensordot(shares, jnp.stack(leaves), 1), *laws)

    def inner_law(self) -> AbstractDamper:
        """The law at the command."""
        return self.at_command()

    def traits(self) -> Traits:
        """Those of the laws, which have equal structure."""
        return self.laws[0].traits()

    def side_by_side(self) -> tuple[AbstractDamper, ...]:
        """The terms of the law at the command."""
        return self.inner_law().side_by_side()
