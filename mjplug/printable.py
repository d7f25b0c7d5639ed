"""Escapes text from other programs so that it is safe to print: one line, without control characters.

A name, a payload or an error reply may contain line breaks, terminal escape sequences and characters that reverse the
direction of the text. Printed without escaping, they could forge log lines or hide text from the reader.
"""

INDENT = "    "
"""Prefix of the second and later lines of a text, so that none of them looks like a log line."""


def one_line(text: str) -> str:
    r"""Returns a text with every character that is not printable written as an escape: `\n`, `\x1b`, `\u202e`.

    Letters of all scripts, symbols and spaces are not changed. Control characters (C0 and C1), line and paragraph
    separators, invisible formatting characters (such as direction overrides) and lone surrogates are escaped.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def lines(text: str) -> str:
    """Returns a text of several lines, each escaped by `one_line`, and all but the first indented."""
    return f"\n{INDENT}".join(one_line(line) for line in text.expandtabs(4).split("\n"))
