"""A bench record for the page of a law: its samples, and what it states that the page does not follow."""

import base64
from collections.abc import Sequence

import numpy as np

from jaxdamp._tables import Contents
from jaxdamp._words import in_words
from jaxdamp.bench import BenchRun
from jaxdamp.dampers import AbstractDamper, takes_command
from jaxdamp.parameters import matching, parameters


_SAMPLES, _PER_CYCLE = 8000, 250  # of a record in the page; the law is driven by these samples


def of_record(run: BenchRun, laws: Sequence[AbstractDamper]) -> Contents:
    """A record for the page: every sample, or so few of them as it takes to drive the laws, from the beginning."""
    per_cycle = run.sampling_rate / max(run.frequency, 1.0 / run.duration)
    stride = max(1, min(int(per_cycle / _PER_CYCLE), -(-len(run) // _SAMPLES)))
    chosen = slice(0, _SAMPLES * stride, stride)
    shown = {"x": run.stroke[chosen], "v": run.velocity[chosen], "force": run.force[chosen]}
    every = "every sample" if stride == 1 else f"one sample in {stride}"
    note = f"{every} of {len(run)}" + ("" if len(run) <= _SAMPLES * stride else f", up to the {_SAMPLES * stride}th")
    about = {"name": run.name, "dt": stride / run.sampling_rate, "command": run.command, "note": note}
    about |= {"beyond": " and ".join(dict.fromkeys(name for law in laws for name in _beyond(run, law)))}
    return about | {key: packed(values) for key, values in shown.items()}


def _beyond(run: BenchRun, law: AbstractDamper) -> list[str]:
    """What a record states for a law that the page does not follow, in words."""
    names = [f"the {in_words(name)}" for name in run.settings if matching([p.path for p in parameters(law)], name)]
    if run.command_channel is not None and takes_command(law):
        names.append("the varying command")
    if law.traits().temperature_dependent and (run.temperature is not None or "temperature" in run.settings):
        names.append("the temperature")
    return names


def packed(values: object) -> str:
    """Numbers in 64 bits as text of 64 characters."""
    return base64.b64encode(np.asarray(values, "<f8").tobytes()).decode("ascii")
