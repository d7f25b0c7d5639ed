"""The reason why no messages arrive on a topic."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mjplug.client import Client


def why_silent(client: "Client", topic: str, otherwise: str = "nothing has been published yet") -> str:
    """Returns why no messages arrive on a topic, according to the servers.

    Args:
        client: A client on the network.
        topic: The topic's full name.
        otherwise: The result if a server publishes the topic and its simulation runs.
    """
    from mjplug.client.parameters import read

    known = client.topics().get(topic)
    if known is None or not known.publishers:
        return "no server publishes it"
    if all(read(client.session, name).get("sim.paused") for name in known.publishers):
        return "the simulation is paused (mjplug sim resume)"
    return otherwise
