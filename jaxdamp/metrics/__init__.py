"""Metrics: what a signal says about ride, tyre load and damper, as one number or one spectrum.

Every function takes plain arrays of uniformly sampled signals, simulated or measured, NumPy or JAX, in SI units. A
signal has one axis, time; use `jax.vmap` for many. All are pure JAX functions and can be compiled, batched and
differentiated; where a derivative is zero or undefined, the docstring says so. NaN in a signal gives NaN.

- Size of a signal: `rms`, `peak`, `crest_factor`.
- Spectrum: `power_spectral_density`.
- Suspension travel: `working_space_rms`, `working_space_peak`.
- Tyre load: `dynamic_load_coefficient`, `road_stress_factor`, `lift_off_fraction`.
- Damper: `dissipated_energy`, `equivalent_damping`.

>>> import jax
>>> import jax.numpy as jnp
>>> from jaxdamp import metrics
>>> time = jnp.arange(1000.0) * 0.001
>>> acceleration = 2.0 * jnp.sin(2.0 * jnp.pi * 5.0 * time)
>>> round(float(metrics.rms(acceleration)), 6)
1.414214
>>> amplitudes = jnp.array([0.5, 1.0, 2.0])
>>> jax.vmap(metrics.rms)(amplitudes[:, None] * acceleration[None, :]).round(6)
Array([0.707107, 1.414214, 2.828427], dtype=float64)
"""

from jaxdamp.metrics.amplitude import crest_factor, peak, rms
from jaxdamp.metrics.dissipation import dissipated_energy, equivalent_damping
from jaxdamp.metrics.spectrum import power_spectral_density
from jaxdamp.metrics.tyre_load import dynamic_load_coefficient, lift_off_fraction, road_stress_factor
from jaxdamp.metrics.working_space import working_space_peak, working_space_rms


__all__ = [
    "crest_factor",
    "dissipated_energy",
    "dynamic_load_coefficient",
    "equivalent_damping",
    "lift_off_fraction",
    "peak",
    "power_spectral_density",
    "rms",
    "road_stress_factor",
    "working_space_peak",
    "working_space_rms",
]
