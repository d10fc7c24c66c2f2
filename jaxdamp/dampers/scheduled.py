"""Any law with parameters or a force that depends on a command: coil current, valve current, clicks."""

from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdamp import _checks
from jaxdamp._field_types import check_field_types
from jaxdamp._limits import at_least, at_most, within
from jaxdamp._types import Number, ScalarLike, Vector
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits, combined_traits
from jaxdamp.dampers.fitted_range import without_fitted_ranges
from jaxdamp.dampers.inside import command_paths
from jaxdamp.dampers.sum import Scaled, Sum
from jaxdamp.dampers.wrapper import AbstractWrapper
from jaxdamp.parameters import Domain, get, increasing, interval, modules_inside, real, setting


BLENDS = ("parameters", "force")


def _between_levels(law: "Scheduled") -> Domain:
    """Where a command can be: between the outer levels, where those are known."""
    levels = _checks.concrete(law.levels)
    if levels is None or levels.ndim != 1 or not increasing.contains(levels) or levels.size < 2:
        return real
    return interval(*levels[[0, -1]].tolist())


@final
class Scheduled(AbstractWrapper):
    """A law between laws that are given at commands uₖ: their parameters are interpolated, or their forces.

    With the shares wₖ of straight lines between the levels, (uₖ₊₁ − u)/(uₖ₊₁ − uₖ) for the level below the command,
    (u − uₖ)/(uₖ₊₁ − uₖ) for the one above and zero for all others, which add up to one:

        blend="parameters":  p(u) = Σ wₖ pₖ for every parameter p of laws of equal structure
        blend="force":       F(u) = Σ wₖ Fₖ, every law with its own states, which all go on at any command

    A wider orifice or a larger yield force is a parameter that moves with the command: interpolated parameters then are
    the damper in between, with one law's states and cost. But the force in between is sensible only if the parameters
    mean the same at both levels. Fits of laws with numbers that the records do not determine can have the same force by
    other knots, stiffnesses or exponents, and the law between such numbers may be far from both. The blended force is
    never outside the span of its neighbours' forces; the laws may be of any structure. It takes the states and the time
    of all laws. For a law that is linear in its parameters and has no states, such as a table, both are the same.

    Parameters stay in their domains, since between two positive numbers all are positive. The command is constant
    during a run, like a coil current on the bench. It can be any quantity, in the unit of the levels; commands outside
    the levels are refused (inside compiled code the nearest level is used). Put a wrapper outside if its parameters do
    not depend on the command: `Lag(Scheduled(...), lag_time)`.

    `identify.fit` fits records at several commands (`bench.read(..., command=...)`) by one law, each record at its own
    command. With as many levels as commands, every command has its own parameters; with fewer, the fit interpolates.
    `identify.fit_scheduled` finds the laws at all commands and the blend that predicts the records between them.

    Arguments:
        laws: two or more laws, of equal structure unless forces are blended.
        levels: strictly increasing commands uₖ of these laws, shape (laws,).
        command: the present command u.
        blend: `"parameters"` or `"force"`.

    >>> from jaxdamp.dampers import Bilinear, Linear
    >>> law = Scheduled((Bilinear(900.0, 500.0), Bilinear(4900.0, 2500.0)), levels=[0.0, 2.0], command=0.5)
    >>> float(law.force(0.0, 1.0, law.initial_state()))
    1900.0
    >>> law = Scheduled((Linear(900.0), Bilinear(4900.0, 2500.0)), levels=[0.0, 2.0], command=0.5, blend="force")
    >>> float(law.force(0.0, 1.0, law.initial_state()))
    1900.0
    """

    laws: tuple[AbstractDamper, ...]
    levels: Vector = setting("", "commands of the laws", increasing)
    command: Number = setting("", "command, in the unit of the levels", _between_levels, command=True)
    blend: str = eqx.field(static=True, default="parameters")

    def __check_init__(self) -> None:
        check_field_types(self)
        _checks.one_of("blend", self.blend, BLENDS)
        if len(self.laws) < 2 or self.levels.shape != (len(self.laws),):
            must = "contain two or more laws, with a level for each"
            _checks.refuse("laws", must, f"{len(self.laws)} laws and levels of shape {self.levels.shape}")
        if self.blend == "parameters" and not self.of_equal_structure(self.laws):
            remedy = 'Blend their forces, `blend="force"`, or use one law class with vectors of equal length.'
            _checks.refuse("laws", "be of equal structure", ", ".join(map(repr, self.laws)), remedy)

    @staticmethod
    def of_equal_structure(laws: Sequence[AbstractDamper]) -> bool:
        """Whether all laws have the same parameters in the same shapes, so that these can be interpolated."""
        structures = {
            (jax.tree.structure(law), tuple(jnp.shape(leaf) for leaf in jax.tree.leaves(law)))
            for law in without_fitted_ranges(tuple(laws))
        }
        return len(structures) == 1

    def at(self, command: ScalarLike) -> AbstractDamper:
        """The law at another command, not checked, by sums of products, which a loop computes at every step.

        Beyond the levels, where its value has no meaning, it goes straight on, so that slopes at the outer levels are
        those inside.
        """
        count = len(self.laws) - 1
        climbed = [(command - self.levels[i]) / (self.levels[i + 1] - self.levels[i]) for i in range(count)]
        climbed = [at_least(share, 0.0) if i else share for i, share in enumerate(climbed)]
        climbed = [at_most(share, 1.0) if i + 1 < count else share for i, share in enumerate(climbed)]
        if self.blend == "force":
            return self._blended([a - b for a, b in zip((1.0, *climbed), (*climbed, 0.0), strict=True)])
        laws = without_fitted_ranges(self.laws)

        def interpolated(first: Array, *others: Array) -> Array:
            pairs = zip((first, *others), others, climbed, strict=False)
            return first + sum(share * (after - before) for before, after, share in pairs)

        return jax.tree.map(interpolated, *laws)

    def at_level(self, number: int) -> AbstractDamper:
        """The law at one of the levels; of blended forces with the states of all."""
        if self.blend == "force":
            return self._blended(list(jnp.eye(len(self.laws))[number]))
        return without_fitted_ranges(self.laws)[number]

    def _blended(self, shares: Sequence[ScalarLike]) -> AbstractDamper:
        """The sum of the laws' forces by shares."""
        laws = without_fitted_ranges(self.laws)
        return Sum(tuple(Scaled(law, jnp.asarray(share)) for law, share in zip(laws, shares, strict=True)))

    def shares(self) -> Float[Array, " laws"]:
        """Weight of each law in the interpolation; the sum is one."""
        climbed = within((self.command - self.levels[:-1]) / jnp.diff(self.levels), 0.0, 1.0)
        edges = jnp.concatenate([jnp.ones(1, climbed.dtype), climbed, jnp.zeros(1, climbed.dtype)])
        return edges[:-1] - edges[1:]

    def at_command(self) -> AbstractDamper:
        """The law at the command: with the interpolated parameters, or the weighted sum of the laws."""
        shares = self.shares()
        if self.blend == "force":
            return self._blended([shares[i] for i in range(len(self.laws))])
        laws = without_fitted_ranges(self.laws)
        return jax.tree.map(lambda *leaves: jnp.tensordot(shares, jnp.stack(leaves), 1), *laws)

    def inner_law(self) -> AbstractDamper:
        """The law at the command."""
        return self.at_command()

    def traits(self) -> Traits:
        """Those of the laws, combined; linear in the parameters if all laws are."""
        return combined_traits(law.traits() for law in self.laws)

    def side_by_side(self) -> tuple[AbstractDamper, ...]:
        """The terms of the law at the command."""
        return self.inner_law().side_by_side()


def command_words(module: object) -> str:
    """At which command the laws of a module are, and between which it can be; empty where none takes one.

    Arguments:
        module: a law or a vehicle.

    >>> from jaxdamp.dampers import Linear
    >>> command_words(Scheduled((Linear(900.0), Linear(1500.0)), levels=[2.0, 10.0], command=6.0))
    'at command 6 of 2 to 10'
    """
    laws = ((path, law) for path, law in modules_inside(module) if isinstance(law, Scheduled))
    spans = {f"{path}command": " of {:g} to {:g}".format(*np.asarray(law.levels)[[0, -1]]) for path, law in laws}
    said = [f"{float(get(module, path)):g}{spans.get(path, '')}" for path in command_paths(module)]
    return f"at command {' and '.join(dict.fromkeys(said))}" if said else ""
