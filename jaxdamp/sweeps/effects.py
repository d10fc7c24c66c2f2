"""Axes of a sweep along which nothing happens."""

from typing import TYPE_CHECKING

import numpy as np


if TYPE_CHECKING:
    import xarray


_ROUNDING = 1e-12  # of the largest value, by which a result may change along an axis without effect


def without_effect(data: "xarray.Dataset") -> dict[str, list[str]]:
    """The axes of a grid along which a result does not change anywhere, but for rounding, by the name of the result.

    No value of such a parameter is better than another. Axes of one value, and points that are no grid, say nothing.

    Arguments:
        data: of `jaxdamp.sweep`.

    >>> import jaxdamp
    >>> data = jaxdamp.sweep(lambda p: {"area": 2.0 * p["a"] + 0.0 * p["b"]}, {"a": [1.0, 2.0], "b": [3.0, 4.0]})
    >>> without_effect(data)
    {'area': ['b']}
    """
    idle = {}
    dims = [str(name) for name in data["failed"].dims if data.sizes[name] > 1 and name in data.coords]
    for name, result in data.data_vars.items():
        if result.dims != data["failed"].dims:
            continue
        size = _ROUNDING * float(np.abs(result).max())
        pairs = {over: result.count(over) > 1 for over in dims}
        flat = [
            over
            for over, compared in pairs.items()
            if compared.any() and bool(((result.max(over) - result.min(over)).where(compared, 0.0) <= size).all())
        ]
        if flat:
            idle[str(name)] = flat
    return idle
