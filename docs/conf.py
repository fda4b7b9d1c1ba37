"""Settings of the site, which ``make docs`` writes to ``out/docs``, without a network."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "_ext"))

# The pictures of the gallery are drawn while the site is built, in the width that the pages show them in.
os.environ.setdefault("EXAMPLE_WIDTH", "480")

from translucent.version import VERSION  # noqa: E402

project = "translucent"
version = release = VERSION
copyright = "the authors of translucent"

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "measurements",
    "benchmark_results",
    "preset_reference",
    "typescript_reference",
    "live_scene",
    "pictures",
]
templates_path = ["_templates"]
exclude_patterns = ["_ext", "_templates", "generated/*.md"]
source_suffix = {".rst": "restructuredtext", ".md": "markdown"}
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

default_role = "py:obj"  # names in docstrings stand in single backticks
# Beside the class Preset, on a file system that takes no notice of case.
autosummary_filename_map = {"translucent.preset": "translucent.preset_function"}

autodoc_typehints = "none"  # numpydoc's sections have them
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
add_module_names = False

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["math.css", "pages.css"]
html_js_files = [("pages.js", {"defer": "defer"})]
html_title = f"translucent {VERSION}"
html_math_renderer = "mathml"
html_show_sphinx = False

sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "examples"),
    "gallery_dirs": "gallery_of_examples",
    "filename_pattern": r"\.py$",
    "image_scrapers": ("pictures.new_pictures",),
    "reset_modules": (),
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "show_memory": False,
}


def name_levels(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object) -> None:
    """Give the captions of the navigation, which the theme makes headings, the level that headings need."""
    tree = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')


def setup(app: Sphinx) -> None:
    """Connect after the theme, whose navigation is changed."""
    app.connect("html-page-context", name_levels, priority=900)
