"""Reads the demo's page back: its elements, its words, its pictures."""

import base64
import io
import re
from html.parser import HTMLParser

from PIL import Image

VOID_TAGS = {"meta", "img", "input", "link", "br", "wbr"}


class Page(HTMLParser):
    """Every element with its attributes; complains when tags don't match."""

    def __init__(self, html):
        super().__init__()
        self.elements, self.text, self._open = [], {}, []
        self.feed(html)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID_TAGS:
            self._open.append((tag, dict(attributes).get("id", tag)))

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self._open.pop()[0] == tag

    def handle_data(self, data):
        if self._open:
            key = self._open[-1][1]
            self.text[key] = self.text.get(key, "") + data

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def decode(uri):
    kind, content = re.fullmatch(r"data:image/(png|webp);base64,(.+)", uri).groups()
    image = Image.open(io.BytesIO(base64.b64decode(content, validate=True)))
    assert image.format == kind.upper()
    return image
