"""Options whose value may be left out, such as `--view` and `--view 8081`."""

from typing import Any

from typer.core import TyperCommand


class ViewPortCommand(TyperCommand):
    """A command with the option `--view [PORT]`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Completes `--view` without a port, because typer has no optional values."""
        from mjplug.limits import DEFAULT_VIEW_PORT

        options = args[: args.index("--")] if "--" in args else args
        complete = list(args)
        for index, word in enumerate(options):
            following = options[index + 1 : index + 2]
            if word == "--view" and not (following and following[0].isdigit()):
                complete[index] = f"--view={DEFAULT_VIEW_PORT}"
        return super().parse_args(ctx, complete)
