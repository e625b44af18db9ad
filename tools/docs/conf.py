"""Sphinx reads this. `build` stages the pages and calls Sphinx; the site loads nothing from the network."""

from __future__ import annotations

import brickpilot

project = "Brickpilot"
copyright = "the authors of Brickpilot, MIT licence"
version = release = brickpilot.__version__
html_title = f"Brickpilot {version}"
html_last_updated_fmt = None  # the same sources give the same site

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click"]
root_doc = "index"
exclude_patterns = ["_extra"]  # pages that are copied as they are
templates_path: list[str] = []

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = False
html_theme_options = {"footer_icons": []}
pygments_style = "friendly"
pygments_dark_style = "github-dark"

# Documents are the READMEs as they stand: their links lead to headings as on a code host.
myst_heading_anchors = 4
myst_enable_extensions = ["fieldlist"]
myst_links_external_new_tab = False
suppress_warnings = ["myst.header"]  # a page may begin below the first level

# The notebooks hold their outputs, which tests/python/test_notebooks.py proves fresh.
nb_execution_mode = "off"
nb_merge_streams = True
nb_render_markdown_format = "myst"

# In docstrings one back quote marks code, as in Markdown.
default_role = "code"
smartquotes = False
add_module_names = False
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_use_ivar = True
napoleon_use_rtype = False
