"""One service call: sends the request, waits for the response and interprets it."""

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
"""Time that a response may take beyond the simulated time of the request [s]."""

_SLOWEST_STEP = 1e-3
"""Expected maximum wall time of a step in `step_simulation` [s]."""

_REASONS = ("message", "status_message", "error_message", "reason")


def simulated_time(request: Any) -> float:
    """Returns the simulated time that passes until the response to a request [s]."""
    if isinstance(request, ApplyExternalWrench.Request):
        durations = (wrench.duration for wrench in request.wrenches.external_wrenches)
        return max((duration.sec + duration.nanosec / 1e9 for duration in durations), default=0.0)
    return 0.0


def default_timeout(request: Any, speed: float) -> float:
    """Returns the default timeout of a request [s].

    Args:
        request: The request.
        speed: Simulated seconds per second.
    """
    if isinstance(request, StepSimulation.Request):
        return MARGIN + request.steps * _SLOWEST_STEP
    return MARGIN + simulated_time(request) / speed


def send(
    session: zenoh.Session,
    service: ServiceInfo,
    request: Any,
    kind: type[Service] | None,
    timeout: float,
    parameters: str = "",
    packed: bool = False,
) -> Any:
    """Sends a request and waits for its response.

    Args:
        session: The session.
        service: The service.
        request: A message of the request's class, or nested dictionaries if `kind` is None.
        kind: The service's class; None exchanges JSON.
        timeout: How long to wait [s].
        parameters: Parameters of the selector, such as `owner=me`.
        packed: Whether sequences of numbers in the response are memoryviews; see `Message.from_cdr`.

    Returns:
        The response, a message or nested dictionaries.

    Raises:
        RequestRefused: The response is an error.
        TimedOutError: No response arrives in time.
    """
    replies: queue.SimpleQueue[zenoh.Reply | None] = queue.SimpleQueue()
    as_json = kind is None or not isinstance(request, Message)
    session.get(
        f"{service.key}?{parameters}" if parameters else service.key,
        Callback(replies.put, drop=lambda: replies.put(None), indirect=False),
        payload=to_json(request) if as_json else request.to_cdr(),
        encoding=zenoh.Encoding.APPLICATION_JSON if as_json else encoding_of("cdr", type(request)),
        consolidation=AT_ONCE,
        # The timeout below ends the wait first, with a better message.
        timeout=timeout + 1.0,
    )
    try:
        reply = replies.get(timeout=timeout)
    except queue.Empty:
        raise TimedOutError(f"no answer from {service.name} within {timeout:g} s") from None
    if reply is None:
        raise TimedOutError(
            f"{service.name} did not answer; its server {service.server} may have stopped, "
            "or does not permit this client to call it"
        )
    if reply.ok is None:
        assert reply.err is not None
        raise RequestRefused(service.name, reply.err.payload.to_string())
    payload = reply.ok.payload.to_bytes()
    if as_json or kind is None:
        return json.loads(payload)
    return kind.Response.from_cdr(payload, packed=packed)


def check(service: ServiceInfo, response: Any) -> None:
    """Raises an error if a response reports that the request failed.

    Raises:
        RequestRefused: The response contains `success: false`.
    """
    if not isinstance(response, dict) and getattr(response, "success", True) is not False:
        return
    fields = response if isinstance(response, dict) else dict(response)
    if fields.get("success") is False:
        reason = next((fields[name] for name in _REASONS if isinstance(fields.get(name), str)), "")
        raise RequestRefused(service.name, reason, response)
