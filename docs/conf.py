"""Sphinx configuration; `CONTRIBUTING.md` names the command that builds the site."""

import shutil
import sys
from importlib.metadata import version as installed_version
from pathlib import Path


here = Path(__file__).parent
sys.path.insert(0, str(here))

from _examples import EXAMPLES, add_outputs  # noqa: E402
from _laws import draw_all as draw_laws  # noqa: E402
from _links import resolve  # noqa: E402
from _papers import write_table  # noqa: E402
from _pictures import draw_all  # noqa: E402
from _reference import process_docstring, process_signature, skip_member, write_pages  # noqa: E402
from sphinx.util import logging  # noqa: E402


project = "jaxdamp"
author = "the jaxdamp developers"
copyright = author
version = release = installed_version("jaxdamp")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton", "_formulas"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_update_mathjax = False
copybutton_prompt_text = "$ "
copybutton_selector = "div:not(.highlight-text) > div.highlight pre"  # of code, not of what it prints
myst_heading_anchors = 3
default_role = "py:obj"  # docstrings write `name`: a link where it is a name of the library, else code

autodoc_typehints = "none"  # `process_signature` writes them
maximum_signature_line_length = 100
add_module_names = False
autodoc_member_order = "bysource"
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_preprocess_types = False
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"jaxdamp {release}"


def copy_notebooks(target: Path) -> list[str]:
    """Copy the notebooks here, with their results where `pytest -m notebook` has left them; names of the others."""
    target.mkdir(exist_ok=True)
    without_results = []
    for source in (here.parent / "notebooks").glob("*.ipynb"):
        executed = here.parent / "build" / "notebooks" / source.name
        if executed.exists() and executed.stat().st_mtime > source.stat().st_mtime:
            source = executed
        elif "image/png" not in source.read_text(encoding="utf-8"):
            without_results.append(source.stem)
        shutil.copy2(source, target / source.name)
    return without_results


nb_execution_mode = "off"
unexecuted = copy_notebooks(here / "notebooks")


def setup(app):
    """Write the generated sources before Sphinx looks for pages; a strict build has results in all of them."""
    if unexecuted:
        words = "without results, because `pytest -m notebook` has not run since they changed: %s"
        logging.getLogger(__name__).warning(words, ", ".join(unexecuted))
    if not EXAMPLES.exists():
        logging.getLogger(__name__).warning("examples are without what they print, because `pytest` has not run")
    draw_all(here / "pictures")
    write_table(here / "papers.md")
    write_pages(here / "reference", draw_laws(here / "pictures" / "laws"))
    app.connect("source-read", add_outputs)
    app.connect("autodoc-skip-member", skip_member)
    app.connect("autodoc-process-docstring", process_docstring, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", process_signature)
    app.connect("missing-reference", resolve)
