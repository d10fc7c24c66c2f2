"""Pictures and files that may fail one by one: what fails is named, the others are made."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Attempts:
    """Parts of the work that do not depend on one another.

    Arguments:
        check: called before each part; what it raises is raised, such as an interruption.
        message: what an error says, in words.

    Attributes:
        troubles: what could not be made, or only in part, and why, in words.
    """

    def __init__(self, check: Callable[[], None] = lambda: None, message: Callable[[Exception], str] = str) -> None:
        self.troubles: list[str] = []
        self._check, self._message = check, message

    @contextmanager
    def part(self, what: str) -> Iterator[None]:
        """One part: an error in it is noted, not raised, whatever it is, because the rest must not be lost with it."""
        self._check()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            try:
                yield
            except Exception as error:
                self.troubles.append(f"{what} could not be made: {self._message(error) or type(error).__name__}")
        self.troubles += [str(warning.message) for warning in caught if warning.category is UserWarning]
