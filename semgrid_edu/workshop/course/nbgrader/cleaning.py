"""Text cells of submissions made safe to show: the instructor who reads them is logged in."""

import re
from html import escape

import bleach
from nbconvert.filters import strip_files_prefix

from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.course.sandbox.notebook import is_small_picture

SHOWN_TAGS = (*bleach.ALLOWED_TAGS, *table_beside(__file__)["tags"])
"""The HTML tags that Markdown turns into; none of them runs anything."""

SHOWN_ATTRIBUTES: dict[str, str] = table_beside(__file__)["attributes"]
"""The pattern of an attribute's value, by its name or by tag and name."""

MACROS = re.compile(rf"\\({'|'.join(table_beside(__file__)['macros'])})\b")
"""The macros of formulas that aren't shown, with their backslash."""

MOST_TAGS = 1500
"""A text with more tags is shown as it was written, because cleaning may take quadratic time."""


def without_scripts(html: str) -> str:
    """Remove from a text cell's HTML everything that could run in a browser.

    Parameters
    ----------
    html : str
        What nbconvert made of Markdown. This function replaces its filter `strip_files_prefix`, the last one that
        nbgrader applies.
    """
    html = MACROS.sub(r"\1", strip_files_prefix(html))
    if html.count("<") > MOST_TAGS:
        return f"<pre>{escape(html)}</pre>"
    return bleach.clean(html, tags=SHOWN_TAGS, attributes=_is_shown, protocols={*bleach.ALLOWED_PROTOCOLS, "data"})


def _is_shown(tag: str, name: str, value: str) -> bool:
    """Return whether an attribute stays: links, colours of code, pictures within the text, but not from elsewhere."""
    pattern = SHOWN_ATTRIBUTES.get(f"{tag} {name}", SHOWN_ATTRIBUTES.get(name, "(?!)"))
    fits = re.fullmatch(pattern, value, re.IGNORECASE | re.DOTALL) is not None
    return fits and (name != "src" or is_small_picture(value.partition(",")[2]))
