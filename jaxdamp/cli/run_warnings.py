"""Warnings of runs, said by the commands in their own tables and words."""

import contextlib
import warnings
from collections.abc import Callable, Iterator

from jaxdamp.dampers import OutsideFittedRangeWarning
from jaxdamp.simulation import CoarseStepWarning, Response


@contextlib.contextmanager
def without_range_warnings() -> Iterator[None]:
    """No Python warnings of laws outside their range: the tables and remarks of the command say it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OutsideFittedRangeWarning)
        yield


def with_step_warnings(drive: Callable[[], Response]) -> tuple[Response, list[str]]:
    """A run, and what it warns of its step in the words of the command line; other warnings pass."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", CoarseStepWarning)
        response = drive()
    texts = []
    for warning in caught:
        if issubclass(warning.category, CoarseStepWarning):
            texts.append(str(warning.message).replace("`dt=", "`--dt "))
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return response, texts
