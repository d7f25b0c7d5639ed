"""`mjplug.open_server`: how a server ends, by itself, by a failure or with the program."""

import gc
import weakref

import pytest
from echo_plugin import Echo, fail
from scripts import run_script

from mjplug import open_server
from mjplug.errors import PluginError
from mjplug.plugin import Parameters, Plugin
from mjplug_schemas.std_srvs import Trigger


def test_a_server_with_a_duration_ends_by_itself_after_its_steps(arm):
    with open_server(arm, speed="max", duration=1.2345) as server:
        assert server.wait(timeout=60.0)
        assert not server.running
        assert server.time_ns == 618 * 2_000_000
    with open_server(arm, paused=True) as server:
        assert server.wait(timeout=0.01) is False


def test_a_failure_of_the_physics_thread_is_raised_by_wait_and_stop():
    failed = r"plugin echo failed: RuntimeError\('as told'\) \(on_plugin_error: stop\)"
    server = open_server("bundled:box", plugins={"echo": Echo})
    fail(server)
    for _ in range(2):
        with pytest.raises(PluginError, match=failed):
            server.wait(60.0)
    # It has been raised, so it is not lost.
    server.stop()

    server = open_server("bundled:box", plugins={"echo": Echo})
    fail(server)
    server._thread.join(60.0)
    with pytest.raises(PluginError, match=failed):
        server.stop()

    def fail_in_a_block(then):
        with open_server("bundled:box", plugins={"echo": Echo}) as server:
            fail(server)
            server._thread.join(60.0)
            then()

    with pytest.raises(PluginError, match=failed):
        fail_in_a_block(lambda: None)
    with pytest.raises(ZeroDivisionError) as raised:
        fail_in_a_block(lambda: 1 / 0)
    assert "the server /mjplug had failed before: PluginError" in raised.value.__notes__[0]


def test_clients_that_were_closed_are_not_kept():
    with open_server("bundled:box") as server:
        client = weakref.ref(server.client())
        client().close()
        gc.collect()
        assert client() is None


def test_a_plugin_may_stop_the_server_from_the_physics_thread():
    servers = []

    class Stopping(Plugin[Parameters]):
        def init(self, host, parameters):
            host.create_service(Trigger, "~/stop", self.stop)

        def stop(self, request, call):
            servers[0].stop()
            return Trigger.Response(success=True)

    with open_server("bundled:box", plugins={"end": Stopping}) as server:
        servers.append(server)
        assert server.client().call("/end/stop").success
        assert server.wait(60.0)


def test_a_program_that_forgets_to_stop_its_servers_still_ends(tmp_path):
    done = run_script(
        """
        from mjplug import open_server

        one = open_server("bundled:box")
        other = open_server("bundled:box", run=False)
        client = other.client()
        print(client.call("~/set_pause", paused=True).message)
        """,
        tmp_path,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "the simulation is already paused\n", "")
