"""Metrics of ride, tyre load, damper and road from signals, as one number or one spectrum.

Every function takes plain arrays of uniformly sampled signals, simulated or measured, NumPy or JAX, in SI units. A
signal has one axis, time; use `jax.vmap` for many. All are pure JAX functions and can be compiled, batched and
differentiated; where a derivative is zero or undefined, the docstring says so and names a smooth alternative. NaN in a
signal gives NaN. Only `rainflow_cycles` and functions that return texts (`evaluation_method`, `comfort_reaction`)
cannot be compiled.

- Size of a signal: `rms`, `peak`, `smooth_peak`, `crest_factor`, `running_rms`.
- Spectrum: `power_spectral_density`, `transmissibility`, `coherence`, `third_octave_rms`.
- Human vibration, ISO 2631-1: `weighting_factor`, `weighting_response`, `weighting_state_space`, `weighted_signal`,
  `weighted_rms`, `max_transient_value`, `vibration_dose_value`, `estimated_vibration_dose_value`,
  `motion_sickness_dose`, `motion_sickness_percentage`, `shock_ratios`, `evaluation_method`, `vibration_total_value`,
  `total_vibration`, `comfort_reaction`.
- Suspension travel: `working_space_rms` (about the mean), `working_space_mean`, `working_space_peak_to_peak`,
  `working_space_exceedance`, `gaussian_exceedance`.
- Free motion: `settling_time`, `smooth_settling_time`, `logarithmic_decrement`, `damping_ratio`.
- Tyre load: `dynamic_load_coefficient`, `road_stress_factor`, `lift_off_fraction`, `aggregate_force`,
  `aggregate_force_percentile`.
- Damper: `dissipated_energy`, `dissipated_power`, `equivalent_damping`, `velocity_histogram`,
  `dissipation_histogram`, `temperature_rise`, `damper_temperature`.
- Fatigue: `spectral_moments`, `spectral_damage`, `rainflow_cycles`.
- Road: `international_roughness_index`, `international_roughness_by_segment`.
- Metrics of a vehicle channel, also computed during a simulation: `Metric`, with one of `STATISTICS`, `percentile` or
  your own `Statistic`; values by name: `MetricValues`.

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

from jaxdamp.metrics._signals import StateSpace as StateSpace
from jaxdamp.metrics.amplitude import (
    crest_factor,
    gaussian_exceedance,
    peak,
    rms,
    smooth_peak,
    working_space_exceedance,
    working_space_mean,
    working_space_peak_to_peak,
    working_space_rms,
)
from jaxdamp.metrics.comfort import (
    AXES as AXES,
    Evaluation as Evaluation,
    ShockRatios as ShockRatios,
    comfort_reaction,
    evaluation_method,
    shock_ratios,
    total_vibration,
    vibration_total_value,
)
from jaxdamp.metrics.decay import damping_ratio, logarithmic_decrement, settling_time, smooth_settling_time
from jaxdamp.metrics.dissipation import (
    damper_temperature,
    dissipated_energy,
    dissipated_power,
    dissipation_histogram,
    equivalent_damping,
    temperature_rise,
    velocity_histogram,
)
from jaxdamp.metrics.dose import (
    estimated_vibration_dose_value,
    max_transient_value,
    motion_sickness_dose,
    motion_sickness_percentage,
    running_rms,
    third_octave_rms,
    vibration_dose_value,
)
from jaxdamp.metrics.fatigue import rainflow_cycles, spectral_damage, spectral_moments
from jaxdamp.metrics.metric import (
    RENAMED,
    Metric,
    MetricValues as MetricValues,
    current_name as current_name,
    current_names as current_names,
)
from jaxdamp.metrics.roughness_index import (
    RoughnessBySegment as RoughnessBySegment,
    international_roughness_by_segment,
    international_roughness_index,
)
from jaxdamp.metrics.spectrum import coherence, power_spectral_density, transmissibility
from jaxdamp.metrics.statistics import (
    STATISTICS,
    Gathered as Gathered,
    Reduction,
    Statistic,
    Term,
    lift_off_below as lift_off_below,
    percentile,
)
from jaxdamp.metrics.tyre_load import (
    aggregate_force,
    aggregate_force_percentile,
    dynamic_load_coefficient,
    lift_off_fraction,
    road_stress_factor,
)
from jaxdamp.metrics.weighted import (
    discrete_weighting as discrete_weighting,
    weighted_rms,
    weighted_signal,
    weighting_factor,
    weighting_response as weighting_response,
    weighting_state_space as weighting_state_space,
)


__all__ = [
    "STATISTICS",
    "Metric",
    "Reduction",
    "Statistic",
    "Term",
    "aggregate_force",
    "aggregate_force_percentile",
    "coherence",
    "comfort_reaction",
    "crest_factor",
    "damper_temperature",
    "damping_ratio",
    "dissipated_energy",
    "dissipated_power",
    "dissipation_histogram",
    "dynamic_load_coefficient",
    "equivalent_damping",
    "estimated_vibration_dose_value",
    "evaluation_method",
    "gaussian_exceedance",
    "international_roughness_by_segment",
    "international_roughness_index",
    "lift_off_fraction",
    "logarithmic_decrement",
    "max_transient_value",
    "motion_sickness_dose",
    "motion_sickness_percentage",
    "peak",
    "percentile",
    "power_spectral_density",
    "rainflow_cycles",
    "rms",
    "road_stress_factor",
    "running_rms",
    "settling_time",
    "shock_ratios",
    "smooth_peak",
    "smooth_settling_time",
    "spectral_damage",
    "spectral_moments",
    "temperature_rise",
    "third_octave_rms",
    "total_vibration",
    "transmissibility",
    "velocity_histogram",
    "vibration_dose_value",
    "vibration_total_value",
    "weighted_rms",
    "weighted_signal",
    "weighting_factor",
    "working_space_exceedance",
    "working_space_mean",
    "working_space_peak_to_peak",
    "working_space_rms",
]


def __getattr__(name: str) -> object:
    """A renamed function by its old name."""
    if name in RENAMED:
        return globals()[current_name(name, RENAMED.values())]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
