"""What the examples of the pages print, as the tests have kept it (`conftest.py`), below each of them."""

import json
import re
from pathlib import Path
from typing import Any


EXAMPLES = Path(__file__).parents[1] / "build" / "examples"
LINES = 40  # of an output
BLOCK = re.compile(r"^```python\n(.*?)^```\n", re.MULTILINE | re.DOTALL)


def add_outputs(app: Any, page: str, source: list[str]) -> None:
    """Each block of code with what it printed, if it is still the code that was run."""
    file = EXAMPLES / f"{page}.json"
    if file.exists():
        source[0] = with_outputs(source[0], json.loads(file.read_text(encoding="utf-8")))


def with_outputs(text: str, printed: dict[str, str]) -> str:
    """A page with the outputs of its blocks, by their code."""

    def shown(block: re.Match[str]) -> str:
        lines = printed.get(block[1].strip(), "").rstrip().splitlines()
        lines = [*lines[:LINES], "..."] if len(lines) > LINES else lines
        return block[0] + ("\n```text\n" + "\n".join(lines) + "\n```\n" if lines else "")

    return BLOCK.sub(shown, text)
