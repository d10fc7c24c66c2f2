"""The contract of damper laws: each check takes a law and raises an `AssertionError` if it is violated."""

from collections.abc import Callable, Collection

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_module
from jaxdamp.dampers import AbstractDamper
from jaxdamp.testing import _declared, _physics
from jaxdamp.testing.places import check_alike_ports, check_inside_wrappers


CHECKS: dict[str, Callable[[AbstractDamper], None]] = {
    "shapes": _declared.check_shapes,
    "refusals": _declared.check_refusals,
    "parameters": _declared.check_parameters,
    "text": _declared.check_text,
    "file": _declared.check_file,
    "traits": _declared.check_traits,
    "finite": _physics.check_finite,
    "rest": _physics.check_rest,
    "continuous": _physics.check_continuous,
    "passive": _physics.check_passive,
    "compiled": _physics.check_compiled,
    "batched": _physics.check_batched,
    "derivatives": _physics.check_derivatives,
    "step": _physics.check_step,
    "prediction": _physics.check_prediction,
    "single precision": _physics.check_single_precision,
    "inside wrappers": check_inside_wrappers,
    "alike ports": check_alike_ports,
}


def check_law(law: AbstractDamper, *, leave_out: Collection[str] = ()) -> None:
    """Check that a law satisfies the contract of damper laws, so that it works everywhere the laws of the library do.

    The checks take ten to thirty seconds, mainly for compiling. Their names are:

    - `"shapes"`, `"refusals"`: one force and as many rates as states; states of another length are refused by name.
    - `"parameters"`, `"text"`, `"file"`: every parameter has a unit, a meaning and a domain that is enforced; the law
      prints, and is the same after writing and reading as JSON.
    - `"traits"`: the declared traits agree with the forces.
    - `"finite"`, `"continuous"`: value, slope and derivatives are finite everywhere, and the force has no jump.
    - `"rest"`, `"passive"`: no force at rest; neither sines nor random motions gain energy from the law.
    - `"compiled"`, `"batched"`, `"single precision"`: the same numbers compiled (to 1e-12, derivatives to 1e-9), in a
      batch, and in single precision.
    - `"derivatives"`: forward mode, reverse mode and differences agree in every parameter.
    - `"step"`, `"prediction"`: the step converges with second order to an independent integration of the rates.
    - `"inside wrappers"`, `"alike ports"`: it works in every wrapper, and twice in a half car with different
      parameters.

    Arguments:
        law: the law with realistic parameters: knees between 0.01 and 1 m/s, strokes of about 10 mm.
        leave_out: names of checks that the law cannot satisfy by its nature: `["rest"]` for a gas spring, `["passive"]`
            for an active law.

    Raises:
        AssertionError: what is wrong, in a sentence that begins with the class and the name of the check.
        ValueError: something that is not a law, an unknown name of a check.

    >>> from jaxdamp.dampers import GasSpring
    >>> check_law(GasSpring(2e6, 6e-5, 1e-4), leave_out=set(CHECKS) - {"shapes", "text", "file"})
    """
    check_module("law", law, (AbstractDamper,), "check_law(law)")
    for name in leave_out:
        _checks.one_of("leave_out", name, CHECKS)
    with jax.enable_x64(True):
        law = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf), float), law)
        for name, check in CHECKS.items():
            if name in leave_out:
                continue
            try:
                check(law)
            except AssertionError as error:
                raise AssertionError(f"{type(law).__name__} breaks {name!r}: {error}") from error
