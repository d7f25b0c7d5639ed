"""`mjplug view` and `mjplug serve --view` with a real server."""

import os
import signal
import socket
import struct
import subprocess
import sys
import urllib.error
import urllib.request

import pytest
from cli.process import STARTING, Lines, Served, environment, run
from view.page_client import FRAME, SAMPLES, Page
from waits import until

from mjplug.security.folder import KeyFolder
from mjplug.view import built_page

WITHOUT = """
import sys

class Refusing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {refused}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

if {refused}:
    sys.meta_path.insert(0, Refusing())

import mjplug.view.built_page
from pathlib import Path
mjplug.view.built_page.FOLDER = Path({folder!r})
"""


class View:
    """A running `mjplug view`."""

    def __init__(self, arguments, env):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "mjplug", "view", "--no-open", *arguments],
            env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.out, self.err = Lines(self.process.stdout), Lines(self.process.stderr)

    @property
    def url(self):
        found = self.out.wait_for(r"ready · (\S+)", STARTING)
        assert found, self.err.text
        return found[1]

    def end(self, number=None):
        if number is not None:
            self.process.send_signal(number)
        code = self.process.wait(20)
        return code, self.out.wait_for_end(), self.err.wait_for_end()

    def kill(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


@pytest.fixture
def cli(tmp_path):
    return lambda *words: run(*words, cwd=tmp_path)


@pytest.fixture
def new_environment(built, tmp_path):
    """Returns the environment of a process that uses the built page of the test, and lacks some modules."""

    def make(refused=(), folder=built):
        start = tmp_path / f"start{len(list(tmp_path.iterdir()))}"
        start.mkdir()
        (start / "sitecustomize.py").write_text(WITHOUT.format(refused=set(refused) or "()", folder=str(folder)))
        return environment({"PYTHONPATH": str(start)})

    return make


@pytest.fixture
def new_view(new_environment, opened):
    def start(*arguments, **options):
        return opened(View([*arguments, "--port", "0"], new_environment(**options)), "kill")

    return start


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    server = Served("bundled:box", cwd=tmp_path_factory.mktemp("view"))
    yield server
    assert server.stop() == 0
    assert "Traceback" not in server.err.text


def ready_page(url):
    page = Page(url)
    if not page.hello["servers"]:
        page.text("servers", lambda text: text["servers"])
    return page


def test_a_view_without_mujoco_numpy_and_opencv_shows_and_controls_a_server(served, new_view):
    view = new_view("--connect", served.endpoint, refused=("mujoco", "numpy", "cv2", "pydantic_settings"))
    with ready_page(view.url) as page:
        page.do(op="watch", server=0)
        info = page.text("info")["info"]
        assert info["bodies"] == ["world", "box"]
        with urllib.request.urlopen(f"{view.url}scene/{info['scene']}") as response:
            assert len(response.read()) == info["scene_bytes"]
        before = page.item(FRAME)
        later = page.item(FRAME, lambda item: item.payload[:8] != before.payload[:8])
        assert len(later.payload) == len(before.payload)
        assert page.do(op="call", service="~/set_pause", request={"paused": True})["success"] is True
        assert page.text("info", lambda text: text["info"]["paused"])
        # A paused body is placed at once: the frame has its height after header and x, y.
        for _ in range(3):
            page.do(op="drag", server=0, body=1, target=[0, 0, 3])
        page.item(FRAME, lambda item: _height(item.payload) == pytest.approx(3.0, abs=1e-6))
        page.do(op="drag", server=0, release=True)
        assert page.refused(op="subscribe", topic="/clock", mode="image").startswith("the topic is rosgraph_msgs")
        assert page.do(op="call", service="~/set_pause", request={"paused": False})["success"] is True
    code, out, err = view.end(signal.SIGINT)
    assert (code, err) == (0, "")
    assert out.startswith("ready · http://127.0.0.1:")


def _height(frame):
    return struct.unpack_from("<fff", frame, struct.calcsize("<ddIIHHHHI"))[2]


@pytest.mark.slow
def test_a_view_waits_for_a_server_and_says_so(new_view, opened, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as reserved:
        port = reserved.getsockname()[1]
    endpoint = f"tcp/127.0.0.1:{port}"
    view = new_view("--connect", endpoint)
    with Page(view.url) as page:
        assert page.hello["servers"] == []
        assert page.refused(op="topics") == "no server has been found yet"
        assert view.err.wait_for(f"waiting for a server: connection refused by {endpoint}", STARTING)
        opened(Served("bundled:box", cwd=tmp_path, listen=("--listen", endpoint)), "kill")
        page.text("servers", lambda text: text["servers"])
        assert page.do(op="call", service="~/set_pause", request={"paused": True})["success"] is True
    code, _, err = view.end(signal.SIGTERM)
    assert code == 0
    assert err.count("\n") == 1


def test_a_server_that_is_not_there_is_named(served, new_view):
    view = new_view("--connect", served.endpoint, "--node", "robot9/sim")
    with Page(view.url) as page:
        sentence = r"waiting for a server: /robot9/sim is not on the network; there are: /mjplug"
        assert view.err.wait_for(sentence, STARTING)
        assert page.hello["servers"] == []
        assert page.nothing()


def test_an_origin_that_is_none_is_a_usage_error(cli):
    done = cli("view", "--origin", "example.org")
    assert done.returncode == 2
    assert "'example.org' is not an origin; write it as https://example.org" in done.stderr


def test_an_installation_without_the_page_is_told_to_build_it_first_and_to_install_again(tmp_path):
    assert "make page" in (text := built_page.what_to_do(tmp_path))
    assert text.endswith("install it from there again: pip install '.[view]'")
    (tmp_path / "page").mkdir()
    (tmp_path / "page" / "package.json").touch()
    assert built_page.what_to_do(tmp_path) == f"the page has not been built; run `make page` in {tmp_path}"


def test_a_view_that_may_not_wait_longer_ends_with_the_exit_code_of_the_network(new_view):
    code, _, err = new_view("--connect", "tcp/127.0.0.1:1", "--wait", "0").end()
    assert code == 5
    assert err.startswith("error: connection refused by tcp/127.0.0.1:1")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"refused": ["websockets"]}, "websockets 14 or later. Install it with: pip install 'mjplug[view]'"),
        ({"folder": "/nowhere"}, "the page has not been built; run `make page`"),
    ],
)
def test_what_is_missing_is_named(new_view, options, sentence):
    code, out, err = new_view("--connect", "tcp/127.0.0.1:1", **options).end()
    assert (code, out) == (1, "")
    assert sentence in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_a_port_in_use_gives_way_to_the_next_one(new_environment, opened):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        view = opened(View(["--connect", "tcp/127.0.0.1:1", "--port", str(port)], new_environment()), "kill")
        assert not view.url.endswith(f":{port}/")
        assert view.err.wait_for(f"port {port} is in use, so the page is at port [0-9]+", STARTING)


