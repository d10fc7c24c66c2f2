"""A statement of a paper with its verdict, a row of the table "paper against jaxdamp"."""

from collections.abc import Callable, Mapping
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
        comment: what the number of jaxdamp is, why the statement is corrected, or what is missing.
        ours: the number of jaxdamp; a test fails where the code computes another one.
        by: the function that computes it, or its name among the numbers that the notebook of the paper computes.
        printed: the number in the paper, if it is one.
        unit: of both numbers.
        spread: half the width of the 95 % interval of `ours`, by the same function or notebook.
        tolerance: largest relative difference between printed and computed number where they agree.
        repeat: largest relative difference between `ours` and what is computed later, on another computer.
    """

    place: str
    statement: str
    verdict: str
    comment: str
    ours: float | None = None
    by: Callable[[], float] | str | None = None
    printed: float | None = None
    unit: str = ""
    spread: float | None = None
    tolerance: float = 0.01
    repeat: float = 5e-3

    def agrees(self) -> bool:
        """Whether the two numbers are the same within the tolerance or the spread."""
        if self.ours is None or self.printed is None:
            return False
        return abs(self.ours - self.printed) <= max(self.tolerance * abs(self.printed), self.spread or 0.0)

    def source(self, notebook: str, cells: Mapping[str, int]) -> str:
        """Where the number is computed: the cell of the notebook by `cells`, or the file of the statements."""
        if self.by is None:
            return ""
        return f"`{notebook}` [{cells[self.by]}]" if isinstance(self.by, str) else f"`docs/{self.by.__module__}.py`"

    def numbers(self) -> tuple[str, str]:
        """The number of the paper and that of jaxdamp, in words."""
        printed = "" if self.printed is None else f"{short(self.printed)} {self.unit}".strip()
        if self.ours is None:
            return printed, ""
        spread = "" if self.spread is None else f" ± {self.spread:.2g}"
        return printed, f"{short(self.ours)}{spread} {self.unit}".strip()


def short(value: float) -> str:
    """Four figures, without a power of ten between 0.001 and 100 000."""
    text = f"{value:.4g}" if not 1e4 <= abs(value) < 1e5 else f"{value:.0f}"
    return text.replace("-", "−")
