"""Finds out which interfaces a server will declare. Its access rules need them before the session is opened."""

import copy
import logging
from collections.abc import Sequence

from mjplug.config.draft import Loaded
from mjplug.contracts.transport import ServiceName
from mjplug.model.file import LoadedModel
from mjplug.physics.simulation import Simulation
from mjplug.plugin.selection import Selected
from mjplug.server.offline import OfflineTransport, OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.server.starting_pose import take_starting_pose
from mjplug.wire.access import Interfaces
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug_schemas.type_description_interfaces import GetTypeDescription


def rehearse(
    loaded: Loaded,
    model: LoadedModel,
    plugins: Sequence[Selected],
    name: str,
    ros2: RosSettings | None,
) -> Interfaces:
    """Starts every plugin on a copy of the model without a network, as `mjplug serve --check` does, and cleans it up.

    Args:
        loaded: The configuration.
        model: The model with its file; it is not changed.
        plugins: The plugins of the server.
        name: The server's full name.
        ros2: Settings of the ROS 2 interfaces; None if they are disabled.

    Raises:
        PluginError: A plugin refused to start.
    """
    transport = OfflineTransport()
    before = logging.root.manager.disable
    # The real start logs the same warnings.
    logging.disable(logging.WARNING)
    try:
        simulation = Simulation(copy.copy(model.model), loaded.settings.sim.keyframe)
        take_starting_pose(simulation, loaded)
        Server(loaded.settings, simulation, transport, plugins, OfflineWorkerPool(), model).cleanup()
    finally:
        logging.disable(before)
    services = [*transport.services]
    if ros2 is not None:
        services.append(ServiceName(f"{name}/get_type_description", GetTypeDescription))
    return Interfaces(name, transport.published, transport.subscribed, services, ros2, transport.actions)
