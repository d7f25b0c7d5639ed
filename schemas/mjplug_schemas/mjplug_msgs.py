"""The ROS package mjplug_msgs: saved states, and steps of a simulation in one request."""

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.idl import boolean, float64, sequence, string, uint8_sequence, uint32, uint64
from mjplug_schemas.message import Message, Service


class Snapshot(Message):
    """Description of a saved state."""

    name: string = Field("", description="The name that the client gave.")
    file: boolean = Field(False, description="Whether the state is in a file; otherwise it is in the server's memory.")
    step: uint64 = Field(0, description="Number of steps that had been taken when the state was saved.")
    stamp: Time = Field(Time(), description="Simulated time when the state was saved [s, ns].")
    epoch: uint64 = Field(0, description="Number of resets and restores until the state was saved.")
    model_generation: uint64 = Field(0, description="Number of changes of the model until the state was saved.")
    model_digest: string = Field(
        "",
        description="Identifies the model and the version of MuJoCo (SHA-256, hexadecimal). Only a server with the\n"
        "same value can restore the state.",
    )
    digest: string = Field(
        "",
        description="SHA-256 of MuJoCo's state vector mjSTATE_INTEGRATION as little-endian float64, hexadecimal.",
    )
    size: uint64 = Field(0, description="Size of the saved state [bytes].")
    left_out: sequence[string] = Field((), description="Plugin instances whose state was not saved.")


class ModelValue(Message):
    """Values of one attribute of one element of the model."""

    element: string = Field("", description="Kind and name of the element, such as `geom/floor`; or `option`.")
    attribute: string = Field("", description="The attribute, as in MJCF, such as `friction`.")
    values: sequence[float64] = Field((), description="The values, in the units of MuJoCo [m, kg, s, rad].")


class ModelChanged(Message):
    """The model that the server simulates, published after each change of it."""

    generation: uint64 = Field(0, description="Number of changes of the model since the start of the server.")
    stamp: Time = Field(Time(), description="Simulated time of the change [s, ns].")
    added: sequence[string] = Field((), description="Names of the entities that this change has added.")
    removed: sequence[string] = Field((), description="Names of the entities that this change has removed.")
    model_digest: string = Field("", description="Identifies the model, as in a saved state.")


class Sample(Message):
    """A message of a topic, encoded as CDR or as JSON; the other field is empty."""

    topic: string = Field("", description="Full name of the topic.")
    type: string = Field("", description="ROS type of the message, such as geometry_msgs/msg/Twist.")
    cdr: uint8_sequence = Field(b"", description="The message in CDR, with the 4-byte header.")
    json_text: string = Field("", description="The message in JSON.")
    fresh: boolean = Field(
        False, description="Whether the message describes the state after the last step. Not used in requests."
    )


class SaveState(Service):
    """Saves the state of the simulation and of its plugins."""

    class Request(Message):
        """The name of the state."""

        name: string = Field("", description="Letters, digits and underscores; the first is no digit.")
        overwrite: boolean = Field(False, description="Whether to replace a state of the same name.")
        file: boolean = Field(False, description="Whether to write a file; otherwise the state is kept in memory.")

    class Response(Message):
        """What was saved."""

        success: boolean = Field(False, description="Whether the state was saved.")
        message: string = Field("", description="Result as text.")
        snapshot: Snapshot = Field(Snapshot(), description="The saved state.")


class RestoreState(Service):
    """Restores a saved state. The epoch grows, as after a reset."""

    class Request(Message):
        """The state to restore."""

        name: string = Field("", description="Name of the saved state.")
        file: boolean = Field(False, description="Whether the state is in a file; otherwise it is in memory.")
        strict: boolean = Field(False, description="Whether to refuse if the state of a plugin cannot be restored.")
        keep_time: boolean = Field(
            False, description="Whether simulated time continues; otherwise it is set to that of the saved state."
        )

    class Response(Message):
        """What was restored."""

        success: boolean = Field(False, description="Whether the state was restored.")
        message: string = Field("", description="Result as text.")
        snapshot: Snapshot = Field(
            Snapshot(),
            description="The restored state; `left_out` also contains plugin instances that are new, or that refused\n"
            "their part.",
        )


