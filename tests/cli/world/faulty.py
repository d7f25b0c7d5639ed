"""Plugins that go wrong, each at another moment."""

from mjplug.errors import PluginError
from mjplug.plugin import Diagnosis, Host, Level, Parameters, Plugin
from mjplug_schemas.std_srvs import Trigger


class Refuses(Plugin[Parameters]):
    """Fails in `init`."""

    def init(self, host: Host, parameters: Parameters) -> None:
        raise PluginError("the moon is not full")


class Breaks(Plugin[Parameters]):
    """Fails to start."""

    def init(self, host: Host, parameters: Parameters) -> None:
        {}["nothing"]


class Stumbles(Plugin[Parameters]):
    """Fails after a tenth of a second; has a service."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.create_timer(0.1, self.stumble)
        host.create_service(Trigger, "~/ask", lambda request, call: Trigger.Response(success=True, message="well"))

    def stumble(self) -> None:
        raise RuntimeError("tripped over a cable")


class CannotServe(Plugin[Parameters]):
    """Fails whenever it is asked, and when it is cleaned up."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.create_service(Trigger, "~/ask", self.serve)

    def serve(self, request, call):
        raise RuntimeError("no idea")

    def cleanup(self) -> None:
        raise RuntimeError("cannot let go")


class Diverges(Plugin[Parameters]):
    """Sends the first velocity to infinity after a tenth of a second."""

    def init(self, host: Host, parameters: Parameters) -> None:
        self.host = host
        self.timer = host.create_timer(0.1, self.blow_up)

    def blow_up(self) -> None:
        self.host.data.qvel[0] = float("nan")


class Unwell(Plugin[Parameters]):
    """Works, and reports an error."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.create_diagnostic("", lambda: Diagnosis(Level.ERROR, "no oil"))
