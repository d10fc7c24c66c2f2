"""Pictures and files that may fail one by one: what fails is named, the others are made."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from jaxdamp.cli import interrupt
from jaxdamp.cli.interrupt import Interrupted
from jaxdamp.cli.wording import message


class Attempts:
    """Parts of the work that do not depend on one another.

    Attributes:
        troubles: what could not be made, or only in part, and why, in words.
    """

    def __init__(self) -> None:
        self.troubles: list[str] = []

    @contextmanager
    def part(self, what: str) -> Iterator[None]:
        """One part: an error in it is noted, not raised, whatever it is, because the rest must not be lost with it."""
        interrupt.check()
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", UserWarning)
            try:
                yield
            except Interrupted:
                raise
            except Exception as error:
                self.troubles.append(f"{what} could not be made: {message(error) or type(error).__name__}")
        self.troubles += [str(warning.message) for warning in said if warning.category is UserWarning]
