"""One request to a service: sent, waited for, and what its answer means."""

import json
import queue
from typing import Any

import zenoh
from zenoh.handlers import Callback

from mjplug.client.errors import RequestRefused, TimedOutError
from mjplug.client.types import to_json
from mjplug.wire.discovery.announced import AT_ONCE
from mjplug.wire.discovery.format import ServiceInfo
from mjplug.wire.encoding import encoding_of
from mjplug_schemas.message import Message, Service
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, StepSimulation

MARGIN = 10.0
"""How long an answer may take beyond the simulated time that the request asks for [s]."""

_SLOWEST_STEP = 1e-3
"""Wall time that a step of a paused simulation is expected to take at most [s]."""

_REASONS = ("message", "status_message", "error_message", "reason")


def simulated_time(request: Any) -> float:
    """Returns how long in simulated time the answer to a request takes by its own terms [s]."""
    if isinstance(request, ApplyExternalWrench.Request):
        durations = (wrench.duration for wrench in request.wrenches.external_wrenches)
        return max((duration.sec + duration.nanosec / 1e9 for duration in durations), default=0.0)
    return 0.0


def default_timeout(request: Any, speed: float) -> float:
    """Returns how long to wait for the answer to a request [s].

    Args:
        request: The request.
        speed: Simulated seconds per second.
    """
    if isinstance(request, StepSimulation.Request):
        return MARGIN + request.steps * _SLOWEST_STEP
    return MARGIN + simulated_time(request) / speed


def send(session: zenoh.Session, service: ServiceInfo, request: Any, kind: type[Service] | None, timeout: float) -> Any:
    """Sends a request and waits for its answer.

    Args:
        session: The session.
        service: The service.
        request: A message of the request's class, or nested dictionaries where `kind` is None.
        kind: The service's class; None exchanges JSON.
        timeout: How long to wait [s].

    Returns:
        The response, a message or nested dictionaries.

    Raises:
        RequestRefused: The answer is an error.
        TimedOutError: There is none in time.
    """
    replies: queue.SimpleQueue[zenoh.Reply | None] = queue.SimpleQueue()
    as_json = kind is None or not isinstance(request, Message)
    session.get(
        service.key,
        Callback(replies.put, drop=lambda: replies.put(None), indirect=False),
        payload=to_json(request) if as_json else request.to_cdr(),
        encoding=zenoh.Encoding.APPLICATION_JSON if as_json else encoding_of("cdr", type(request)),
        consolidation=AT_ONCE,
        # Ours ends the wait first, with a better sentence.
        timeout=timeout + 1.0,
    )
    try:
        reply = replies.get(timeout=timeout)
    except queue.Empty:
        raise TimedOutError(f"no answer from {service.name} within {timeout:g} s") from None
    if reply is None:
        raise TimedOutError(
            f"{service.name} did not answer; its server {service.server} may have stopped, "
            "or does not let this client call it"
        )
    if reply.ok is None:
        assert reply.err is not None
        raise RequestRefused(service.name, reply.err.payload.to_string())
    return _response(reply.ok.payload.to_bytes(), None if as_json else kind)


def check(service: ServiceInfo, response: Any) -> None:
    """Raises if a response says that the request failed.

    Raises:
        RequestRefused: Its `success` is there and false.
    """
    fields = response if isinstance(response, dict) else dict(response)
    if fields.get("success") is False:
        reason = next((fields[name] for name in _REASONS if isinstance(fields.get(name), str)), "")
        raise RequestRefused(service.name, reason, response)


def _response(payload: bytes, kind: type[Service] | None) -> Any:
    if kind is None:
        return json.loads(payload)
    return kind.Response.from_cdr(payload)
