"""Sets the initial state of the simulation from the configuration."""

import logging

from mjplug.config.draft import Loaded
from mjplug.config.problem import ConfigError
from mjplug.errors import ModelError, RequestError
from mjplug.physics import initial_state
from mjplug.physics.simulation import Simulation

_FILE = ("sim", "start_position_file")

_log = logging.getLogger(__name__)


def take_starting_pose(simulation: Simulation, loaded: Loaded, keyframe: str = "") -> None:
    """Sets the initial state that the configuration describes.

    A start-position file replaces the keyframe, and a keyframe replaces the model's default pose. Positions by joint
    are then applied to the result. The controls are those of the file or the keyframe; without them, position actuators
    hold the pose.

    Args:
        simulation: The simulation, in the state of its keyframe and without a step. A reset restores the new state.
        loaded: The configuration.
        keyframe: The keyframe of the simulation, if the model has chosen it instead of the configuration.

    Raises:
        ConfigError: Settings do not fit the model; the text contains every problem with its place.
    """
    sim = loaded.settings.sim
    problems = []
    controlled = bool(sim.keyframe or keyframe)
    if (file := loaded.path(_FILE)) is not None:
        try:
            vectors = initial_state.read_start_positions(simulation, file)
        except ModelError as error:
            problems.append(loaded.problem(_FILE, str(error)))
        else:
            initial_state.start_from(simulation, vectors)
            controlled = "ctrl" in vectors
        if sim.keyframe:
            _log.warning("the start-position file replaces keyframe %r", sim.keyframe)
    for joint, position in sim.initial_positions.items():
        try:
            initial_state.check_position(simulation, joint, position)
        except RequestError as error:
            problems.append(loaded.problem(("sim", "initial_positions", joint), str(error)))
    if problems:
        raise ConfigError(problems)
    initial_state.place_joints(simulation, sim.initial_positions)
    if sim.hold_initial_pose and (sim.initial_positions or not controlled):
        held = initial_state.hold_pose(simulation, sim.initial_positions if controlled else None)
        if held:
            _log.info("%d position actuators start with the initial pose as their target", held)
    simulation.keep_as_initial()
