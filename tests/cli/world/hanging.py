"""Plugins whose hooks never return, each in its own way."""

import collections
import ctypes
import itertools
import os
import signal
import sys
import threading
import time

import mujoco

from mjplug.plugin import Host, Parameters, Plugin, Work
from mjplug.wire.session import WireSession
from mjplug_schemas.std_srvs import Trigger


def deafen():
    """Leaves the signals to other threads, so that no C call of this thread is interrupted by them."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})


def announce():
    """Tells the test that the next line hangs."""
    print("hanging", file=sys.stderr, flush=True)


class Starting(Plugin[Parameters]):
    """Hangs in `init`, in C."""

    def init(self, host: Host, parameters: Parameters) -> None:
        deafen()
        announce()
        ctypes.CDLL(None).pause()


class Updating(Plugin[Parameters]):
    """Hangs in `update`, in Python."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.activate()

    def update(self):
        announce()
        while True:
            pass


class Serving(Plugin[Parameters]):
    """Has a service whose handler hangs."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.create_service(Trigger, "hang", self.serve)

    def serve(self, request, call):
        announce()
        time.sleep(1e9)


class Timing(Plugin[Parameters]):
    """Hangs in the callback of a timer, in C, without Python's lock."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.create_timer(0.01, self.fire)

    def fire(self):
        deafen()
        announce()
        ctypes.CDLL(None).pause()


class Cleaning(Plugin[Parameters]):
    """Hangs in `cleanup`."""

    def init(self, host: Host, parameters: Parameters) -> None:
        pass

    def cleanup(self):
        threading.Event().wait()


class Stepping(Plugin[Parameters]):
    """Makes `mj_step` itself never return, in C."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.create_timer(0.01, self.fire)

    def fire(self):
        deafen()
        self.pause = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(("pause", ctypes.CDLL(None)))
        mujoco.set_mjcb_control(self.pause)
        announce()


class Hogging(Plugin[Parameters]):
    """Hangs in C and keeps Python's lock: no other thread of the process runs any Python code."""

    def init(self, host: Host, parameters: Parameters) -> None:
        host.activate()

    def update(self):
        deafen()
        announce()
        collections.deque(itertools.repeat(0), maxlen=0)


class Remaining(Plugin[Parameters]):
    """Starts a thread that Python waits for at its end."""

    def init(self, host: Host, parameters: Parameters) -> None:
        threading.Thread(target=self.remain, name="remaining").start()

    def remain(self):
        announce()
        threading.Event().wait()


class Parting(Plugin[Parameters]):
    """Makes the close of the Zenoh session hang."""

    def init(self, host: Host, parameters: Parameters) -> None:
        def close(self):
            threading.Event().wait()

        WireSession.close = close


class Sleeping(Work):
    """Sleeps until its process is killed."""

    def open(self, model, publishers, logger):
        return f"worker {os.getpid()}"

    def perform(self, data, job):
        time.sleep(1e9)


class Delegating(Plugin[Parameters]):
    """Makes the end of its worker process hang."""

    def init(self, host: Host, parameters: Parameters) -> None:
        def end(self, *until):
            threading.Event().wait()

        type(host.create_worker(Sleeping(), [])).end = end


class Employing(Plugin[Parameters]):
    """Has a worker process that hangs, and hangs in `cleanup` itself."""

    def init(self, host: Host, parameters: Parameters) -> None:
        worker = host.create_worker(Sleeping(), [], on_ready=host.logger.info)
        host.create_timer(0.01, lambda: worker.submit(["sleep"]))

    def cleanup(self) -> None:
        threading.Event().wait()
