"""Completion of names."""

from pathlib import Path

import typer

from mjplug.cli.quick_completion import live_names, node_names, typed_words

_CONFIGS = (".yaml", ".yml")
"""Suffixes of configuration files."""

_STATES_TIMEOUT = 2.0
"""Timeout of the list of saved states [s]; reading the headers of files takes time, and the user waits."""


def complete_topic(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the topics that start with `incomplete`."""
    return live_names("topics", incomplete, context.params.get("connect"))


def complete_service(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the services that start with `incomplete`."""
    return live_names("services", incomplete, context.params.get("connect"))


def complete_action(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the actions that start with `incomplete`."""
    return live_names("actions", incomplete, context.params.get("connect"))


def complete_node(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the servers whose names start with `incomplete`."""
    return node_names(incomplete, context.params.get("connect"))


def complete_type(incomplete: str) -> list[str]:
    """Returns the ROS types that start with `incomplete`."""
    from mjplug_schemas.registry import all_types

    return [name for name in all_types() if name.startswith(incomplete)]


def complete_message_type(incomplete: str) -> list[str]:
    """Returns the message types that start with `incomplete`."""
    return [name for name in complete_type(incomplete) if "/msg/" in name]


def complete_service_type(incomplete: str) -> list[str]:
    """Returns the service types that start with `incomplete`."""
    return [name for name in complete_type(incomplete) if "/srv/" in name]


def complete_action_type(incomplete: str) -> list[str]:
    """Returns the action types that start with `incomplete`."""
    return [name for name in complete_type(incomplete) if "/action/" in name]


def complete_plugin(incomplete: str) -> list[str]:
    """Returns the plugin types that start with `incomplete`."""
    from importlib.metadata import entry_points

    return [point.name for point in entry_points(group="mjplug.plugins") if point.name.startswith(incomplete)]


def complete_model(incomplete: str) -> list[str]:
    """Returns the bundled models, files and folders that start with `incomplete`.

    The list is empty if no bundled model matches; the shell then completes file names.
    """
    from mjplug.model.location import BUNDLED, bundled_models

    bundled = [name for model in bundled_models() if (name := f"{BUNDLED}{model}").startswith(incomplete)]
    if not bundled or not incomplete:
        return []
    return [*bundled, *sorted(path.name for path in Path().iterdir() if path.name.startswith(incomplete))]


def complete_keyframe(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the matching keyframes of the model that is named on the command line."""
    from mjplug.model.location import BUNDLED, PACKAGE, SUFFIXES

    # While the value of an option is missing, click does not report earlier arguments.
    words = typed_words() or []
    models = [word for word in words if word.startswith((BUNDLED, PACKAGE)) or word.endswith((*SUFFIXES, *_CONFIGS))]
    model = context.params.get("model") or next(iter(models), None)
    return _keyframes(model, incomplete) if isinstance(model, str) else []


def complete_keyframe_of_server(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the matching keyframes of the model of a running server, if the model file is on this machine."""
    from mjplug.client import ClientError, connect
    from mjplug.client.parameters import read

    try:
        chosen = context.params.get("connect")
        with connect(chosen, server=context.params.get("server") or "", timeout=0.0) as client:
            model = read(client.session, client.server.name).get("model")
    except ClientError:
        # A message or a traceback would disturb the prompt.
        return []
    return _keyframes(model, incomplete) if isinstance(model, str) else []


def complete_state(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the matching saved states of a running server: those in memory, or with `--file` those in files."""
    from mjplug.client import ClientError, connect

    file = bool(context.params.get("file"))
    try:
        chosen, server = context.params.get("connect"), context.params.get("server") or ""
        with connect(chosen, server=server, timeout=0.0) as client:
            saved = client.call("~/list_states", timeout=_STATES_TIMEOUT).snapshots
    except ClientError:
        # A message or a traceback would disturb the prompt.
        return []
    return [one.name for one in saved if one.file == file and one.name.startswith(incomplete)]


def _keyframes(model: str, begin: str) -> list[str]:
    """Returns the names of keyframes that start with `begin`; for a configuration file, those of its model."""
    from mjplug.cli.engine import import_mujoco

    import_mujoco()
    import mujoco

    from mjplug.config.document import read_document
    from mjplug.errors import MjplugError
    from mjplug.model.location import locate

    try:
        folder = Path()
        if model.endswith(_CONFIGS):
            tree = read_document(Path(model)).value
            model, folder = str(tree.get("model") if isinstance(tree, dict) else ""), Path(model).parent
        names = [key.name for key in mujoco.MjSpec.from_file(str(locate(model, (folder,)))).keys]
    except (MjplugError, ValueError, OSError):
        return []
    # A shell evaluates completions.
    return sorted(name for name in names if name.startswith(begin) and name.replace("_", "").isalnum())


def complete_parameter(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the matching parameters of the server that is named on the command line."""
    from mjplug.cli.server_name import server_name
    from mjplug.client import ClientError, connect
    from mjplug.client.parameters import names_of

    try:
        with connect(context.params.get("connect"), server=context.params.get("server") or "", timeout=0.0) as client:
            names = names_of(client, server_name(client, context.params.get("node") or "~"))
    except ClientError:
        # A message or a traceback would disturb the prompt.
        return []
    return [name for name in names if name.startswith(incomplete) and name.replace("_", "").replace(".", "").isalnum()]
