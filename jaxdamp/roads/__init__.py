"""Roads: the height under each wheel as a function of time.

A road answers one question, `height(time)`: the height [m], up positive, under every wheel at the times asked for, as
an array of shape [time, wheels]. A road with a single track has one column; a vehicle with several axles delays it.

- Single events: `cosine_bump`, `step`.
- Periodic excitation: `sine`.
- Random roads: `iso8608` (a roughness class at a vehicle speed) and `band_limited` (a flat spectrum between two
  frequencies).
- Measured roads: `from_profile`.
- For stationary responses: `white`, a road known by its spectrum alone.

Roads are pure functions of their parameters, so that they can be compiled, batched and differentiated in height,
speed or roughness. Simulations start at rest on level ground: random roads therefore fade in over the first half
second (`ramp`).

Two roads through the same corner of a village, first a speed hump and then a poor surface, both at 10 m/s:

>>> import jax.numpy as jnp
>>> from jaxdamp import roads
>>> time = jnp.linspace(0.0, 10.0, 10_001)
>>> hump = roads.cosine_bump(0.06, start=1.0, length=2.5, speed=10.0)
>>> round(float(hump.height(time).max()), 6)
0.06
>>> surface = roads.iso8608("D", speed=10.0, seed=1)
>>> surface.height(time).shape
(10001, 1)
"""

from jaxdamp.roads.base import AbstractRoad
from jaxdamp.roads.bump import cosine_bump
from jaxdamp.roads.edge import step
from jaxdamp.roads.harmonic import sine
from jaxdamp.roads.iso_roughness import iso8608
from jaxdamp.roads.profile import from_profile
from jaxdamp.roads.random_band import band_limited
from jaxdamp.roads.white import WhiteRoad, white


__all__ = [
    "AbstractRoad",
    "WhiteRoad",
    "band_limited",
    "cosine_bump",
    "from_profile",
    "iso8608",
    "sine",
    "step",
    "white",
]
