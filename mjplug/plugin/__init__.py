"""The public plugin API: everything that a plugin may use of the server."""

from mjplug.core.memory import doubles
from mjplug.core.scheduler import Event, Slow, Timer
from mjplug.diagnosis import Diagnosis, Level
from mjplug.errors import MjplugError, PluginError, RequestError, UnknownName, quoted
from mjplug.frame import CdrFrame
from mjplug.plugin.host import Host
from mjplug.plugin.plugin import Parameters, Plugin
from mjplug.transport import CLOCK, DEFAULT, LATCHED, LATEST, Call, Publisher, QoS
from mjplug.work import Job, UnavailableError, Work, Worker

__all__ = [
    "CLOCK",
    "DEFAULT",
    "LATCHED",
    "LATEST",
    "Call",
    "CdrFrame",
    "Diagnosis",
    "Event",
    "Host",
    "Job",
    "Level",
    "MjplugError",
    "Parameters",
    "Plugin",
    "PluginError",
    "Publisher",
    "QoS",
    "RequestError",
    "Slow",
    "Timer",
    "UnavailableError",
    "UnknownName",
    "Work",
    "Worker",
    "doubles",
    "quoted",
]
