"""Publishes `/clock` and `~/epoch`, the number of resets and restored states."""

from mjplug.physics.loop import Loop
from mjplug.plugin import CLOCK, LATCHED, Host
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import UInt64


def offer(host: Host, loop: Loop, rate: float) -> None:
    """Publishes simulated time on `/clock` at `rate` [Hz of simulated time].

    `/clock` is also published when the first subscriber appears, after every step request, after every reset and every
    restored state, and once a second of wall time while paused, so that late subscribers get the time. `~/epoch` is
    latched and contains the number of resets and restored states since the server started.
    """

    def tick() -> None:
        if clock.matched:
            clock.publish(Clock(clock=host.now()))

    def after_reset() -> None:
        # The epoch first, because the time may have gone back.
        epoch.publish(UInt64(data=host.epoch))
        tick()

    clock = host.create_publisher(Clock, "/clock", CLOCK, on_matched=tick)
    epoch = host.create_publisher(UInt64, "~/epoch", LATCHED)
    host.create_timer(1.0 / rate, tick, while_matched=clock)
    loop.on_reset.append(after_reset)
    loop.on_stepped.append(tick)
    loop.on_idle.append(tick)
    epoch.publish(UInt64(data=host.epoch))
