"""Maps topics, services and actions of the servers while they exist. All code here runs on the executor's thread."""

from typing import Any

import zenoh
from rclpy.clock import Clock, ClockType

from mjplug_bridge_ros2.actions import ActionRelay
from mjplug_bridge_ros2.errors import TypeRefused
from mjplug_bridge_ros2.handover import Handover
from mjplug_bridge_ros2.listing import ActionEntry, Entry, ServiceEntry, TopicEntry
from mjplug_bridge_ros2.ros_types import find_type
from mjplug_bridge_ros2.servers import Server, Watch
from mjplug_bridge_ros2.services import ServiceRelay
from mjplug_bridge_ros2.settings import Settings
from mjplug_bridge_ros2.topics import ToRos, ToServer

Relay = ToRos | ToServer | ServiceRelay | ActionRelay

_POLL_INTERVAL = 0.2
"""Interval for counting the ROS subscribers of topics [s]."""


class Mapping:
    """The relays of one server.

    Attributes:
        server: The server.
        relays: The relay of each of the server's interfaces; None if the interface is not mapped.
    """

    def __init__(self, server: Server) -> None:
        self.server = server
        self.relays: dict[Entry, Relay | None] = {}


class Bridge:
    """Maps all servers on a Zenoh network, or one of them, to topics, services and actions of one ROS node.

    Args:
        node: The ROS node.
        handover: Calls functions on the thread of the node.
        session: An open Zenoh session. The bridge does not close it.
        settings: Which interfaces to map, and how.
    """

    def __init__(self, node: Any, handover: Handover, session: zenoh.Session, settings: Settings) -> None:
        self._node = node
        self._logger = node.get_logger()
        self._handover = handover
        self._session = session
        self._settings = settings
        self._mappings: dict[str, Mapping] = {}
        self._owners: dict[tuple[str, str], Entry] = {}
        self._reported: set[str] = set()
        # Steady time, because with use_sim_time the clock of the node stops while the simulation is paused.
        self._timer = node.create_timer(_POLL_INTERVAL, self._poll, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._watch = Watch(session, handover, self._server_found, self._server_lost)

    def close(self) -> None:
        """Closes all relays."""
        self._watch.close()
        self._node.destroy_timer(self._timer)
        mappings, self._mappings = self._mappings, {}
        for mapping in mappings.values():
            self._end(mapping, "the bridge is stopping")

    def _server_found(self, name: str, zenoh_id: str) -> None:
        if self._settings.server not in ("", name):
            return
        if name in self._mappings:
            self._unmap(name, f"{name} was restarted")
        server = Server(
            self._session,
            self._handover,
            name,
            zenoh_id,
            lambda entries: self._listing_received(name, entries),
            self._logger,
        )
        self._mappings[name] = Mapping(server)
        self._logger.info(f"found {name}")

    def _server_lost(self, name: str, zenoh_id: str) -> None:
        mapping = self._mappings.get(name)
        if mapping is not None and mapping.server.zenoh_id == zenoh_id:
            self._unmap(name, f"{name} stopped or cannot be reached")
            self._logger.info(f"{name} stopped or cannot be reached; waiting for it")

    def _unmap(self, name: str, reason: str) -> None:
        self._end(self._mappings.pop(name), reason)

    def _end(self, mapping: Mapping, reason: str) -> None:
        mapping.server.close()
        self._remove(mapping, set(mapping.relays), reason)

    def _listing_received(self, name: str, entries: list[Entry]) -> None:
        mapping = self._mappings[name]
        self._remove(mapping, mapping.relays.keys() - set(entries), f"{name} no longer provides it")
        added = [entry for entry in entries if entry not in mapping.relays]
        for entry in added:
            mapping.relays[entry] = self._map(entry)
        if added:
            relays = mapping.relays.values()
            services = sum(isinstance(relay, ServiceRelay) for relay in relays)
            actions = sum(isinstance(relay, ActionRelay) for relay in relays)
            topics = len(relays) - sum(relay is None for relay in relays) - services - actions
            counts = [f"{topics} topics", f"{services} services", *([f"{actions} actions"] if actions else [])]
            self._logger.info(f"{name}: {', '.join(counts[:-1])} and {counts[-1]} are mapped")

    def _map(self, entry: Entry) -> Relay | None:
        """Returns the relay of an entry; None, with a warning in the log, if the entry cannot be mapped."""
        name = self._settings.naming.ros_name(entry.name)
        if name is None:
            return None
        owned = (_kind(entry), name)
        try:
            if owned in self._owners:
                raise TypeRefused(_clash(name, entry, self._owners[owned]))
            relay = self._relay(entry, name)
        except TypeRefused as refusal:
            self._warn(f"{name} ({entry.type}) is not mapped", str(refusal))
            return None
        except Exception as error:
            # Rclpy's exceptions, for example for an invalid QoS override, have no common base class.
            self._warn(f"{name} ({entry.type}) is not mapped", f"{type(error).__name__}: {error}")
            return None
        self._owners[owned] = entry
        return relay

    def _relay(self, entry: Entry, name: str) -> Relay:
        timeout = self._settings.service_timeout
        if isinstance(entry, ActionEntry):
            return ActionRelay(self._node, self._handover, self._session, entry, name, timeout)
        ros_type = find_type(entry.type, entry.hash)
        if isinstance(entry, ServiceEntry):
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
        self._map_freed(freed)

    def _map_freed(self, names: set[tuple[str, str]]) -> None:
        """Maps interfaces whose names were used by another interface until now."""
        for mapping in self._mappings.values():
            for entry, relay in mapping.relays.items():
                if relay is None and (_kind(entry), self._settings.naming.ros_name(entry.name)) in names:
                    mapping.relays[entry] = self._map(entry)

    def _warn(self, what: str, reason: str) -> None:
        """Logs a refusal; a reason that applies to many types is written only once."""
        self._logger.warning(f"{what}: {reason}" if reason not in self._reported else f"{what}: same reason as above")
        self._reported.add(reason)

    def _poll(self) -> None:
        for mapping in tuple(self._mappings.values()):
            mapping.server.refresh()
            for relay in mapping.relays.values():
                if relay is not None:
                    relay.poll()


def _kind(entry: Entry) -> str:
    if isinstance(entry, ActionEntry):
        return "action"
    return "service" if isinstance(entry, ServiceEntry) else "topic"


def _clash(name: str, entry: Entry, owner: Entry) -> str:
    if entry.name != owner.name:
        return f"{owner.name} already has the ROS name {name}; `remap` one of them"
    if isinstance(entry, ServiceEntry | ActionEntry) or (
        isinstance(owner, TopicEntry) and entry.published == owner.published
    ):
        return "another server uses the same name; it is mapped when that server stops"
    return "it is already mapped in the other direction, and its messages would return to their sender"
