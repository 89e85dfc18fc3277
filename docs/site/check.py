"""Find what is dead or foreign on the built site: `python docs/site/check.py FOLDER`."""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

FETCHED = {"script": "src", "img": "src", "source": "src", "iframe": "src", "link": "href"}
"""What a browser fetches by itself, by tag."""


class Page(HTMLParser):
    """The addresses and anchors of a page.

    Parameters
    ----------
    file : Path
        The page.
    """

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.fetched: set[str] = set()
        self.anchors: set[str] = set()
        self.without_words = 0
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag says."""
        given = dict(attrs)
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}
        beneath = given.get("data-image") == "photo"  # the demo describes what is drawn on it
        self.without_words += tag == "img" and not given.get("alt") and not beneath
        if address := given.get(FETCHED.get(tag, "href")):
            (self.links if tag == "a" else self.fetched).add(address)


def problems(folder: Path) -> list[str]:
    """Return dead links inside the site, what it would fetch from elsewhere, and pictures without words.

    Parameters
    ----------
    folder : Path
        The built site.
    """
    pages = {file.resolve(): Page(file) for file in sorted(folder.rglob("*.html")) if "_static" not in file.parts}
    found = []
    for file, page in pages.items():
        name = file.relative_to(folder.resolve())
        found += [f"{name}: a picture without words"] * page.without_words
        found += [f"{name}: fetches {address}" for address in sorted(page.fetched) if urlsplit(address).netloc]
        found += [f"{name}: leads to {a}" for a in sorted(page.links | page.fetched) if is_dead(a, file, pages)]
    return found


def is_dead(address: str, file: Path, pages: dict[Path, Page]) -> bool:
    """Return whether an address inside the site leads nowhere.

    Parameters
    ----------
    address : str
        As it stands in the page.
    file : Path
        The page.
    pages : dict of Path to Page
        All pages.
    """
    parts = urlsplit(address)
    if parts.scheme or parts.netloc:
        return False
    target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
    if target not in pages or not parts.fragment:
        return not target.exists()
    return unquote(parts.fragment) not in pages[target].anchors


if __name__ == "__main__":
    sys.exit("\n".join(problems(Path(sys.argv[1]))) or 0)
