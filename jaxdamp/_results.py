"""What every result has: status, warnings, summary, table, plot, plain data, report."""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from jaxdamp import _checks
from jaxdamp._status import Status
from jaxdamp._tables import Contents, Table, plain, with_unit
from jaxdamp._types import Figure


T = TypeVar("T")


class Derived(Generic[T]):
    """An attribute that follows from the others, unless a class stores it in a field or defines it anew.

    Unlike a property it is no default of a dataclass field of the same name, and gives way to it.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self.function, self.__doc__ = function, function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: object, owner: type | None = None) -> T:
        """The value; a class has none."""
        if instance is None:
            raise AttributeError(f"{self.name} belongs to a result, not to its class")
        return self.function(instance)


def drawn_by(name: str, text: str) -> Callable[..., Figure]:
    """The method `plot` of a result.

    Arguments:
        name: of the function in `jaxdamp.plots`, which gets the result and all further arguments.
        text: what it shows.
    """

    def plot(self: "AbstractResult", *values: object, **options: object) -> Figure:
        from jaxdamp import plots

        return getattr(plots, name)(self, *values, **options)

    plot.__doc__ = f"{text} (`plots.{name}`)"
    return plot


class AbstractResult(ABC):
    """A result of a fit, a tuning or a study: what code branches on, what a person reads, what a file holds.

    A result declares its summary, its table, its plot and the content of its plain data; everything else follows.

    Attributes:
        status: how the search ended, `Status.COMPUTED` where there is none; of several fits a tuple with one for each.
        warnings: doubts about the result, each a sentence.
    """

    status: Any = Derived(lambda self: Status.COMPUTED)
    warnings: Any = Derived(lambda self: ())

    @property
    def converged(self) -> bool:
        """Whether every search ended by its tolerance."""
        return worst_status(self.status if isinstance(self.status, tuple) else [self.status]).good

    @property
    @abstractmethod
    def summary(self) -> str:
        """The result in a sentence or a few."""

    @abstractmethod
    def table(self) -> Table:
        """The numbers of the result with their units."""

    @abstractmethod
    def plot(self) -> Figure:
        """A picture of the result."""

    def tables(self) -> dict[str, Table]:
        """All tables of the result by name, the first is `table()`."""
        return {"table": self.table()}

    def content(self) -> Contents:
        """What `to_dict` holds beside status, summary and warnings: all tables, unless a class says more."""
        return {name: table.to_dict() for name, table in self.tables().items()}

    def _data(self, *names: str, **units: str) -> Contents:
        """Attributes as plain data, those with a unit as a value with its unit."""
        values = {name: plain(getattr(self, name)) for name in names}
        return values | {name: with_unit(getattr(self, name), unit) for name, unit in units.items()}

    def to_dict(self) -> Contents:
        """The result as numbers with units and words, ready for JSON; numbers that are not finite are None."""
        status = [s.name.lower() for s in self.status] if isinstance(self.status, tuple) else self.status.name.lower()
        head = {"summary": self.summary, "status": status, "converged": self.converged, "warnings": [*self.warnings]}
        return head | self.content()

    def report(self, path: str | os.PathLike[str], title: str = "") -> Path:
        """Write the result as one HTML page: summary, warnings, tables, pictures.

        Arguments:
            path: of the file.
            title: of the page; that of its kind if left out.
        """
        from jaxdamp.report import result_report

        return result_report(self, title).write(path)

    def __repr__(self) -> str:
        return "\n".join([self.summary, self.table().to_text(), *(f"warning: {text}" for text in self.warnings)])


def plotted(kind: str, kinds: Mapping[str, Callable[..., Figure]], result: AbstractResult, **options: object) -> Figure:
    """The picture of a result of the kind that `result.plot(kind)` names.

    Arguments:
        kind: a name among the kinds.
        kinds: the function for each.
        result: what is drawn.
        options: of the function.

    Raises:
        ValueError: an unknown kind.
    """
    _checks.one_of("kind", name := str(kind), kinds)
    return kinds[name](result, **options)


def worst_status(statuses: Iterable[Status]) -> Status:
    """The first status that is not good; else the first one."""
    every = tuple(statuses)
    return next((status for status in every if not status.good), every[0] if every else Status.COMPUTED)
