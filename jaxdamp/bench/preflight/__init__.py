"""What is odd about records before anything is computed from them: findings with severity, place, size and remedy."""

from jaxdamp.bench.preflight.check import Preflight as Preflight, preflight as preflight, usable as usable
from jaxdamp.bench.preflight.finding import (
    SEVERITIES as SEVERITIES,
    Finding as Finding,
    clock_jitter as clock_jitter,
    mains_lines as mains_lines,
)
