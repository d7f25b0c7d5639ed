"""The public plugin API: everything that a plugin may use of the server."""

from mjplug.core.actuator_law import ActuatorLaw, Drives, actuator_law
from mjplug.core.lidar_extension import LidarSensor, lidar_sensors
from mjplug.core.memory import doubles
from mjplug.core.scheduler import Event, Slow, Timer
from mjplug.core.velocity import VelocityHold
from mjplug.diagnosis import Diagnosis, Level
from mjplug.errors import MjplugError, PluginError, RequestError, UnknownName, quoted
from mjplug.frame import CdrFrame
from mjplug.plugin.host import Host
from mjplug.plugin.model_names import object_names, ros_tokens
from mjplug.plugin.plugin import SECTION, Parameters, Plugin
from mjplug.transport import CLOCK, DEFAULT, LATCHED, LATEST, Call, Publisher, QoS
from mjplug.work import Job, Priority, UnavailableError, Work, Worker, worker_diagnosis

__all__ = [
    "CLOCK",
    "DEFAULT",
    "LATCHED",
    "LATEST",
    "SECTION",
    "ActuatorLaw",
    "Call",
    "CdrFrame",
    "Diagnosis",
    "Drives",
    "Event",
    "Host",
    "Job",
    "Level",
    "LidarSensor",
    "MjplugError",
    "Parameters",
    "Plugin",
    "PluginError",
    "Priority",
    "Publisher",
    "QoS",
    "RequestError",
    "Slow",
    "Timer",
    "UnavailableError",
    "UnknownName",
    "VelocityHold",
    "Work",
    "Worker",
    "actuator_law",
    "doubles",
    "lidar_sensors",
    "object_names",
    "quoted",
    "ros_tokens",
    "worker_diagnosis",
]
