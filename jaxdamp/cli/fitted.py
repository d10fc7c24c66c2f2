"""What `fit` and `demo` hold after the fits: the laws, their errors, and those that are missing."""

from dataclasses import dataclass

from jaxdamp.cli import findings as tables
from jaxdamp.cli.residual import Shares
from jaxdamp.identify import Comparison
from jaxdamp.report import Table


@dataclass(frozen=True)
class Findings:
    """Fits of several laws with what their errors are made of.

    Attributes:
        comparison: the fits.
        shares: what the error of each fitted law is made of.
        unfitted: the laws that an interruption left without a fit.
    """

    comparison: Comparison
    shares: dict[str, Shares]
    unfitted: tuple[str, ...] = ()

    @property
    def ladder(self) -> Table:
        """The laws and their errors."""
        return tables.ladder_table(self.comparison, self.shares)

    @property
    def verdict(self) -> list[str]:
        """How good they are, in words."""
        return tables.verdict(self.comparison, self.shares)

    @property
    def failures(self) -> list[str]:
        """The laws without a fit, and why."""
        return tables.failures(self.comparison, self.unfitted)

    @property
    def missing(self) -> str:
        """What is still to be written after laws and tables."""
        laws = f"the fits of {', '.join(self.unfitted)}, " if self.unfitted else ""
        return f"{laws}the pictures and the report"
