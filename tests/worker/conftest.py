"""Real worker processes on a real network; nothing here has a thread of its own for physics."""

import time

import mujoco
import pytest
from conftest import ARM
from waits import TIMEOUT
from wire.conftest import ANY_PORT, Client

from mjplug.contracts.transport import DEFAULT, Topic
from mjplug.contracts.work import WorkerSpec
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.session import SessionSettings
from mjplug.worker.pool import ProcessWorkerPool
from mjplug_schemas.sensor_msgs import JointState


class Ordered:
    """A worker, and what its plugin would have heard of it."""

    def __init__(self, server, work, qos, **options):
        self.inbox = server.inbox
        self.publisher = server.network.open_publisher(Topic("/told", JointState, qos))
        self.ready, self.done, self.lost = [], [], []
        self.held = False
        spec = WorkerSpec(
            "teller",
            work,
            (self.publisher,),
            on_ready=self.ready.append,
            on_done=lambda job, report: self.done.append((job, report)),
            on_lost=lambda tasks, reason: self.lost.append((set(tasks), reason)),
            block_steps=self._hold,
            **options,
        )
        self.worker = server.workers.start(spec, server.simulation, server.inbox)
        self.submit = self.worker.submit

    @property
    def status(self):
        return self.worker.status

    def wait(self, enough, within=TIMEOUT):
        """Runs posted calls, as the loop would, until there is enough."""
        until = time.monotonic() + within
        while not enough():
            assert time.monotonic() < until, f"{self.status}, {self.ready}, {self.done}, {self.lost}"
            self.inbox.wait(until - time.monotonic())

    def wait_for_ready(self, times=1):
        self.wait(lambda: len(self.ready) >= times)
        return self

    def submit_in_lockstep(self, *tasks):
        """Submits, and serves the inbox until simulated time may go on, as the loop does."""
        self.submit(tasks)
        self.wait(lambda: not self.held)

    def _hold(self, hold):
        self.held = hold

    def perform(self, *tasks):
        """Submits, and returns what comes back."""
        before = len(self.done)
        self.submit(tasks)
        self.wait(lambda: len(self.done) > before)
        return self.done[-1]


class Server:
    """What a server has of its own that worker processes need."""

    def __init__(self, name="/mjplug", ros2=None, **settings):
        settings = SessionSettings(**settings)
        self.network = open_network(settings, name, ros2=ros2)
        self.workers = ProcessWorkerPool(settings, self.network.session.endpoints)
        self.simulation = Simulation(mujoco.MjModel.from_xml_string(ARM), "bent")
        self.inbox = Inbox()

    def order(self, work, qos=DEFAULT, **options):
        return Ordered(self, work, qos, **options)

    def step(self, steps=1):
        self.simulation.checkpoint()
        assert self.simulation.advance(steps) is None

    def close(self):
        self.workers.close()
        self.network.close()


@pytest.fixture
def server():
    server = Server(ros2=RosSettings(), listen=ANY_PORT)
    yield server
    server.close()


@pytest.fixture
def guest(server):
    """A server on the network of the other one."""
    guest = Server("/guest", mode="client", connect=server.network.session.listening)
    yield guest
    guest.close()


@pytest.fixture
def client(server):
    client = Client(server.network.session.endpoint)
    yield client
    client.close()
