"""What a window needs of a server."""

from dataclasses import dataclass

import mujoco

from mjplug.window.controls import Controls
from mjplug.window.drag import Drag
from mjplug.window.feed import Feed


@dataclass(frozen=True, slots=True)
class Served:
    """A server that a window shows and controls.

    Attributes:
        name: The server's full name.
        model: The server's model.
        feed: The server's states.
        drag: Sends what the user drags.
        controls: Controls the server.
    """

    name: str
    model: mujoco.MjModel
    feed: Feed
    drag: Drag
    controls: Controls
