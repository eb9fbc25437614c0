"""Settings of Sphinx: `make docs`. Pages are the Markdown files of this folder; the rest is in tools/site."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT))

from ssgi_cl.version import __version__  # noqa: E402
from tools import pictures  # noqa: E402
from tools.site import api_pages, docstrings, links  # noqa: E402

project = "ssgi_cl"
version = release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery"]
exclude_patterns = ["_build", "gallery", "figures", "views"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}

html_theme = "pydata_sphinx_theme"
html_title = f"ssgi_cl {release}"
html_theme_options = {"show_toc_level": 2, "navigation_with_keys": False, "show_prev_next": False}
html_show_sourcelink = False

myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline"]
default_role = "py:obj"  # a name in single backticks is linked if it is public
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_param = False  # several names of one entry stay together
napoleon_use_rtype = False
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("ArrayLike", "NDArray", "Floats", "Mask", "Size")}
napoleon_attr_annotations = False  # the signature has them
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88

sphinx_gallery_conf: dict[str, Any] = {
    "examples_dirs": "gallery",
    "gallery_dirs": "generated/gallery",
    "filename_pattern": r"[/\\]\w+\.py$",
    "ignore_pattern": r"__init__\.py",
    "image_srcset": [],
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "subsection_order": [f"gallery/{part}" for part in ("arrays", "light", "errors", "programs")],
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
}


def setup(app: Any) -> None:
    """Write the pages that are made from the code and resolve the links of the others."""
    api_pages.write(ROOT, DOCS / "generated/api")
    links.write_project(ROOT, DOCS)
    links.remove_stale(ROOT, DOCS)

    def read(app: Any, name: str, source: list[str]) -> None:
        page = str(app.env.doc2path(name))
        if page.endswith(".md") and "/generated/" not in page:
            source[0] = links.resolved(source[0], Path(page).relative_to(ROOT), ROOT)
        if name == "techniques/README":  # as a page of the repository it has a table alone
            source[0] += "\n```{toctree}\n:glob:\n:hidden:\n\n*\n```\n"

    def describe(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
        lines[:] = docstrings.prepared(lines)

    app.connect("source-read", read)
    app.connect("env-check-consistency", lambda app, env: pictures.compress_gallery(DOCS))  # before they are copied
    app.connect("autodoc-process-docstring", describe, priority=100)  # before Napoleon
