"""A text cell's HTML as the instructor's browser gets it: nothing runs, nothing is fetched, and it takes no time."""

import struct
import time
import zlib
from base64 import b64encode
from html import unescape

import pytest
from nbgrader.server_extensions.formgrader import handlers

from semgrid_edu.workshop.course.nbgrader.build import course_api
from semgrid_edu.workshop.course.nbgrader.cleaning import without_scripts


def png(side):
    """Return the beginning of a square picture, in base64."""
    header = b"IHDR" + struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)
    chunk = struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))
    return b64encode(b"\x89PNG\r\n\x1a\n" + chunk + struct.pack(">I", 0) + b"IDAT" + bytes(4)).decode()


PICTURE, HUGE = f"data:image/png;base64,{png(8)}", png(50_000)


@pytest.mark.parametrize(
    ("html", "gone"),
    [
        ('<img src="http://elsewhere.example/seen.png">', "elsewhere"),
        ('<img src="//elsewhere.example/seen.png">', "elsewhere"),
        ('<img src="/api/shutdown">', "api"),
        ('<img src="data:image/svg+xml;base64,PHN2Zz4=">', "svg"),
        ('<img src="data:text/html,x">', "html"),
        ('<a href="data:text/html,x">x</a>', "data"),
        ('<a href="java&#115;cript:alert(1)">x</a>', "script"),
        ('<a href="/formgrader/delete">x</a>', "formgrader"),
        ('<a href="http:derivation.html">x</a>', "derivation"),
        ('<a href="https:/derivation.html">x</a>', "derivation"),
        (f'<img src="data:image/png;base64,{HUGE}">', "base64"),
        ('<p id="toc">x</p>', "toc"),
        ('<a name="toc">x</a>', "name"),
        ('<div class="modal navbar-fixed-top">x</div>', "modal"),
        ('<p style="position:fixed">x</p>', "style"),
        ('<form action="http://elsewhere.example"><button>x</button></form>', "<form"),
        ('<meta http-equiv="refresh" content="0;url=http://elsewhere.example">', "<meta"),
        ('<base href="http://elsewhere.example">', "<base"),
        (r"<p>$\href{javascript:alert(1)}{x}$</p>", r"\href"),
        (r"<p>$\let\a\style \a{position:fixed}{x}$</p>", r"\style"),
        (r"<p>$\require{HTML}$</p>", r"\require"),
        ("<svg><script>alert(1)</script></svg>", "<script"),
        ("<math><mtext><table><mglyph><style><img src=x onerror=alert(1)>", "<img src"),
    ],
)
def test_what_could_act_in_a_browser_is_gone(html, gone):
    assert gone not in without_scripts(html)


@pytest.mark.parametrize(
    ("formula", "macro"),
    [
        (r"\\href{a}{x}", "href"),
        (r"\href1", "href"),
        (r"\hr<!-- -->ef{a}{x}", "href"),
        (r"\&#104;r&#x65;&#x66;{a}{x}", "href"),
        ("&bsol;style{a}{x} &#92;href{a}{x}", "style"),
        (r"\mmlToken{mi}[href='a']{x}", "mmlToken"),
        (r"\bbox[background: url(a)]{x}", "bbox"),
    ],
)
def test_no_way_of_writing_a_macro_keeps_it(formula, macro):
    assert "\\" + macro not in unescape(without_scripts(f"<p>${formula}$</p>"))


@pytest.mark.parametrize(
    "html",
    [
        "<p><strong>bold</strong> $a$ <em>b</em> <code>c</code></p>",
        r"<p>$\hat{x} = \frac{a}{b}, \text{data}, \classes$</p>",
        '<a href="https://example.org/?a=b#c" title="there">x</a>',
        f'<img alt="drawn" src="{PICTURE}">',
        '<div class="highlight hl-python"><pre><span class="nn">numpy</span></pre></div>',
        "<table><thead><tr><th>a</th></tr></thead><tbody><tr><td>1</td></tr></tbody></table>",
    ],
)
def test_what_markdown_becomes_stays(html):
    assert without_scripts(html) == html


def test_a_file_that_was_handed_in_runs_nothing_in_formgrader(course):
    with course_api(course):
        assert handlers.SubmissionFilesHandler.content_security_policy.startswith("sandbox; ")


SLOW = {"div": "<div>", "p": "<p><b>", "li": "<ul><li>", "closed": "<div></x>", "open": "<a ", "less": "&lt;"}


@pytest.mark.parametrize("kind", SLOW)
def test_the_time_does_not_grow_with_the_square(kind):
    html = SLOW[kind] * (64_000 // len(SLOW[kind]))
    began = time.process_time()
    assert len(without_scripts(html)) > 60_000
    assert time.process_time() - began < 3


def test_a_text_of_many_tags_is_shown_as_it_was_written():
    assert without_scripts("<script>" * 2000).startswith("<pre>&lt;script&gt;")
