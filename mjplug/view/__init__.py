"""The simulation view in a browser: a relay between the servers of a network and the page, over HTTP and a WebSocket.

It needs Zenoh, `mjplug_schemas` and `websockets` (the extra `view`), and imports neither MuJoCo nor numpy.
"""

from mjplug.view.notebook import InlineView, view

__all__ = ["InlineView", "view"]
