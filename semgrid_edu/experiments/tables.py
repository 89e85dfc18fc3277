"""Results as text: shares in per cent, and tables in Markdown."""


def per_cent(value: float | None) -> str:
    """Write a share in per cent.

    Parameters
    ----------
    value : float or None
        A share, 0..1; None for a share of nothing.

    Returns
    -------
    str
    """
    return "-" if value is None else f"{100 * value:.1f}"


def markdown_table(rows: list[list[str]]) -> str:
    """Lay out rows as a Markdown table whose columns also line up in plain text.

    Parameters
    ----------
    rows : list of list of str
        The cells of each row, the header first.

    Returns
    -------
    str
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "| "
        + " | ".join(
            f"{row[0]:{widths[0]}}" if k == 0 else f"{text:>{w}}"
            for k, (text, w) in enumerate(zip(row, widths, strict=True))
        )
        + " |"
        for row in rows
    ]
    lines.insert(1, "|" + "|".join("-" * (w + 1) + ("-" if k == 0 else ":") for k, w in enumerate(widths)) + "|")
    return "\n".join(lines)
