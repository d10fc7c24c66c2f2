"""Independent pictures and files: if one fails, it is reported and the others are still created."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Attempts:
    """Parts of the work that do not depend on one another.

    Arguments:
        check: called before each part; what it raises is raised, such as an interruption.
        message: what an error says, in words.

    Attributes:
        troubles: the parts that failed, completely or partly, and why, in words.
    """

    def __init__(self, check: Callable[[], None] = lambda: None, message: Callable[[Exception], str] = str) -> None:
        self.troubles: list[str] = []
        self._check, self._message = check, message

    @contextmanager
    def part(self, what: str) -> Iterator[None]:
        """One part: any error in it is noted and not raised, so that the other parts are not lost."""
        self._check()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            try:
                yield
            except Exception as error:
                self.troubles.append(f"{what} could not be made: {self._message(error) or type(error).__name__}")
        self.troubles += [str(warning.message) for warning in caught if warning.category is UserWarning]
