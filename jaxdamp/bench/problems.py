"""All problems of a file, and of all files of a call, in one message."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from jaxdamp._checks import ArgumentError


class Problems:
    """Collects errors, to raise them together.

    >>> problems = Problems()
    >>> for text in ("one", "two"):
    ...     with problems.collected():
    ...         raise ValueError(text)
    >>> problems.raise_any()
    Traceback (most recent call last):
    ...
    jaxdamp.bench.problems.Several: 2 problems:
      1. one
      2. two
    """

    def __init__(self) -> None:
        self.errors: list[Exception] = []

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Keep the error of this block, if it has one, and go on behind it."""
        try:
            yield
        except Several as several:
            self.errors.extend(several.errors)
        except (ValueError, OSError, ImportError) as error:
            self.errors.append(error)

    def raise_any(self) -> None:
        """Raise what was collected: a single error as it is, several as one."""
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            raise Several(self.errors)


class Several(ArgumentError):
    """Several errors in one message.

    Attributes:
        errors: each of them.
    """

    def __init__(self, errors: Sequence[Exception]) -> None:
        text = "\n".join(f"  {number}. {error}" for number, error in enumerate(errors, 1))
        settings = [setting for error in errors for setting in getattr(error, "settings", ())]
        super().__init__(f"{len(errors)} problems:\n{text}", *settings)
        self.errors = tuple(errors)
