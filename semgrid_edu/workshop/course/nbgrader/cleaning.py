"""Text cells of submissions made safe to show: the instructor who reads them is logged in."""

import re
from html import escape, unescape

import bleach
from nbconvert.filters import strip_files_prefix

from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.course.sandbox.notebook import is_small_picture

SHOWN_TAGS = (*bleach.ALLOWED_TAGS, *table_beside(__file__)["tags"])
"""The HTML tags that Markdown turns into; none of them runs anything."""

SHOWN_ATTRIBUTES: dict[str, str] = table_beside(__file__)["attributes"]
"""The pattern of an attribute's value, by its name or by tag and name."""

MACROS = re.compile(rf"\\+({'|'.join(table_beside(__file__)['macros'])})(?![A-Za-z])")
"""The macros of formulas that aren't shown, with all backslashes before them: one that is left would make a macro."""

REFERENCE = re.compile(r"&(#\w+|bsol);")
"""The form in which HTML may hide a letter or the backslash of a macro."""

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
    html = REFERENCE.sub(_letter, strip_files_prefix(html))
    if html.count("<") > MOST_TAGS:
        html = f"<pre>{escape(html)}</pre>"
    else:
        protocols = {*bleach.ALLOWED_PROTOCOLS, "data"}
        html = bleach.clean(html, tags=SHOWN_TAGS, attributes=_is_shown, protocols=protocols)
    # Afterwards, since removing a comment may join the parts of a macro.
    return MACROS.sub(r"\1", html)


def _letter(reference: re.Match[str]) -> str:
    """Return the letter or backslash that a reference stands for; other references stay."""
    meant = unescape(reference[0])
    return meant if re.fullmatch(r"[A-Za-z\\]", meant) else reference[0]


def _is_shown(tag: str, name: str, value: str) -> bool:
    """Return whether an attribute stays: links, colours of code, pictures within the text, but not from elsewhere."""
    pattern = SHOWN_ATTRIBUTES.get(f"{tag} {name}", SHOWN_ATTRIBUTES.get(name, "(?!)"))
    fits = re.fullmatch(pattern, value, re.IGNORECASE | re.DOTALL) is not None
    return fits and (name != "src" or is_small_picture(value.partition(",")[2]))
