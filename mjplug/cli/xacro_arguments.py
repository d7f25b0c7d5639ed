"""Arguments of xacro files on the command line."""

import typer


def xacro_arguments(given: list[str]) -> dict[str, str]:
    """Returns the values of `NAME:=VALUE` arguments by name.

    Raises:
        BadParameter: One has another form.
    """
    found = {}
    for text in given:
        name, sign, value = text.partition(":=")
        if not sign or not name.isidentifier():
            raise typer.BadParameter(
                f"{text!r} is not an argument of a xacro file; write NAME:=VALUE", param_hint="[NAME:=VALUE]..."
            )
        found[name] = value
    return found
