"""The ROS package mujoco_ros2_control_msgs: wrenches, free bodies and control of a MuJoCo simulation."""

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Point, PoseStamped, TwistStamped, WrenchStamped
from mjplug_schemas.idl import boolean, sequence, string, uint32
from mjplug_schemas.message import Message, Service
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header


class ExternalWrench(Message):
    """A force and a torque on one body for a duration."""

    header: Header = Field(Header(), description="Not used.")
    wrench: WrenchStamped = Field(
        WrenchStamped(), description="The wrench in the body's frame [N, N·m]; `header.frame_id` names the body."
    )
    application_point: Point = Field(Point(), description="Application point of the force in the body frame [m].")
    duration: Duration = Field(Duration(), description="Duration in simulated time [s, ns].")
    ramp_down_duration: Duration = Field(
        Duration(), description="Duration of the linear ramp to zero at the end [s, ns]."
    )


class ExternalWrenchArray(Message):
    """Several wrenches at once."""

    external_wrenches: sequence[ExternalWrench] = Field((), description="The wrenches, each independent.")


class FreeJointState(Message):
    """Pose and velocity of one body that has a free joint."""

    name: string = Field("", description="The body.")
    pose: PoseStamped = Field(
        PoseStamped(), description="Pose in the frame of the header [m]; an empty frame is the world."
    )
    twist: TwistStamped = Field(
        TwistStamped(), description="Velocity in the frame of the header [m/s, rad/s]; an empty frame is the world."
    )


class FreeJointStateArray(Message):
    """Poses and velocities of several bodies at one time."""

    header: Header = Field(Header(), description="The time of the states.")
    free_joints: sequence[FreeJointState] = Field((), description="The states, one for each body.")


class SimulationState(Message):
    """Parts of the state of a simulation; missing parts keep their values."""

    joint_states: JointState = Field(JointState(), description="States of joints with one degree of freedom.")
    free_joints: sequence[FreeJointState] = Field((), description="States of bodies with a free joint.")


class ApplyExternalWrench(Service):
    """Applies forces and torques to bodies."""

    class Request(Message):
        """The wrenches to apply."""

        wrenches: ExternalWrenchArray = Field(ExternalWrenchArray(), description="The wrenches; all of them or none.")

    class Response(Message):
        """Whether they were applied, once the longest of them has ended."""

        success: boolean = Field(False, description="Whether all wrenches were applied.")
        message: string = Field("", description="Result as text.")


class ResetWorld(Service):
    """Resets the simulation to its initial state or to a keyframe."""

    class Request(Message):
        """The state to reset to."""

        keyframe: string = Field("", description="The keyframe; empty for the initial state.")
        state_overrides: SimulationState = Field(SimulationState(), description="Differences from that state.")

    class Response(Message):
        """Whether it was reset."""

        success: boolean = Field(False, description="Whether the simulation was reset.")
        message: string = Field("", description="Result as text.")


class SetFreeJointState(Service):
    """Sets pose and velocity of bodies with a free joint."""

    class Request(Message):
        """The states to set."""

        free_joints: sequence[FreeJointState] = Field((), description="The states, one for each body.")

    class Response(Message):
        """Whether they were set."""

        success: boolean = Field(False, description="Whether all states were set; otherwise none was.")
        message: string = Field("", description="Result as text.")


class SetPause(Service):
    """Pauses or resumes the simulation."""

    class Request(Message):
        """The state to set."""

        paused: boolean = Field(False, description="True pauses, false resumes.")

    class Response(Message):
        """Whether it was set."""

        success: boolean = Field(False, description="Whether the simulation is now as requested.")
        message: string = Field("", description="Result as text.")


class StepSimulation(Service):
    """Runs a paused simulation for a number of steps."""

    class Request(Message):
        """The number of steps."""

        steps: uint32 = Field(0, description="Number of physics steps to run.")

    class Response(Message):
        """Whether they were run."""

        success: boolean = Field(False, description="Whether all steps were run.")
        message: string = Field("", description="Result as text.")