class ListStates(Service):
    """Lists the saved states."""

    class Request(Message):
        """Nothing."""

    class Response(Message):
        """The saved states."""

        success: boolean = Field(False, description="Whether all states could be listed.")
        message: string = Field("", description="Result as text; names files that cannot be read.")
        snapshots: sequence[Snapshot] = Field((), description="The states in memory, then those in files.")


class DeleteState(Service):
    """Deletes a saved state."""

    class Request(Message):
        """The state to delete."""

        name: string = Field("", description="Name of the saved state.")
        file: boolean = Field(False, description="Whether the state is in a file; otherwise it is in memory.")

    class Response(Message):
        """Whether it was deleted."""

        success: boolean = Field(False, description="Whether the state was deleted.")
        message: string = Field("", description="Result as text.")


class GetStateDigest(Service):
    """Returns a digest of the present state, by which clients can check that two simulations are equal."""

    class Request(Message):
        """Nothing."""

    class Response(Message):
        """The digest."""

        success: boolean = Field(False, description="Whether the digest was computed.")
        message: string = Field("", description="Result as text.")
        step: uint64 = Field(0, description="Number of steps taken.")
        stamp: Time = Field(Time(), description="Simulated time [s, ns].")
        epoch: uint64 = Field(0, description="Number of resets and restores.")
        model_digest: string = Field(
            "", description="Identifies the model and the version of MuJoCo (SHA-256, hexadecimal)."
        )
        digest: string = Field(
            "",
            description="SHA-256 of MuJoCo's state vector mjSTATE_INTEGRATION as little-endian float64, hexadecimal.",
        )


class Step(Service):
    """Takes steps of a paused simulation, with controls and messages, and returns what they led to."""

    class Request(Message):
        """Inputs, the number of steps, and the values to return. An action is one row of controls."""

        steps: uint32 = Field(1, description="Number of physics steps for each action.")
        ctrl: sequence[float64] = Field(
            (),
            description="Controls: empty to keep them; nu values for one action; k * nu values for k actions, by row.",
        )
        inputs: sequence[Sample] = Field((), description="Messages that are handled before the first step.")
        observe: sequence[string] = Field(
            (), description="Arrays of mjData to return after each action, such as qpos and sensordata."
        )
        outputs: sequence[string] = Field(
            (), description="Topics whose newest message after the last step is returned."
        )

    class Response(Message):
        """The results."""

        success: boolean = Field(False, description="Whether all steps were taken.")
        message: string = Field("", description="Result as text.")
        step: uint64 = Field(0, description="Number of steps taken since the start.")
        stamp: Time = Field(Time(), description="Simulated time [s, ns].")
        epoch: uint64 = Field(0, description="Number of resets and restores.")
        observations: sequence[float64] = Field(
            (), description="One row for each action: the arrays of `observe`, one after the other."
        )
        widths: sequence[uint32] = Field((), description="Number of values of each array of `observe`.")
        outputs: sequence[Sample] = Field((), description="The messages of the topics in `outputs`.")


class Rollout(Service):
    """Simulates several sequences of controls from one state, in copies; the simulation itself does not change."""

    class Request(Message):
        """The start and the controls. An action is one row of controls."""

        name: string = Field("", description="Saved state to start from; empty for the present state.")
        file: boolean = Field(False, description="Whether that state is in a file; otherwise it is in memory.")
        nbatch: uint32 = Field(1, description="Number of sequences.")
        steps: uint32 = Field(1, description="Number of physics steps for each action.")
        ctrl: sequence[float64] = Field(
            (),
            description="Controls: nbatch * k * nu values for sequences of k actions each, row by row.",
        )
        observe: sequence[string] = Field(
            (), description="Arrays of mjData to return after each action, such as qpos and sensordata."
        )

    class Response(Message):
        """The results."""

        success: boolean = Field(False, description="Whether all sequences were simulated.")
        message: string = Field("", description="Result as text.")
        observations: sequence[float64] = Field(
            (),
            description="One row for each action of each sequence: the arrays of `observe`, one after the other.",
        )
        widths: sequence[uint32] = Field((), description="Number of values of each array of `observe`.")


class SetModelValues(Service):
    """Changes values of the model while the simulation runs."""

    class Request(Message):
        """The values."""

        values: sequence[ModelValue] = Field((), description="The values; all of them or none.")

    class Response(Message):
        """Whether they were set."""

        success: boolean = Field(False, description="Whether all values were set; otherwise none was.")
        message: string = Field("", description="Result as text.")
