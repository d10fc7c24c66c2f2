"""The strokes at which a law is valid."""

import numpy as np
from jaxtyping import ArrayLike

from jaxdamp import _checks
from jaxdamp.dampers import AbstractDamper


def refuse_strokes(law: AbstractDamper, argument: str, lowest: ArrayLike, highest: ArrayLike) -> None:
    """Refuse strokes [m] outside the limits of a law (traced ones cannot be checked).

    Arguments:
        law: the damper law.
        argument: that the strokes come from.
        lowest: least stroke.
        highest: largest stroke.
    """
    least, most = _checks.concrete(lowest), _checks.concrete(highest)
    for term in law.side_by_side():
        low, high = (_checks.concrete(limit) for limit in term.stroke_limits)
        if least is None or most is None or low is None or high is None:
            continue
        if np.any(least < low) or np.any(most > high):
            verb = "stay" if argument == "stroke" else "keep the stroke"
            must = f"{verb} from {low:.4g} to {high:.4g} m for {type(term).__name__}"
            value = f"from {np.min(least):.4g} to {np.max(most):.4g} m"
            _checks.refuse(argument, must, value, "The law's volumes are those at stroke zero: shift the stroke.")
