"""Runs the examples of the README, of docs/ and of every docstring as tests."""

import jax
import numpy as np
from sybil import Sybil
from sybil.parsers.doctest import DocTestParser
from sybil.parsers.markdown import PythonCodeBlockParser, SkipParser


def _double_precision(namespace: dict) -> None:
    del namespace
    jax.config.update("jax_enable_x64", True)
    np.set_printoptions(precision=6, suppress=True)


pytest_collect_file = (
    Sybil(parsers=[PythonCodeBlockParser(), SkipParser()], patterns=["*.md"], setup=_double_precision)
    + Sybil(parsers=[DocTestParser()], patterns=["jaxdamp/**/*.py", "jaxdamp/*.py"], setup=_double_precision)
).pytest()
