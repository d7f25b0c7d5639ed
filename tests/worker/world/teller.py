"""Plugins of a configuration's folder that have work for another process."""

import os

from mjplug.plugin import Host, Parameters, Plugin, PluginError, Work
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header


class Telling(Work):
    """Publishes the positions."""

    def open(self, model, publishers, logger):
        (self.publisher,) = publishers
        return f"worker {os.getpid()}, MUJOCO_GL={os.environ.get('MUJOCO_GL')}"

    def perform(self, data, job):
        stamp = Header(stamp=Time.from_ns(job.time_ns), frame_id=str(job.epoch))
        self.publisher.publish(JointState(header=stamp, position=data.qpos.tolist()))


class TellerParameters(Parameters):
    """What the process is to find in MUJOCO_GL; nothing: what the server has."""

    backend: str | None = None


class Teller(Plugin[TellerParameters]):
    """Publishes all positions at every fifth step, in lockstep."""

    def init(self, host: Host, parameters: TellerParameters) -> None:
        backend = parameters.backend
        publisher = host.create_publisher(JointState, "~/positions")
        environment = {} if backend is None else {"MUJOCO_GL": backend}
        worker = host.create_worker(
            Telling(), [publisher], sync=True, on_ready=host.logger.info, environments=[environment]
        )
        host.create_timer(0.01, lambda: worker.submit(["positions"]))


class Quitter(Teller):
    """Refuses to start when its process has been started."""

    def init(self, host: Host, parameters: TellerParameters) -> None:
        super().init(host, parameters)
        raise PluginError("not today")
