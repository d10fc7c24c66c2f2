"""What records tell of a gas charge: at one pressure, area of the rod, pressure and a constant force look alike."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, laws_inside
from jaxdamp.identify.estimates import Estimate
from jaxdamp.identify.model import Model, law_of, rig_of
from jaxdamp.identify.stated import stated_parameters


ALIKE = 0.98  # correlation of two numbers, from which the records hardly tell them apart


def gas_charges(law: AbstractDamper) -> list[tuple[str, AbstractDamper]]:
    """The laws inside whose static force has a meaning of its own, such as a gas charge, with prefixes of their paths.

    Arguments:
        law: the damper law.
    """
    parts = [(prefix, part) for prefix, part in laws_inside(law) if not part.inner_laws()]
    return [(prefix, part) for prefix, part in parts if part.traits().contains_offset and not part.constant_forces()]


def charged_apart(law: AbstractDamper, runs: Sequence[BenchRun]) -> bool:
    """Whether the records state several values of a gas charge, so that a constant force is told from it.

    Arguments:
        law: the damper law.
        runs: the records.
    """
    prefixes = tuple(prefix for prefix, _ in gas_charges(law))
    stated = stated_parameters(law, runs).items() if prefixes else ()
    return any(np.ptp(values) > 0.0 for path, values in stated if path.startswith(prefixes))


def gas_in_words(
    model: Model,
    runs: Sequence[BenchRun],
    estimates: Sequence[Estimate],
    covariance: Float[np.ndarray, "free free"],
) -> list[str]:
    """A sentence on numbers of the gas force that the records hardly tell apart, since they are at one pressure.

    Arguments:
        model: the fitted law, on its machine if there is one.
        runs: the fitted records.
        estimates: of the free numbers.
        covariance: of the same.
    """
    law, inside = law_of(model), "" if isinstance(model, AbstractDamper) else "law."
    gas = tuple(inside + prefix for prefix, _ in gas_charges(law))
    if not gas or charged_apart(law, runs):
        return []
    constant = [f"{inside}{prefix}{name}" for prefix, part in laws_inside(law) for name in part.constant_forces()]
    constant += ["rig.force_offset", "rig.gas_force"] * (rig_of(model) is not None)
    names = [e.name for e in estimates]
    of_gas = np.array([name.startswith(gas) for name in names], bool)
    beside = of_gas | np.isin(names, constant)
    mixed = np.any(_alike(covariance) & np.outer(beside, beside) & (of_gas[:, None] | of_gas), axis=0)
    if not mixed.any():
        return []
    pressures = [name.removeprefix(inside) for name in names if name.startswith(gas) and name.endswith("pressure")]
    return [
        f"These records, at one gas pressure, hardly tell {', '.join(np.array(names)[mixed])} apart: the gas pushes"
        f" with pressure times area. Freeze what is known, or add records at other pressures that state them,"
        f' `settings={{"{(*pressures, "pressure")[0]}": "20 bar"}}` (absolute).'
    ]


def _alike(covariance: Float[np.ndarray, "free free"]) -> Bool[np.ndarray, "free free"]:
    """Which numbers are hardly told from which others."""
    error = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = np.abs(covariance / np.outer(error, error)) > ALIKE
    return alike & ~np.eye(len(error), dtype=bool)
