"""What is odd about records before anything is computed from them: findings with severity, place, size and remedy."""

from jaxdamp.bench.preflight.check import Preflight, preflight, usable
from jaxdamp.bench.preflight.finding import SEVERITIES, Finding


__all__ = ["SEVERITIES", "Finding", "Preflight", "preflight", "usable"]
