"""A page of results: one self-contained HTML file."""

import base64
import datetime
import html
import io
import os
import platform
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from jaxdamp._display import display
from jaxdamp._tables import Table
from jaxdamp.report.attempts import Attempts


if TYPE_CHECKING:
    from matplotlib.figure import Figure


PIXELS = 86  # of a page for an inch of a picture: the widest ones fill the page
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root {{ color-scheme: light; }}
body {{ font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 72em; margin: 2em auto;
  padding: 0 1em; overflow-wrap: break-word; }}
h1 {{ line-height: 1.2; }}
h2 {{ margin-top: 2em; border-bottom: 2px solid #0072b2; }}
nav {{ color: #555; margin-bottom: 1em; }}
.verdict {{ border-left: 5px solid #0072b2; background: #eef5fa; padding: 0.3em 1em; font-size: 1.07em; }}
.table {{ overflow-x: auto; margin: 1em 0; }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; }}
caption {{ text-align: left; font-weight: 600; padding-bottom: 0.3em; white-space: nowrap; }}
th, td {{ text-align: left; vertical-align: top; padding: 0.15em 0.8em 0.15em 0; border-bottom: 1px solid #ddd; }}
th {{ vertical-align: bottom; }}
td {{ min-width: 4em; max-width: 28em; }}
.number {{ text-align: right; white-space: nowrap; }}
th.number {{ white-space: normal; }}
img {{ max-width: 100%; height: auto; }}
figure {{ margin: 1.5em 0; }}
figcaption, footer {{ color: #555; }}
footer {{ margin-top: 3em; border-top: 1px solid #ddd; font-size: 0.9em; }}
pre {{ white-space: pre-wrap; }}
@media (max-width: 40em) {{
  body {{ margin: 1em auto; font-size: 14px; }}
  caption {{ white-space: normal; }}
  figure {{ overflow-x: auto; }}
  img {{ max-width: none; width: max(100%, 640px); }}
}}
@media print {{
  @page {{ margin: 14mm; }}
  body {{ font-size: 9.5pt; max-width: none; margin: 0; padding: 0; }}
  nav {{ display: none; }}
  .table {{ overflow-x: visible; }}
  table {{ font-size: 8pt; }}
  th, td {{ padding-right: 0.5em; min-width: 0; }}
  h2, h3, caption {{ break-after: avoid; }}
  figure, tr, .verdict {{ break-inside: avoid; }}
  img {{ max-height: 230mm; }}
}}
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
        self._headings: list[str] = []
        self._blocks: list[str] = []

    def heading(self, text: str) -> None:
        """Start a section; the page begins with links to all of them."""
        self._headings.append(text)
        self._blocks.append(f'<h2 id="{len(self._headings)}">{html.escape(display().words(text))}</h2>')

    def verdict(self, *sentences: str) -> None:
        """The result in words, each sentence on a line, in a box; nothing if there are no words."""
        lines = "".join(f"<p>{self._escaped(sentence)}</p>" for sentence in sentences if sentence)
        if lines:
            self._blocks.append(f'<div class="verdict">{lines}</div>')

    def text(self, *sentences: str) -> None:
        """A paragraph; nothing if there are no words."""
        if any(sentences):
            self._blocks.append(f"<p>{self._escaped(' '.join(sentences))}</p>")

    def points(self, items: Sequence[str]) -> None:
        """A list of remarks; nothing if it is empty."""
        if items:
            self._blocks.append(_points([display().words(self.attempts.words(item)) for item in items]))

    def _escaped(self, sentence: str) -> str:
        return html.escape(display().words(self.attempts.words(sentence)))

    def table(self, table: Table) -> None:
        """A table."""
        self._blocks.append(f'<div class="table">{table.to_html()}</div>')

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
            drawn, shown = io.BytesIO(), figure() if callable(figure) else figure
            shown.savefig(drawn, dpi=150, format="png")
            if self._folder is not None:
                (self._folder / name).write_bytes(drawn.getvalue())
            data, words = base64.b64encode(drawn.getvalue()).decode("ascii"), html.escape(display().words(caption))
            width = round(PIXELS * shown.get_figwidth())
            image = f'<img alt="{words}" width="{width}" src="data:image/png;base64,{data}">'
            self._blocks.append(f"<figure>{image}<figcaption>{words}</figcaption></figure>")

    def to_html(self, command: str = "") -> str:
        """The page.

        Arguments:
            command: the command that writes this page, for its last lines, which have date and versions.
        """
        links = [f'<a href="#{n}">{html.escape(text)}</a>' for n, text in enumerate(self._headings, 1)]
        contents = [f"<nav>{' · '.join(links)}</nav>"] * (len(links) > 1)
        troubles = [_points(self.attempts.troubles)] if self.attempts.troubles else []
        parts = [f"<h1>{html.escape(self.title)}</h1>", *contents, *self._blocks, *troubles, _footer(command)]
        return _PAGE.format(title=html.escape(self.title), body="\n".join(parts))

    def write(self, path: str | os.PathLike[str], command: str = "") -> Path:
        """Write the page.

        Arguments:
            path: of the file.
            command: as in `to_html`.
        """
        path = Path(path)
        path.write_text(self.to_html(command), encoding="utf-8")
        return path


def _points(items: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{html.escape(item)}</li>" for item in items) + "</ul>"


def _footer(command: str) -> str:
    """Date, versions, and the command that makes the page again."""
    library, *libraries = (f"{name} {_version(name)}" for name in ("jaxdamp", "jax", "equinox", "numpy", "scipy"))
    system = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    made = f"Written on {datetime.date.today()} by {library} ({', '.join(libraries)}, {system})."
    again = f" To repeat it:<pre>{html.escape(command)}</pre>" if command else ""
    return f"<footer>{html.escape(made)}{again}</footer>"


def _version(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:  # a source tree on the path, not installed
        return "of unknown version"
