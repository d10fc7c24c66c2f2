import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import metrics
from jaxdamp.vehicles import frequency_response, linearise, stationary_rms, with_weightings
from jaxdamp.vehicles.presets import half_car_002, quarter_car_000


def test_weighted_rms_on_a_white_road_is_the_integral_over_frequency():
    car = quarter_car_000()
    felt = with_weightings(linearise(car), [("sprung_acceleration", "Wk")])
    found = stationary_rms(felt, 3e-3)["weighted_sprung_acceleration"]
    f = jnp.geomspace(1e-4, 3e3, 40_001)
    gain = jnp.abs(frequency_response(car, f)["sprung_acceleration"]) / (2 * jnp.pi * f)
    density = 2 * 3e-3 * (gain * metrics.weighting_factor(f, "Wk")) ** 2
    assert float(found) ** 2 == pytest.approx(np.trapezoid(density, f), rel=1e-5)


@pytest.mark.slow
def test_every_channel_keeps_its_own_weighting_with_the_delay_of_the_axle():
    car = half_car_002()
    pairs = [("pitch_acceleration", "We"), ("sprung_acceleration", "Wk")]
    felt = stationary_rms(with_weightings(linearise(car), pairs), 3e-3, speed=20.0)
    for name, _ in pairs:
        assert 0.2 * felt[name] < felt[f"weighted_{name}"] < 1.05 * felt[name]
    plain = stationary_rms(car, 3e-3, speed=20.0)
    assert float(felt["pitch_acceleration"]) == pytest.approx(float(plain["pitch_acceleration"]), rel=1e-9)
    with pytest.raises(ValueError, match="Did you mean 'sprung_acceleration'"):
        with_weightings(linearise(car), [("sprung_aceleration", "Wk")])
