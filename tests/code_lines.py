"""Which lines of a module hold code: neither comment, docstring nor blank."""

import ast
import io
import tokenize
from functools import cache
from pathlib import Path


@cache
def code_lines(file: str) -> set[int]:
    """The numbers of the lines of a file that hold code: neither comment, docstring nor blank."""
    form = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    source = Path(file).read_text(encoding="utf-8")
    tokens = [one for one in tokenize.generate_tokens(io.StringIO(source).readline) if one.type not in form]
    lines = {line for one in tokens for line in range(one.start[0], one.end[0] + 1)}
    strings = [
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    ]
    return lines - {line for node in strings for line in range(node.lineno, node.end_lineno + 1)}
