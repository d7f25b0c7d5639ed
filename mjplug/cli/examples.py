"""Examples at the end of a command's help."""


def examples(*lines: str) -> str:
    """Returns an epilog with one command a line; the mark keeps the lines apart."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)
