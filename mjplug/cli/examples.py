"""Examples at the end of a command's help."""


def examples(*lines: str) -> str:
    """Returns an epilog with one command per line; its first character stops click from joining the lines."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)
