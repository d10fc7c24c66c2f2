"""Any law whose parameters follow a command: coil current, valve current, clicks."""

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
    """One law between laws of one structure that hold at commands uₖ: all their numbers are interpolated at u.

    p(u) = pₖ + (pₖ₊₁ − pₖ)(u − uₖ)/(uₖ₊₁ − uₖ) for every number p of the laws, then the law with p(u). For a law that
    is linear in its parameters, such as a table, that interpolates the force. Domains are kept, for between two
    positive numbers all are positive. The command is a constant of a run, as a coil current held on the bench is: it is
    any quantity, in the unit of the levels, and commands beyond them are refused (inside compiled code they are held
    at the nearest level). States are those of the law; where a wrapper need not follow the command, put it outside:
    `Lag(Scheduled(...), lag_time)`.

    Records at several commands (`bench.read(..., command=...)`) are fitted as one law by `identify.fit`, which sets
    each record's own command: with as many levels as currents every current has its own numbers, with fewer the law
    also says what happens between.

    Arguments:
        laws: two laws or more, of one structure.
        levels: strictly increasing commands uₖ at which they hold, shape (laws,).
        command: u.

    >>> from jaxdamp.dampers import Bilinear
    >>> law = Scheduled((Bilinear(900.0, 500.0), Bilinear(4900.0, 2500.0)), levels=[0.0, 2.0], command=0.5)
    >>> float(law.force(0.0, 1.0, law.initial_state()))
    1900.0
    """

    laws: tuple[AbstractDamper, ...]
    levels: Vector = setting("", "commands at which the laws hold", increasing)
    command: Number = setting("", "command, in the unit of the levels", command=True)

    def __check_init__(self) -> None:
        check_field_types(self)
        if len(self.laws) < 2 or self.levels.shape != (len(self.laws),):
            must = "hold two laws or more, and a level for each"
            _checks.refuse("laws", must, f"{len(self.laws)} laws and levels of shape {self.levels.shape}")
        structures = {
            (jax.tree.structure(law), tuple(jnp.shape(leaf) for leaf in jax.tree.leaves(law)))
            for law in without_fitted_ranges(self.laws)
        }
        if len(structures) > 1:
            remedy = "Use one law class with vectors of one length, such as tables over the same velocities."
            _checks.refuse("laws", "be of one structure", ", ".join(map(repr, self.laws)), remedy)
        command, levels = _checks.concrete(self.command), _checks.concrete(self.levels)
        if command is not None and levels is not None and not levels[0] <= command <= levels[-1]:
            must = f"be between the levels {levels[0]:g} and {levels[-1]:g}"
            _checks.refuse("command", must, f"{command:g}", "Give a law for a level further out.")

    def shares(self) -> Float[Array, " laws"]:
        """How much of each law's numbers is taken; the sum is one."""
        climbed = within((self.command - self.levels[:-1]) / jnp.diff(self.levels), 0.0, 1.0)
        edges = jnp.concatenate([jnp.ones(1, climbed.dtype), climbed, jnp.zeros(1, climbed.dtype)])
        return edges[:-1] - edges[1:]

    def at_command(self) -> AbstractDamper:
        """The law with its numbers at the command."""
        shares, laws = self.shares(), without_fitted_ranges(self.laws)
        return jax.tree.map(lambda *leaves: jnp.tensordot(shares, jnp.stack(leaves), 1), *laws)

    def inner_law(self) -> AbstractDamper:
        """The law at the command."""
        return self.at_command()

    def traits(self) -> Traits:
        """Those of the laws, which are of one structure."""
        return self.laws[0].traits()

    def side_by_side(self) -> tuple[AbstractDamper, ...]:
        """The terms of the law at the command."""
        return self.inner_law().side_by_side()
