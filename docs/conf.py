"""Sphinx configuration; `CONTRIBUTING.md` names the command that builds the site."""

import shutil
import sys
from importlib.metadata import version as installed_version
from pathlib import Path


here = Path(__file__).parent
sys.path.insert(0, str(here))

from _papers import write_table  # noqa: E402
from _pictures import draw_all  # noqa: E402
from _reference import process_docstring, skip_member, write_pages  # noqa: E402


project = "jaxdamp"
author = "the jaxdamp developers"
copyright = author
version = release = installed_version("jaxdamp")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
default_role = "code"  # docstrings write `name`

autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_preprocess_types = False
toc_object_entries = False

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
        else:
            without_results.append(source.stem)
        shutil.copy2(source, target / source.name)
    return without_results


nb_execution_mode = "off"
if unexecuted := copy_notebooks(here / "notebooks"):
    print(f"without pictures, because `pytest -m notebook` has not run since they changed: {', '.join(unexecuted)}")


def setup(app):
    """Write the generated sources before Sphinx looks for pages."""
    draw_all(here / "pictures")
    write_table(here / "papers.md")
    write_pages(here / "reference")
    app.connect("autodoc-skip-member", skip_member)
    app.connect("autodoc-process-docstring", process_docstring, priority=400)  # before napoleon
