"""The view in a Jupyter notebook, whose cells run in a kernel of their own."""

import asyncio
import functools
import http.server
import re
import threading
import urllib.error
import urllib.request

import nbformat
import pytest
from cli.process import STARTING, Served
from nbclient import NotebookClient
from view.page_client import FRAME, Page

START = """
import mjplug.view.built_page
from pathlib import Path

mjplug.view.built_page.FOLDER = Path({folder!r})
"""

SHOW = """
from mjplug.client import connect
from mjplug.view import view

client = connect({endpoint!r})
shown = view(client)
shown
"""

BUSY = "sum(range(30_000_000))"

END = "shown.close(); shown.close(); print(sorted(client.servers())); client.close()"


@pytest.fixture
def kernel(tmp_path, built):
    """Runs the cells of a notebook, and returns their outputs."""
    loop = asyncio.new_event_loop()
    asyncio.set_event_loop(loop)
    notebook = nbformat.v4.new_notebook()
    client = NotebookClient(
        notebook, timeout=STARTING, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    )

    def run(source):
        cell = nbformat.v4.new_code_cell(source)
        notebook.cells.append(cell)
        client.execute_cell(cell, len(notebook.cells) - 1)
        return cell.outputs

    with client.setup_kernel():
        run(START.format(folder=str(built)))
        yield run
    loop.close()


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_a_cell_shows_the_simulation_in_a_frame(kernel, opened, tmp_path):
    server = opened(Served("bundled:box", cwd=tmp_path), "kill")
    (output,) = kernel(SHOW.format(endpoint=server.endpoint))
    html = output["data"]["text/html"]
    url = re.search(r'<iframe src="(http://127\.0\.0\.1:[0-9]+/[A-Za-z0-9_-]{32}/)"', html)[1]
    with urllib.request.urlopen(url) as response:
        assert response.read() == b"<!doctype html><title>mjplug</title>"
        assert response.headers["Content-Security-Policy"].endswith("frame-ancestors *")
    # Without the secret in the address, nothing is shown.
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(url.rpartition("/")[0].rpartition("/")[0])
    with Page(url) as page:
        if not page.hello["servers"]:
            page.text("servers")
        page.do(op="watch", server=0)
        info = page.text("info")["info"]
        first = page.item(FRAME)
        with urllib.request.urlopen(f"{url}scene/{info['scene']}") as response:
            assert len(response.read()) == info["scene_bytes"]
        # The page goes on while the kernel computes.
        kernel(BUSY)
        page.item(FRAME, lambda item: item.batch > first.batch + 5)
    (printed,) = kernel(END)
    assert printed["text"] == "['/mjplug']\n"
    with pytest.raises(urllib.error.URLError, match="refused"):
        urllib.request.urlopen(url)


def test_a_view_can_be_closed_after_its_client(router, new_server, opened, built, monkeypatch):
    from mjplug.client import connect
    from mjplug.view import built_page, view

    monkeypatch.setattr(built_page, "FOLDER", built)
    server = new_server(subscribed={"/cmd_vel": "geometry_msgs/msg/Twist"})
    client = opened(connect(router))
    shown = view(client)
    with Page(shown.url) as page:
        if not page.hello["servers"]:
            page.text("servers")
        page.do(op="watch", server=0)
        page.do(op="subscribe", topic="/cmd_vel", mode="all")
        server.matched("mjplug/@view/frame")
        client.close()
    shown.close()
    with pytest.raises(urllib.error.URLError, match="refused"):
        urllib.request.urlopen(shown.url)


def test_the_html_contains_the_address_escaped():
    from mjplug.view.notebook import InlineView

    html = InlineView('http://h/"><script>', 300, None)._repr_html_()
    assert "<script>" not in html
    assert 'height="300"' in html


@pytest.mark.slow
def test_the_page_draws_in_a_frame_of_a_notebook_from_another_site(browser, opened, tmp_path):
    from mjplug.client import connect
    from mjplug.view import view

    server = opened(Served("bundled:box", cwd=tmp_path), "kill")
    shown = opened(view(opened(connect(server.endpoint))))
    (tmp_path / "notebook.html").write_text(f"<!doctype html>{shown._repr_html_()}")
    files = functools.partial(Quiet, directory=str(tmp_path))
    notebooks = opened(http.server.ThreadingHTTPServer(("127.0.0.1", 0), files), "server_close")
    threading.Thread(target=notebooks.serve_forever, daemon=True).start()
    page = browser.new_page()
    try:
        # For a browser, `localhost` and `127.0.0.1` are different sites.
        page.goto(f"http://localhost:{notebooks.server_port}/notebook.html")
        frame = page.wait_for_selector("iframe").content_frame()
        assert frame.url == shown.url
        frame.wait_for_function("() => window.mjplug?.app.stage.worlds.size >= 1", timeout=60_000)
    finally:
        page.close()
        notebooks.shutdown()


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass
