"""What is odd about records before anything is computed from them: findings with severity, place, size and remedy."""

from jaxdamp.bench.preflight.artefacts import mains_lines
from jaxdamp.bench.preflight.check import Preflight, preflight, usable
from jaxdamp.bench.preflight.finding import SEVERITIES, Finding, clock_jitter


__all__ = ["SEVERITIES", "Finding", "Preflight", "clock_jitter", "mains_lines", "preflight", "usable"]
