"""A page of results: one self-contained HTML file."""

import base64
import html
import io
import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from jaxdamp._tables import Table
from jaxdamp.report.attempts import Attempts


if TYPE_CHECKING:
    from matplotlib.figure import Figure


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 72em; margin: 2em auto; padding: 0 1em; }}
table {{ border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums; }}
caption {{ text-align: left; font-weight: 600; padding-bottom: 0.3em; }}
th, td {{ text-align: left; padding: 0.15em 0.8em; border-bottom: 1px solid #ddd; }}
.number {{ text-align: right; }}
img {{ max-width: 100%; }}
figure {{ margin: 1.5em 0; }}
figcaption {{ color: #555; }}
</style>
</head>
<body>
{body}
</body>
</html>
"""


class Report:
    """Headings, sentences, tables and pictures in order, written as one HTML file.

    Arguments:
        title: of the page.
        folder: folder for the pictures as separate PNG files; without it they are only in the page.
        attempts: collects parts that fail, such as a picture; they are listed at the end of the page.
    """

    def __init__(self, title: str, folder: Path | None = None, attempts: Attempts | None = None) -> None:
        self.title = title
        self.attempts = Attempts() if attempts is None else attempts
        self._folder = folder
        self._blocks = [f"<h1>{html.escape(title)}</h1>"]

    def heading(self, text: str) -> None:
        """Start a section."""
        self._blocks.append(f"<h2>{html.escape(text)}</h2>")

    def text(self, *sentences: str) -> None:
        """A paragraph; nothing if there are no words."""
        if any(sentences):
            self._blocks.append(f"<p>{html.escape(' '.join(sentences))}</p>")

    def points(self, items: Sequence[str]) -> None:
        """A list of remarks; nothing if it is empty."""
        if items:
            self._blocks.append(_points(items))

    def table(self, table: Table) -> None:
        """A table."""
        self._blocks.append(table.to_html())

    def part(self, what: str) -> AbstractContextManager[None]:
        """A part that may fail; the page then reports that `what` could not be made."""
        return self.attempts.part(what)

    def picture(self, figure: "Figure | Callable[[], Figure]", caption: str, name: str) -> None:
        """A figure, in the page and as a PNG file if the report has a folder; a failure is only reported.

        Arguments:
            figure: a figure, or a function that draws it, so that drawing may fail too.
            caption: below the figure.
            name: of the file, such as "ride.png".
        """
        with self.part(f"The picture {name}"):
            drawn = io.BytesIO()
            (figure() if callable(figure) else figure).savefig(drawn, dpi=150, format="png")
            if self._folder is not None:
                (self._folder / name).write_bytes(drawn.getvalue())
            data, words = base64.b64encode(drawn.getvalue()).decode("ascii"), html.escape(caption)
            image = f'<img alt="{words}" src="data:image/png;base64,{data}">'
            self._blocks.append(f"<figure>{image}<figcaption>{words}</figcaption></figure>")

    def to_html(self) -> str:
        """The page."""
        troubles = [_points(self.attempts.troubles)] if self.attempts.troubles else []
        return _PAGE.format(title=html.escape(self.title), body="\n".join([*self._blocks, *troubles]))

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the page."""
        path = Path(path)
        path.write_text(self.to_html(), encoding="utf-8")
        return path


def _points(items: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{html.escape(item)}</li>" for item in items) + "</ul>"
