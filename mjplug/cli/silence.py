"""Why a topic has no messages, for whoever waits for them."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mjplug.client import Client


def why_silent(client: "Client", topic: str, otherwise: str = "nothing has been published yet") -> str:
    """Returns why nothing arrives on a topic, as far as servers know.

    Args:
        client: A client on the network.
        topic: The topic's full name.
        otherwise: What to return if a server publishes it and runs.
    """
    from mjplug.client.parameters import read

    known = client.topics().get(topic)
    if known is None or not known.publishers:
        return "no server publishes it"
    if all(read(client.session, name).get("sim.paused") for name in known.publishers):
        return "the simulation is paused (mjplug sim resume)"
    return otherwise
