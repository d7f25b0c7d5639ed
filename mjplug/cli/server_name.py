"""Full names of servers from command line arguments."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mjplug.client import Client


def server_name(client: "Client", node: str) -> str:
    """Returns the full name of a server that is on the network.

    Args:
        client: A client on the network.
        node: `/mjplug`, `mjplug`, or `~` for the server of the client.

    Raises:
        UnknownNameError: No server has this name.
    """
    from mjplug.client import UnknownNameError

    if node == "~":
        return client.resolve("~/x").removesuffix("/x")
    name, nodes = client.resolve(node), client.nodes()
    if name not in nodes:
        raise UnknownNameError("node", name, nodes)
    return name
