"""Clean records of motions that do not repeat raise nothing, alone and beside others."""

import pytest

from jaxdamp.bench import preflight

from .random_motions import LAWS, clean


def test_clean_random_motions_raise_nothing():
    for seed in range(18):
        found = preflight(clean(seed))
        assert found.findings == (), repr(found)


@pytest.mark.exhaustive
def test_false_alarms_over_random_motions_are_rare():
    runs = [clean(seed) for seed in range(150)]
    benches = [[run for run in runs[start : start + 50] if law in run.name] for start in (0, 50, 100) for law in LAWS]
    alarms = [finding for bench in benches for finding in preflight(bench).findings]
    assert len(alarms) < 0.02 * len(runs), alarms
