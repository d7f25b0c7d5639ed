"""Text from other programs, made safe to print: one line, without control characters.

A name, a payload or an error reply may contain line breaks, terminal escape sequences and characters that reverse the
direction of the text. Printed as they are, they would forge log lines or change what the reader sees.
"""

INDENT = "    "
"""What the second and later lines of a text begin with, so that none of them looks like a log line of its own."""


def one_line(text: str) -> str:
    r"""Returns a text with every character that is not printable written as an escape: `\n`, `\x1b`, `\u202e`.

    Letters of all scripts, symbols and blanks stay as they are. Escaped are control characters (C0 and C1), line and
    paragraph separators, invisible formatting characters (direction overrides among them) and lone surrogates.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def lines(text: str) -> str:
    """Returns a text of several lines, each of them escaped as by `one_line`, all but the first indented."""
    return f"\n{INDENT}".join(one_line(line) for line in text.expandtabs(4).split("\n"))
