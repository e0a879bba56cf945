"""How the pages of this folder become a site: `make docs`. Nothing is fetched from the network while it is built."""

from __future__ import annotations

import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent / "src"), str(HERE / "_extensions")]

import suboctave  # noqa: E402
from suboctave.version import __version__  # noqa: E402

project = "suboctave"
author = "the suboctave authors"
copyright = "the suboctave authors, BSD-3-Clause"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "executed",
]
exclude_patterns = ["_build", "_extensions"]
source_suffix = {".md": "markdown"}
language = "en"
nitpicky = True
# Types of attributes that are no public names: they are shown, and have no page.
nitpick_ignore_regex = [("py:(class|obj|data)", r".*")]
default_role = "code"
highlight_language = "none"

myst_enable_extensions = ["amsmath", "attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_default_options = {"members": True}
python_maximum_signature_line_length = 100

html_theme = "pydata_sphinx_theme"
html_title = f"suboctave {release}"
html_static_path = ["_static"]
html_css_files = ["suboctave.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "suboctave"},
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
    "pygments_dark_style": "monokai",
}
html_sidebars = {"index": [], "messages": [], "questions": [], "gallery": []}  # no pages below them

_CODE = re.compile(r"(``.*?``|`[^`]*`)", re.S)


def _linked(code: str) -> str:
    """Code of a docstring; a public name leads to its place in the reference."""
    name = code.strip("`")
    return f":py:obj:`{name} <suboctave.{name}>`" if name in suboctave.__all__ else code


def _plain(text: str) -> str:
    """A line of a docstring for reStructuredText: outside of code no character has a meaning of its own."""
    parts = _CODE.split(text)
    plain = [re.sub(r"([*|\\])|(?<=\w)(_)(?!\w)", r"\\\g<0>", part) for part in parts]
    return "".join(_linked(part) if i % 2 else plain[i] for i, part in enumerate(parts))


def plain_docstrings(app, what, name, obj, options, lines):
    """Docstrings of the package are plain texts with NumPy's headings and `code`; a star or a bar in them is itself."""
    made: list[str] = []
    code = False
    for i, line in enumerate(lines):
        if line and set(line) == {"-"} and i and len(line) == len(lines[i - 1]):
            made[-1:] = [f".. rubric:: {lines[i - 1]}", ""]
            continue
        starts = line.startswith("    ") and i > 1 and not lines[i - 1].strip() and not lines[i - 2].startswith(" ")
        if starts and not code:  # an indented block behind a paragraph is code or a formula
            made += ["::", ""]
            code = True
        elif line.strip() and not line.startswith(" "):
            code = False
        made.append(line if code else _plain(line))
    lines[:] = made


_FENCED = re.compile(r"(^```.*?^```)", re.M | re.S)
_NAMED = re.compile(r"(?<!\[)`so\.(\w+)(\([^`]*\))?`(?!\])")


def linked_names(app, docname, source):
    """`so.name` in a page leads to its place in the reference."""

    def link(match):
        name, call = match[1], match[2] or ""
        return f"{{py:obj}}`so.{name}{call} <suboctave.{name}>`" if name in suboctave.__all__ else match[0]

    parts = _FENCED.split(source[0])
    source[0] = "".join(part if i % 2 else _NAMED.sub(link, part) for i, part in enumerate(parts))


def setup(app):
    app.connect("source-read", linked_names)
    app.connect("autodoc-process-docstring", plain_docstrings, priority=100)
