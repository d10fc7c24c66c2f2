"""Roads: the height under each wheel as a function of time.

The method `height(time)` of a road gives the height [m], up positive, under every wheel at the given times, as
an array of shape [time, wheels]. A road with a single track has one column.

- Single events: `cosine_bump`, `half_sine_bump`, `trapezoid_bump`, `triangular_bump`, `pothole`, `step`.
- Periodic excitation: `sine`, `wave_course`, `sweep_sine`.
- Random roads: `iso8608` and `iso8608_filtered` (a roughness class at a vehicle speed), `band_limited` (a flat spectrum
  between two frequencies).
- Measured roads: `from_profile`, `read_profile` (text files), `read_crg` (OpenCRG).
- Several wheels: `two_track` combines a left and a right track. Simulations delay the road from axle to axle by its
  speed and the axle positions of the vehicle; `delayed` is for other delays, `in_phase` moves all axles at once.
- Combined roads: `joined`, `superposed`, and for the tyre `contact_patch` and `rolling_disc`.
- Roughness: `assess_roughness`, `class_limits`, `road_class`; `coherency` of two tracks.
- For stationary responses: `white`, a road given only by its spectrum.

Roads are pure functions of their parameters, so that they can be compiled, batched and differentiated in height, speed
or roughness. Simulations start at rest in static equilibrium on the heights at time 0: random roads therefore fade in
over the first half second (`ramp`).

A speed hump, then a rough surface, at 10 m/s:

>>> import jax.numpy as jnp
>>> from jaxdamp import roads
>>> time = jnp.linspace(0.0, 10.0, 10_001)
>>> hump = roads.cosine_bump(0.06, start=1.0, length=2.5, speed=10.0)
>>> round(float(hump.height(time).max()), 6)
0.06
>>> surface = roads.iso8608("D", speed=10.0, seed=1)
>>> surface.height(time).shape
(10001, 1)
>>> car = roads.delayed(roads.two_track(surface, track_width=1.5, seed=2), positions=[0.0, 2.7], speed=10.0)
>>> car.height(time).shape
(10001, 4)
"""

from jaxdamp._guesses import answer_guesses
from jaxdamp.roads._composed import joined, superposed
from jaxdamp.roads.assessment import (
    RoughnessAssessment as RoughnessAssessment,
    assess_roughness,
    class_limits as class_limits,
    road_class,
)
from jaxdamp.roads.axles import delayed, in_phase
from jaxdamp.roads.base import AbstractRoad, Columns as Columns
from jaxdamp.roads.bump import cosine_bump, pothole, step
from jaxdamp.roads.contact import contact_patch, rolling_disc
from jaxdamp.roads.cornered_bump import half_sine_bump, trapezoid_bump, triangular_bump
from jaxdamp.roads.crg import read_crg
from jaxdamp.roads.harmonic import sine, sweep_sine, wave_course
from jaxdamp.roads.iso_roughness import iso8608
from jaxdamp.roads.profile import from_profile
from jaxdamp.roads.random_roads import WhiteRoad as WhiteRoad, band_limited, iso8608_filtered, white
from jaxdamp.roads.road_file import read_profile
from jaxdamp.roads.tracks import coherency, two_track


__all__ = [
    "AbstractRoad",
    "assess_roughness",
    "band_limited",
    "coherency",
    "contact_patch",
    "cosine_bump",
    "delayed",
    "from_profile",
    "half_sine_bump",
    "in_phase",
    "iso8608",
    "iso8608_filtered",
    "joined",
    "pothole",
    "read_crg",
    "read_profile",
    "road_class",
    "rolling_disc",
    "sine",
    "step",
    "superposed",
    "sweep_sine",
    "trapezoid_bump",
    "triangular_bump",
    "two_track",
    "wave_course",
    "white",
]

answer_guesses(__name__, __all__)