def test_beyond_loopback_the_url_has_a_token(new_view):
    view = new_view("--connect", "tcp/127.0.0.1:1", "--listen", "0.0.0.0")
    address, _, token = view.url.partition("?token=")
    assert len(token) == 32
    port = address.rpartition(":")[2].strip("/")
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(f"http://127.0.0.1:{port}/")
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    with opener.open(f"http://127.0.0.1:{port}/?token={token}") as response:
        assert response.url == f"http://127.0.0.1:{port}/"
        assert response.read() == b"<!doctype html><title>mjplug</title>"


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_the_view_of_a_server_is_a_child_process_that_ends_with_it(new_environment, opened, tmp_path, number):
    server = opened(Served("bundled:box", "--view", "0", cwd=tmp_path, env=new_environment()), "kill")
    url = server.out.wait_for(r"view · (\S+)", STARTING)[1]
    with ready_page(url) as page:
        assert [each["name"] for each in page.hello["servers"] or ()] in ([], ["/mjplug"])
        children = _views(server.process.pid)
        assert len(children) == 1
    server.process.send_signal(number)
    server.process.wait(20)
    until(lambda: not any(os.path.exists(f"/proc/{pid}") and _is_view(pid) for pid in children))


def test_a_server_with_a_view_needs_the_page(new_environment, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "mjplug", "serve", "bundled:box", "--view"],
        env=new_environment(folder="/nowhere"), cwd=tmp_path,
        capture_output=True, text=True, timeout=STARTING, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (1, "")
    assert "the page has not been built" in done.stderr


@pytest.mark.slow
def test_a_server_with_roles_has_no_view_of_its_own(new_environment, tmp_path):
    folder = KeyFolder.create(tmp_path / "keys", ["localhost"])
    done = run(
        "serve", "bundled:box", "--view", "0", "--listen", "tls/localhost:0",
        "--zenoh-config", str(folder.path / "server" / "server.json5"), cwd=tmp_path, env=new_environment(),
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (1, "")
    assert "--view cannot be used with roles, because every browser on this machine would have the" in done.stderr


def _views(parent):
    with open(f"/proc/{parent}/task/{parent}/children") as file:
        return [int(pid) for pid in file.read().split() if _is_view(int(pid))]


def _is_view(pid):
    try:
        with open(f"/proc/{pid}/cmdline", "rb") as file:
            return b"mjplug.view" in file.read().split(b"\0")
    except OSError:
        return False


def test_the_words_after_view_are_its_port_or_the_model():
    from typer.main import get_command

    from mjplug.cli.app import app

    command = get_command(app).commands["serve"]
    for words, view, config in (
        (["--view", "8081", "m.xml"], 8081, "m.xml"),
        (["--view", "m.xml"], 8080, "m.xml"),
        (["m.xml", "--view"], 8080, "m.xml"),
        (["m.xml", "--view=9"], 9, "m.xml"),
        (["m.xml"], None, "m.xml"),
        (["--", "--view"], None, "--view"),
    ):
        context = command.make_context("serve", list(words))
        assert (context.params["view"], context.params["config"]) == (view, config)


@pytest.mark.slow
def test_a_server_that_is_killed_and_replaced_by_another_model_returns_on_the_page(new_view, opened, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as reserved:
        port = reserved.getsockname()[1]
    listen = ("--listen", f"tcp/127.0.0.1:{port}")
    server = opened(Served("bundled:box", cwd=tmp_path, listen=listen), "kill")
    view = new_view("--connect", server.endpoint)
    with ready_page(view.url) as page:
        page.do(op="watch", server=0)
        page.do(op="subscribe", topic="/clock", mode="newest")
        first = page.text("info")["info"]
        page.item(FRAME)
        server.kill()
        page.text("servers", lambda text: not text["servers"][0]["connected"])
        opened(Served("bundled:arm", cwd=tmp_path, listen=listen), "kill")
        assert page.text("servers")["servers"] == [{"id": 0, "name": "/mjplug", "connected": True}]
        second = page.text("info")["info"]
        assert second["scene"] != first["scene"]
        frame = page.item(FRAME, lambda item: len(item.payload) > 100)
        assert struct.unpack_from("<ddIIH", frame.payload)[0] < 60.0
        page.items.clear()
        # Subscriptions survive too.
        page.item(SAMPLES)
        with urllib.request.urlopen(f"{view.url}scene/{second['scene']}") as response:
            assert len(response.read()) == second["scene_bytes"]
