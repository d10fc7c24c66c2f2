"""A virtual 4-post rig: files in other units, a reversed channel, sensors with faults, dampers in linkages."""

import pytest

from benchmarks import four_post
from benchmarks.vehicle_fits import distances
from jaxdamp.bench import read_rides


@pytest.mark.slow
def test_the_car_is_recovered_and_a_reversed_channel_named(tmp_path):
    path = four_post.file_of(four_post.ride(0), tmp_path)
    result = four_post.fitted(read_rides(path, **four_post.RIGHT))
    assert result.converged and not result.warnings
    apart = distances(result, four_post.CAR, four_post.SENSORS)
    assert max(map(abs, apart.values())) < 4.0, apart
    (first, *_) = four_post.fitted(read_rides(path)).warnings
    assert f"{four_post.REVERSED} of drive 0 runs against the vehicle of the start" in first
