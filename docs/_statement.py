"""A statement of a paper with its verdict, a row of the table "paper against jaxdamp"."""

from collections.abc import Callable
from typing import NamedTuple


REPRODUCED = "reproduced"
CORRECTED = "corrected"  # a slip of the paper
CONTRADICTED = "contradicted"  # a conclusion that does not follow, or does not hold where it can be computed
CONSISTENT = "consistent on a twin"  # seen on records that were made to show it: no evidence of its own
NOT_TREATED = "not treated"  # the paper does not say enough
VERDICTS = (REPRODUCED, CORRECTED, CONTRADICTED, CONSISTENT, NOT_TREATED)


class Statement(NamedTuple):
    """A statement of a paper.

    Arguments:
        place: equation, table, figure or section.
        statement: what the paper says.
        verdict: one of `VERDICTS`.
        comment: how it is reproduced, why it is corrected, or what is missing; the notebook that computes it.
        printed: the number in the paper, if it is one.
        computed: the number of jaxdamp.
        tolerance: largest relative difference of a reproduced number.
        unit: of both numbers.
    """

    place: str
    statement: str
    verdict: str
    comment: str
    printed: float | None = None
    computed: Callable[[], float] | None = None
    tolerance: float = 0.01
    unit: str = ""

    def row(self) -> str:
        """The row of the table, with the numbers beside each other."""
        numbers = ""
        if self.computed is not None:
            numbers = f"{self.computed():.4g} {self.unit}".strip()
            if self.printed is not None:
                numbers += f" (printed {self.printed:.4g})"
        return f"| {self.place} | {self.statement} | {numbers} | {self.verdict} | {self.comment} |"
