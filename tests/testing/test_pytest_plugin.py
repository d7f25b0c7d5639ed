"""The pytest plugin `mjplug`, in pytest processes of their own."""

import subprocess
import sys
import textwrap

import pytest
from cli.process import environment

from mjplug.cli.plugin_new import write


@pytest.fixture
def run_pytest(tmp_path):
    def run(test, *options):
        (tmp_path / "test_it.py").write_text(textwrap.dedent(test))
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", "/dev/null", f"--rootdir={tmp_path}"]
            + [*options, str(tmp_path)],
            capture_output=True, text=True, timeout=120.0, check=False, cwd=tmp_path,
            env=environment({"MJPLUG_SIM__SPED": "2"}),
        )  # fmt: skip

    return run


USING = """
    import pytest
    from mjplug.plugin import Parameters, Plugin
    from mjplug_schemas.std_msgs import String

    class Failing(Plugin[Parameters]):
        def init(self, host, parameters):
            host.create_subscription(String, "/words", self.fail)

        def fail(self, message):
            raise RuntimeError("as told")

    servers = []

    def test_a_stepped_server(mjplug_server):
        server = mjplug_server("bundled:box", run=False)
        other = mjplug_server("bundled:arm")
        servers.extend([server, other])
        server.step(100)
        assert server.time_ns == 200_000_000
        assert other.client().call("~/set_pause", paused=True).success

    def test_they_have_been_stopped():
        assert not any(server.running for server in servers)

    def test_a_server_that_fails_lets_its_test_fail(mjplug_server):
        server = mjplug_server("bundled:box", plugins={"fail": Failing})
        server.client().publish("/words", String())
        server._thread.join(60.0)
"""


def test_the_fixture_opens_servers_and_stops_them_after_the_test(run_pytest):
    done = run_pytest(USING)
    assert "3 passed, 1 error" in done.stdout, done.stdout
    assert "plugin fail failed: RuntimeError('as told')" in done.stdout
    assert "ERROR test_it.py::test_a_server_that_fails_lets_its_test_fail" in done.stdout


def test_the_test_that_plugin_new_writes_passes(tmp_path, run_pytest):
    folder = write("street_lamp", tmp_path)
    done = run_pytest("", "-o", f"pythonpath={folder / 'src'}", "-W", "error", str(folder))
    assert "2 passed" in done.stdout, done.stdout


def test_without_a_test_that_uses_it_the_plugin_imports_nothing_heavy(run_pytest):
    test = """
        import sys

        def test_what_is_loaded():
            loaded = {name for name in sys.modules if name.partition(".")[0] in ("mjplug", "mujoco", "numpy", "zenoh")}
            assert loaded == {"mjplug", "mjplug.testing", "mjplug.testing.pytest_plugin"}
    """
    done = run_pytest(test)
    assert "1 passed" in done.stdout, done.stdout


def test_the_plugin_can_be_switched_off_and_its_fixture_taken_from_the_module(run_pytest):
    test = """
        def test_it(mjplug_server):
            assert mjplug_server("bundled:box", run=False).time_ns == 0
    """
    assert "fixture 'mjplug_server' not found" in run_pytest(test, "-p", "no:mjplug").stdout
    named = run_pytest(test, "-p", "no:mjplug", "-p", "mjplug.testing.pytest_plugin")
    assert "1 passed" in named.stdout, named.stdout
