"""Options that process records before they are evaluated or fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from jaxdamp.bench import BenchSet


@dataclass(frozen=True)
class ProcessOptions:
    """What is done to the records, as the command line says it.

    Arguments:
        cycles: "3" or "last:3" for the last three full cycles, "skip:2" for all but the first two.
        between: "2:10", start and end of the part that is kept [s].
        low_pass: cut-off frequency of the zero-phase filter [Hz].
        keep_rest: keep the rest before and after the motion, which is cut off otherwise.
    """

    cycles: str | None = None
    between: str | None = None
    low_pass: float | None = None
    keep_rest: bool = False

    def steps(self) -> dict[str, Any]:
        """The steps of `BenchRun.process`.

        >>> ProcessOptions("skip:2", "0.5:10", 50.0).steps()
        {'low_pass': 50.0, 'between': (0.5, 10.0), 'moving': True, 'skip_cycles': 2}
        """
        steps: dict[str, Any] = {} if self.low_pass is None else {"low_pass": self.low_pass}
        if self.between is not None:
            try:
                start, stop = map(float, self.between.split(":"))
            except ValueError:
                raise ValueError(f"Option --between must read like 2:10 [s], but is {self.between!r}.") from None
            steps["between"] = (start, stop)
        if not self.keep_rest:
            steps["moving"] = True
        if self.cycles is not None:
            kind, _, count = self.cycles.rpartition(":")
            if kind not in ("", "last", "skip") or not count.isdigit():
                raise ValueError(f"Option --cycles must read like 3, last:3 or skip:2, but is {self.cycles!r}.")
            steps["skip_cycles" if kind == "skip" else "last_cycles"] = int(count)
        return steps

    def apply(self, runs: BenchSet) -> BenchSet:
        """The records with these steps done."""
        steps = self.steps()
        return runs.process(**steps) if steps else runs


def commands(texts: Sequence[str]) -> Mapping[str, float] | None:
    """What "*_0.5A=0.5,*_1A=1" states of the records; None where nothing is stated.

    >>> commands(["*_0.5A=0.5,*_1A=1"])
    {'*_0.5A': 0.5, '*_1A': 1.0}
    """
    stated = {}
    for part in (part for text in texts for part in text.split(",")):
        pattern, _, number = part.rpartition("=")
        try:
            stated[pattern.strip()] = float(number)
        except ValueError:
            pattern = ""
        if not pattern:
            raise ValueError(f"Option --command must read like '*_0.5A=0.5', but is {part!r}.")
    return stated or None
