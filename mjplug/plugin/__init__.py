"""The public plugin API: all names that a plugin may import from the server."""

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.diagnostics import Diagnosis, Level
from mjplug.contracts.transport import CLOCK, DEFAULT, LATCHED, LATEST, Call, Publisher, QoS
from mjplug.contracts.work import Job, Priority, UnavailableError, Work, Worker, worker_diagnosis
from mjplug.errors import MjplugError, PluginError, RequestError, UnknownName
from mjplug.physics.model_change import ModelChange
from mjplug.physics.scheduler import Alarm, Event, Slow, Timer
from mjplug.physics.velocity import VelocityHold
from mjplug.plugin.action_server import ActionServer, GoalHandler, GoalRun
from mjplug.plugin.goal import Goal, GoalCanceled, Outcome
from mjplug.plugin.host import Host
from mjplug.plugin.parameters import NestedParameters, OneOrMore, Parameters
from mjplug.plugin.plugin import Plugin

__all__ = [
    "CLOCK",
    "DEFAULT",
    "LATCHED",
    "LATEST",
    "ActionServer",
    "Alarm",
    "Call",
    "CdrFrame",
    "Diagnosis",
    "Event",
    "Goal",
    "GoalCanceled",
    "GoalHandler",
    "GoalRun",
    "Host",
    "Job",
    "Level",
    "MjplugError",
    "ModelChange",
    "NestedParameters",
    "OneOrMore",
    "Outcome",
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
    "worker_diagnosis",
]
