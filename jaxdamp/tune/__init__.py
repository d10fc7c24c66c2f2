"""Tuning of parameters for ride metrics: `minimise`, and `rescore` on other roads."""

from jaxdamp._status import Status
from jaxdamp.tune.minimising import minimise
from jaxdamp.tune.rescoring import Rescore, rescore
from jaxdamp.tune.result import Change, TuneResult


__all__ = ["Change", "Rescore", "Status", "TuneResult", "minimise", "rescore"]
