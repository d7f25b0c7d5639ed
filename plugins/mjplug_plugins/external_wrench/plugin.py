"""The external wrench plugin: service, markers, and the active wrenches at every step."""

import math
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any

from pydantic import Field

from mjplug.plugin import Call, Diagnosis, Event, Host, ModelChange, Parameters, Plugin, RequestError, Slow
from mjplug.plugin.bundled import quoted
from mjplug_plugins.external_wrench import markers
from mjplug_plugins.external_wrench.active import ActiveWrenches
from mjplug_plugins.external_wrench.saved import restored_wrenches, saved_wrenches
from mjplug_plugins.external_wrench.wrench import Wrench, parse
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench
from mjplug_schemas.mujoco_ros2_control_msgs import ExternalWrench as ExternalWrenchMsg
from mjplug_schemas.visualization_msgs import MarkerArray

MAX_WRENCHES = 1000
"""Largest number of wrenches that are active at the same time."""

MARKER_RATE = 30.0
"""Markers per second of simulated time while a wrench is active [Hz]."""

MAX_SHOWN = 50
"""Largest number of wrenches with markers; the physics thread needs about 50 µs per wrench for them."""


class ExternalWrenchParameters(Parameters):
    """Parameters of ExternalWrench."""

    force_arrow_scale: float = Field(default=0.01, ge=0, description="Arrow length per unit force [m/N].")
    torque_arrow_scale: float = Field(default=0.1, ge=0, description="Arrow length per unit torque [m/(N·m)].")


class _Waiting:
    """A request that waits for the end of its wrenches.

    Attributes:
        wrenches: Its wrenches on bodies that are in the model.
        all: The same as a set.
        last: The step at which the longest wrench ends.
        ended: Set when it has ended.
        failure: Why a wrench ended early; empty if none did.
    """

    def __init__(self, wrenches: list[Wrench]) -> None:
        self.wrenches = wrenches
        self.all = set(wrenches)
        self.last = max(wrench.end for wrench in wrenches)
        self.ended = Event()
        self.failure = ""


