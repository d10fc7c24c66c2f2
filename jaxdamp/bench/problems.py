"""All problems of a file, and of all files of a call, in one message."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from jaxdamp._checks import ArgumentError, Setting


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

    def raise_any(self, remedy: str = "", *settings: Setting) -> None:
        """Raise what was collected: a single error as it is, several as one; and what else could be done."""
        if len(self.errors) == 1:
            (error,) = self.errors
            if remedy and isinstance(error, ValueError):
                raise ArgumentError(f"{error} {remedy}", *getattr(error, "settings", ()), *settings) from error
            raise error
        if self.errors:
            raise Several(self.errors, remedy, *settings)


class Several(ArgumentError):
    """Several errors in one message.

    Attributes:
        errors: each of them.
    """

    def __init__(self, errors: Sequence[Exception], remedy: str = "", *settings: Setting) -> None:
        lines = [f"  {number}. {error}" for number, error in enumerate(errors, 1)] + [remedy] * bool(remedy)
        named = [setting for error in errors for setting in getattr(error, "settings", ())]
        super().__init__("\n".join([f"{len(errors)} problems:", *lines]), *named, *settings)
        self.errors = tuple(errors)
