"""Sphinx: the documentation as a site, which `make docs` builds into build/site, with links and headings checked."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_site"))

project = "chefbotd"
release = version = version_of("chefbotd")
copyright = "the authors of chefbotd"
html_title = f"chefbotd {release}"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "command_reference",
    "socket_reference",
]
exclude_patterns = ["_site"]

myst_heading_anchors = 4
myst_links_external_new_tab = False
myst_url_schemes = ("http", "https")

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_default_options = {"members": True, "inherited-members": "BaseModel, Exception"}

html_theme = "furo"
html_static_path = ["_site/static"]
html_css_files = ["pages.css"]