class ExternalWrench(Plugin[ExternalWrenchParameters]):
    """Applies external wrenches to bodies for a duration of simulated time.

    The service `~/apply_wrench` responds when the longest wrench of the request has ended, or immediately with
    `?wait=false`. The topic `~/wrench_markers` shows the active wrenches. Force, torque and application point are in
    the body frame and rotate with the body at every step. Simultaneous wrenches on a body are added.
    """

    def init(self, host: Host, parameters: ExternalWrenchParameters) -> None:
        """Creates the service and the publisher of the markers."""
        self._host = host
        self._kinematics = host.kinematics
        self._parameters = parameters
        self._active = ActiveWrenches(host.model, host.data)
        self._shown: dict[Wrench, int] = {}
        self._requests: list[_Waiting] = []
        self._next_markers = 0
        self._alarm = host.create_alarm(self._end_past)
        self._timestep = float(host.model.opt.timestep)
        self._markers = host.create_publisher(MarkerArray, "~/wrench_markers")
        host.create_service(ApplyExternalWrench, "~/apply_wrench", self._apply)
        host.create_diagnostic("", self._diagnose)

    def update(self) -> None:
        """Adds the active wrenches to `xfrc_applied`, with the poses of this step."""
        self._kinematics()
        step, active = self._host.step, self._active
        if active.looped:
            timestep = self._timestep
            for wrench in active.looped:
                wrench.apply((step - wrench.start) * timestep)
        else:
            active.apply(step)
        if step >= self._next_markers:
            self._show()

    def on_model_changed(self, change: ModelChange) -> None:
        """Lets the wrenches act on the same bodies as before; those on removed bodies end, and so do their requests."""
        new_ids, active, shown = change.maps["body"], self._active, self._shown
        moved = {wrench: wrench.on_body(self._host.data, int(new_ids[wrench.body])) for wrench, _ in active}
        kept = {new: marker_id for old, marker_id in active if (new := moved[old]) is not None}
        gone = [old for old, new in moved.items() if new is None]
        next_id = active.next_id
        self._end(gone)
        self._active = ActiveWrenches(self._host.model, self._host.data)
        self._active.replace(kept, next_id)
        self._shown = {new: number for old, number in shown.items() if (new := moved.get(old)) is not None}
        self._alarm.set(self._active.next_end)
        for request in self._requests:
            request.wrenches = [new for old in request.wrenches if (new := moved.get(old)) is not None]
            if removed := sorted({wrench.body_name for wrench in gone if wrench in request.all}):
                request.failure = f"the wrench has ended, because body {removed[0]!r} was removed"
            request.all = set(request.wrenches)
            if request.failure and not request.wrenches:
                request.ended.set()

    def on_reset(self) -> None:
        """Ends all wrenches."""
        self._end([wrench for wrench, _ in self._active])

    def save(self) -> dict[str, Any]:
        """Returns the active wrenches."""
        step = self._host.step
        saved = saved_wrenches(self._active, self._shown.keys(), step)
        return saved | {"next_id": self._active.next_id, "next_markers": self._next_markers - step}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Replaces the active wrenches. Requests that have started them were refused before."""
        wrenches, shown = restored_wrenches(self._host, saved, MAX_WRENCHES)
        next_id, next_markers = int(saved["next_id"]), self._host.step + int(saved["next_markers"])
        self.on_reset()
        self._active.replace(wrenches, next_id)
        self._shown = {wrench: wrenches[wrench] for wrench in shown}
        self._next_markers = next_markers
        self._alarm.set(self._active.next_end)

    def _apply(self, request: ApplyExternalWrench.Request, call: Call) -> Slow:
        messages = request.wrenches.external_wrenches
        if len(self._active) + len(messages) > MAX_WRENCHES:
            raise RequestError(
                f"{len(self._active)} wrenches are active and {len(messages)} more were requested; "
                f"at most {MAX_WRENCHES} can be active at the same time; nothing was applied"
            )
        wrenches = [self._parse(i, message) for i, message in enumerate(messages)]
        wait = call.parameters.get("wait", "true")
        if wait not in ("true", "false"):
            raise RequestError(f"parameter wait is {quoted(wait)}; allowed: true, false")
        if not wrenches:
            return ApplyExternalWrench.Response(
                success=True, message="the request contains no wrench; nothing was applied"
            )
        longest = max(wrench.duration for wrench in wrenches)
        count = f"{len(wrenches)} wrench{'es' if len(wrenches) > 1 else ''}"
        if wait == "false":
            call.respond(
                ApplyExternalWrench.Response(success=True, message=f"applying {count}, the longest for {longest:g} s")
            )
        self._start(wrenches)
        waiting = _Waiting(wrenches)
        self._requests.append(waiting)
        try:
            yield waiting.ended
        finally:
            self._requests.remove(waiting)
        if waiting.failure:
            raise RequestError(waiting.failure)
        return ApplyExternalWrench.Response(success=True, message=f"applied {count}, the longest for {longest:g} s")

    def _parse(self, index: int, message: ExternalWrenchMsg) -> Wrench:
        try:
            return parse(self._host, message)
        except RequestError as error:
            raise RequestError(f"external_wrenches[{index}]: {error}; nothing was applied") from None

    def _start(self, wrenches: list[Wrench]) -> None:
        self._active.add(wrenches)
        self._next_markers = self._host.step
        self._alarm.set(self._active.next_end)
        self._host.activate()

    def _diagnose(self) -> Diagnosis:
        active = len(self._active)
        return Diagnosis(message=f"{active} active" if active else "ok", values={"active wrenches": active})

    def _end_past(self) -> None:
        """Ends the wrenches whose time is over."""
        step = self._host.step
        self._end(self._active.ended(step))
        for request in [request for request in self._requests if request.last <= step]:
            request.ended.set()

    def _end(self, wrenches: Sequence[Wrench]) -> None:
        self._active.remove(wrenches)
        self._alarm.set(self._active.next_end)
        ended = [(wrench, self._shown.pop(wrench)) for wrench in wrenches if wrench in self._shown]
        if ended and self._markers.matched:
            self._markers.publish(
                MarkerArray(
                    markers=[
                        m
                        for wrench, i in ended
                        for m in markers.deletions(wrench, self._host.frame_id(wrench.body_name), i)
                    ]
                )
            )
        if not self._active:
            self._host.deactivate()

    def _show(self) -> None:
        step = self._host.step
        self._next_markers = step + math.ceil(1.0 / (MARKER_RATE * self._timestep))
        if not self._markers.matched:
            return
        self._shown = dict(islice(self._active, MAX_SHOWN))
        arrows = []
        for wrench, marker_id in self._shown.items():
            scale = wrench.scale((step - wrench.start) * self._timestep)
            force, torque = self._parameters.force_arrow_scale * scale, self._parameters.torque_arrow_scale * scale
            arrows += markers.arrows(wrench, self._host.frame_id(wrench.body_name), marker_id, force, torque)
        self._markers.publish(MarkerArray(markers=arrows))
