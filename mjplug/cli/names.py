"""Names that the TAB key completes."""

import typer

from mjplug.cli.live_names import live_names


def complete_topic(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the topics that begin so."""
    return live_names("topics", incomplete, context.params.get("connect"))


def complete_service(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the services that begin so."""
    return live_names("services", incomplete, context.params.get("connect"))


def complete_type(incomplete: str) -> list[str]:
    """Returns the ROS types that begin so."""
    from mjplug_schemas.registry import all_types

    return [name for name in all_types() if name.startswith(incomplete)]


def complete_plugin(incomplete: str) -> list[str]:
    """Returns the plugin types that begin so."""
    from importlib.metadata import entry_points

    return [point.name for point in entry_points(group="mjplug.plugins") if point.name.startswith(incomplete)]
