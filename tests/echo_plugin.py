"""A plugin for servers that a test opens."""

import threading

from mjplug.plugin import Parameters, Plugin
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger


class EchoParameters(Parameters):
    prefix: str = "heard "


class Echo(Plugin[EchoParameters]):
    """Publishes each received message again, and fails if the message is `fail`."""

    def init(self, host, parameters):
        self.prefix = parameters.prefix
        self.thread = threading.current_thread()
        self.publisher = host.create_publisher(String, "~/echo")
        host.create_subscription(String, "~/words", self.hear)
        host.create_service(Trigger, "~/thread", lambda request, call: self.name_thread())

    def hear(self, message):
        if message.data == "fail":
            raise RuntimeError("as told")
        self.publisher.publish(String(data=self.prefix + message.data))

    def name_thread(self):
        same = self.thread is threading.current_thread()
        return Trigger.Response(success=same, message=self.thread.name)


def fail(server):
    """Sends the message at which the plugin instance `echo` of a server fails."""
    with server.client() as client:
        client.publish("/echo/words", String(data="fail"))
