"""Questions to all the laws in a law or vehicle: commands, valid range, conditions between parameters."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxdamp import _checks
from jaxdamp._types import ScalarLike
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.parameters import declared_inside, modules_inside


def laws_inside(tree: object, prefix: str = "") -> list[tuple[str, AbstractDamper]]:
    """All laws in a law, a vehicle or another module, each with the prefix of the paths of its parameters.

    Arguments:
        tree: the module.
        prefix: put before the path of each law.
    """
    return [(path, law) for path, law in modules_inside(tree, prefix) if isinstance(law, AbstractDamper)]


def command_paths(tree: object, prefix: str = "") -> list[str]:
    """Paths of the commands in a law and in the laws inside.

    Arguments:
        tree: a law, a vehicle or another module.
        prefix: put before each path.
    """
    return [path for path, _, has in declared_inside(tree, prefix) if has.get("setting", {}).get("command")]


def values_at_start(tree: object, temperature: ScalarLike) -> dict[str, ScalarLike]:
    """The numbers that a temperature at the first instant of a motion sets, by path, in all laws inside.

    Arguments:
        tree: a law, a vehicle or another module.
        temperature: of the damper [K].
    """
    inside = [(path, law.values_at_start(temperature)) for path, law in laws_inside(tree)]
    return {path + name: value for path, values in inside for name, value in values.items()}


def coverage(law: AbstractDamper) -> str:
    """The valid range of a law and of the laws inside, in words; empty without limits.

    Arguments:
        law: the damper law.
    """
    return " ".join(filter(None, [law.validity(), *map(coverage, law.inner_laws())]))


def require_finite_force(law: AbstractDamper, force: ArrayLike, where: str) -> None:
    """Refuse forces [N] of a law that are not finite (traced ones cannot be checked).

    Arguments:
        law: the damper law.
        force: its forces [N].
        where: for the message, such as "over the whole motion".
    """
    concrete = _checks.concrete(force)
    if concrete is not None and not np.all(np.isfinite(concrete)):
        missing = (
            f"{type(law).__name__} with none at {np.count_nonzero(~np.isfinite(concrete))} of {concrete.size} samples"
        )
        _checks.refuse("law", f"give a finite force {where}", missing, coverage(law))


def margins(tree: object) -> Float[Array, " conditions"]:
    """The margin of each condition of all laws in a law, a vehicle or another module; negative if violated.

    Every margin is in the unit of the parameter that the condition limits.

    Arguments:
        tree: the module.
    """
    each = [getattr(law, c.parameter) - c.least for _, law in laws_inside(tree) for c in law.conditions()]
    return jnp.concatenate([jnp.ravel(margin) for margin in each]) if each else jnp.zeros(0)


def keeps_conditions(tree: object) -> bool:
    """Whether all laws in a law, a vehicle or another module satisfy their conditions; nothing is compiled.

    Arguments:
        tree: the module.
    """
    plain = [jax.tree.map(np.asarray, law) for _, law in laws_inside(tree) if law.has_conditions()]
    return all(np.all(getattr(law, c.parameter) > c.least) for law in plain for c in law.conditions())
