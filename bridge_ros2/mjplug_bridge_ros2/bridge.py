"""Maps what the servers offer, for as long as they do. Everything here runs on the executor's thread."""

from typing import Any

import zenoh
from rclpy.clock import Clock, ClockType

from mjplug_bridge_ros2.errors import TypeRefused
from mjplug_bridge_ros2.handover import Handover
from mjplug_bridge_ros2.listing import Entry, ServiceEntry, TopicEntry
from mjplug_bridge_ros2.ros_types import find_type
from mjplug_bridge_ros2.servers import Server, Watch
from mjplug_bridge_ros2.services import ServiceRelay
from mjplug_bridge_ros2.settings import Settings
from mjplug_bridge_ros2.topics import ToRos, ToServer

Relay = ToRos | ToServer | ServiceRelay

_POLL = 0.2
"""How often to count the readers of topics [s]."""


class Mapping:
    """The relays of one server.

    Attributes:
        server: The server.
        relays: A relay for each entry of its list; None where there is none.
    """

    def __init__(self, server: Server) -> None:
        self.server = server
        self.relays: dict[Entry, Relay | None] = {}


class Bridge:
    """All servers on a Zenoh network, or one of them, as topics and services of one ROS node.

    Args:
        node: The node.
        handover: The way to the thread of the node.
        session: An open session. The bridge does not close it.
        settings: What to map, and how.
    """

    def __init__(self, node: Any, handover: Handover, session: zenoh.Session, settings: Settings) -> None:
        self._node = node
        self._logger = node.get_logger()
        self._handover = handover
        self._session = session
        self._settings = settings
        self._mappings: dict[str, Mapping] = {}
        self._owners: dict[tuple[str, str], Entry] = {}
        self._told: set[str] = set()
        # Steady time: the node's own clock would stand still with the simulation, were it given use_sim_time.
        self._timer = node.create_timer(_POLL, self._poll, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._watch = Watch(session, handover, self._appeared, self._vanished)

    def close(self) -> None:
        """Takes everything back."""
        self._watch.close()
        self._node.destroy_timer(self._timer)
        mappings, self._mappings = self._mappings, {}
        for mapping in mappings.values():
            self._end(mapping, "the bridge is stopping")

    def _appeared(self, name: str, zenoh_id: str) -> None:
        if self._settings.server not in ("", name):
            return
        if name in self._mappings:
            self._unmap(name, f"{name} was started again")
        server = Server(
            self._session, self._handover, name, zenoh_id, lambda entries: self._listed(name, entries), self._logger
        )
        self._mappings[name] = Mapping(server)
        self._logger.info(f"{name} is there")

    def _vanished(self, name: str, zenoh_id: str) -> None:
        mapping = self._mappings.get(name)
        if mapping is not None and mapping.server.zenoh_id == zenoh_id:
            self._unmap(name, f"{name} is gone")
            self._logger.info(f"{name} is gone, waiting for it to come back")

    def _unmap(self, name: str, reason: str) -> None:
        self._end(self._mappings.pop(name), reason)

    def _end(self, mapping: Mapping, reason: str) -> None:
        mapping.server.close()
        self._remove(mapping, set(mapping.relays), reason)

    def _listed(self, name: str, entries: list[Entry]) -> None:
        mapping = self._mappings[name]
        self._remove(mapping, mapping.relays.keys() - set(entries), f"{name} does not offer it any more")
        added = [entry for entry in entries if entry not in mapping.relays]
        for entry in added:
            mapping.relays[entry] = self._map(entry)
        if added:
            relays = mapping.relays.values()
            services = sum(isinstance(relay, ServiceRelay) for relay in relays)
            mapped = len(relays) - sum(relay is None for relay in relays)
            self._logger.info(f"{name}: {mapped - services} topics and {services} services are mapped")

    def _map(self, entry: Entry) -> Relay | None:
        """Returns the relay of an entry; None, with a word in the log, if there can be none."""
        name = self._settings.naming.ros_name(entry.name)
        if name is None:
            return None
        owned = (_kind(entry), name)
        try:
            if owned in self._owners:
                raise TypeRefused(_clash(name, entry, self._owners[owned]))
            relay = self._relay(entry, name, find_type(entry.type, entry.hash))
        except TypeRefused as refusal:
            self._tell(f"{name} ({entry.type}) is not mapped", str(refusal))
            return None
        except Exception as error:
            # Rclpy's exceptions, for instance for a bad override of the quality of service, have no common base.
            self._tell(f"{name} ({entry.type}) is not mapped", f"{type(error).__name__}: {error}")
            return None
        self._owners[owned] = entry
        return relay

    def _relay(self, entry: Entry, name: str, ros_type: Any) -> Relay:
        if isinstance(entry, ServiceEntry):
            timeout = self._settings.service_timeout
            return ServiceRelay(self._node, self._handover, self._session, entry, name, ros_type, timeout)
        direction = ToRos if entry.published else ToServer
        return direction(self._node, self._session, entry, name, ros_type)

    def _remove(self, mapping: Mapping, entries: set[Entry], reason: str) -> None:
        freed: set[tuple[str, str]] = set()
        for entry in entries:
            relay = mapping.relays.pop(entry)
            if relay is not None:
                relay.close(reason)
                freed |= {name for name, owner in self._owners.items() if owner == entry}
        for name in freed:
            del self._owners[name]
        self._map_to(freed)

    def _map_to(self, names: set[tuple[str, str]]) -> None:
        """Maps what other servers, or the same one, have for names that were taken."""
        for mapping in self._mappings.values():
            for entry, relay in mapping.relays.items():
                if relay is None and (_kind(entry), self._settings.naming.ros_name(entry.name)) in names:
                    mapping.relays[entry] = self._map(entry)

    def _tell(self, what: str, why: str) -> None:
        """Logs a refusal; the reason, which may go for a whole package, only once."""
        self._logger.warning(f"{what}: {why}" if why not in self._told else f"{what}, for a reason given before")
        self._told.add(why)

    def _poll(self) -> None:
        for mapping in tuple(self._mappings.values()):
            mapping.server.refresh()
            for relay in mapping.relays.values():
                if relay is not None:
                    relay.poll()


def _kind(entry: Entry) -> str:
    return "service" if isinstance(entry, ServiceEntry) else "topic"


def _clash(name: str, entry: Entry, owner: Entry) -> str:
    if entry.name != owner.name:
        return f"{owner.name} has the name {name} here already; `remap` one of them"
    if isinstance(entry, ServiceEntry) or (isinstance(owner, TopicEntry) and entry.published == owner.published):
        return "that of another server has the name, and keeps it for as long as it is there"
    return "it is mapped already, and what is published there would come back to where it is from"
