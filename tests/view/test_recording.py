"""Recordings: the file, what is written to it, and the page that plays it, in a real browser from a file URL."""

import base64
import gzip
import json
import os
import re
import signal
import struct
import subprocess
import sys
import time

import pytest
from machine import lacking
from services.view_packs import Frame
from waits import TIMEOUT

from mjplug import open_server
from mjplug.errors import MjplugError
from mjplug.view.built_page import FOLDER
from mjplug.view.recorder import Limits, record
from mjplug.view.recording import FRAME, INFO, Recording

BOX = """
<mujoco><option gravity="0 0 -.001"/><worldbody><light pos="0 0 3"/>
  <body name="box" pos="0 0 1"><freejoint/><geom type="box" size=".3 .3 .3" rgba=".9 .4 .1 1"/></body>
</worldbody></mujoco>
"""


@pytest.fixture
def page(tmp_path):
    """A folder like that of the built page, with text that would end an element."""
    folder = tmp_path / "page"
    folder.mkdir()
    for name, content in {
        "index.html": "",
        "page.js": 'const a = "</script><!--<script>";',
        "page.css": "/* </style> */",
        "licences.txt": "MIT </script>",
    }.items():
        (folder / name).write_text(content)
    return folder


def chunks(text):
    """The chunks of a file: kind, attributes, content."""
    found = []
    for attributes, content in re.findall(r'<script type="application/octet-stream"([^>]*)>([^<]*)</script>', text):
        fields = dict(re.findall(r'data-([a-z]+)="([^"]*)"', attributes))
        assert int(fields["size"]) == len(content)
        found.append((fields["mjplug"], fields, gzip.decompress(base64.b64decode(content))))
    return found


def items(content):
    at, found = 0, []
    while at < len(content):
        kind, length, when = struct.unpack_from("<IId", content, at)
        found.append((kind, when, content[at + 16 : at + 16 + length]))
        at += 16 + length + -length % 8
    return found


def test_a_recording_has_the_page_the_scene_and_all_frames(tmp_path, page):
    path = tmp_path / "out.html"
    with Recording(path, page, "/lab/<sim>", "1.2.3") as recording:
        recording.add_scene("abc", gzip.compress(b"MJV1"))
        recording.set_info(100.0, b'{"speed":1}')
        for number in range(100):
            recording.add_frame(100.0 + number / 10, b"frame %d" % number)
            if number == 50:
                recording.set_info(105.0, b'{"speed":2}')
        recording.close()
        assert recording.size == path.stat().st_size
    text = path.read_text()
    (scene, fields, pack), *rest = chunks(text)
    assert (scene, fields["hash"], pack) == ("scene", "abc", b"MJV1")
    everything = [item for _, _, content in rest for item in items(content)]
    assert [content for kind, _, content in everything if kind == FRAME] == [b"frame %d" % n for n in range(100)]
    # Each chunk begins with the information that holds.
    firsts = [items(content)[0] for _, _, content in rest]
    assert [kind for kind, _, _ in firsts] == [INFO] * len(rest)
    assert [json.loads(content)["speed"] for _, _, content in firsts] == [1, 1, 2, 2]
    assert float(rest[0][1]["from"]) == 100.0
    assert float(rest[-1][1]["to"]) == 109.9
    assert text.endswith("</html>\n")
    # The script cannot end its element, and means the same.
    assert 'const a = "<\\/script><\\!--<script>";' in text
    assert "/* <\\/style> */" in text
    assert "<title>/lab/&lt;sim&gt; - mjplug</title>" in text


def test_what_was_written_before_a_kill_is_complete(tmp_path, page):
    path = tmp_path / "out.html"
    recording = Recording(path, page, "/sim", "1")
    recording.add_scene("abc", gzip.compress(b"MJV1"))
    recording.set_info(0.0, b"{}")
    for number in range(30):
        recording.add_frame(float(number) / 10, b"x")
    written = chunks(path.read_text())
    assert [kind for kind, _, _ in written] == ["scene", "items"]
    assert float(written[1][1]["to"]) == 1.0
    recording.close()


def test_an_existing_file_and_an_incomplete_page_are_refused(tmp_path, page):
    path = tmp_path / "out.html"
    path.write_text("mine")
    with pytest.raises(MjplugError, match="already exists; remove it, or choose another name"):
        Recording(path, page, "/sim", "1")
    assert path.read_text() == "mine"
    (page / "page.css").unlink()
    with pytest.raises(MjplugError, match=r"page\.css cannot be read"):
        Recording(tmp_path / "other.html", page, "/sim", "1")
    assert not (tmp_path / "other.html").exists()
    (page / "page.css").write_text("")
    with pytest.raises(MjplugError, match="cannot write"):
        Recording(tmp_path / "missing" / "out.html", page, "/sim", "1")


@pytest.fixture
def server(tmp_path):
    scene = tmp_path / "box.xml"
    scene.write_text(BOX)
    with open_server(scene) as opened:
        yield opened


def test_a_server_is_recorded_at_the_rate_and_for_the_time_that_was_asked_for(server, tmp_path, page):
    path, reports = tmp_path / "out.html", []
    with server.client() as client:
        done = record(client, "/mjplug", path, Limits(rate=10.0, duration=3.0), reports.append, page)
    (_, fields, pack), *rest = chunks(path.read_text())
    assert pack.startswith(b"MJV1")
    everything = [item for _, _, content in rest for item in items(content)]
    infos = [json.loads(content) for kind, _, content in everything if kind == INFO]
    assert {info["scene"] for info in infos} == {fields["hash"]}
    frames = [Frame(content) for kind, _, content in everything if kind == FRAME]
    assert len(frames) == done.frames
    # At most 10 per second; a busy machine may send fewer.
    assert 2 <= len(frames) <= 33
    times = [frame.time for frame in frames]
    assert times == sorted(set(times))
    assert frames[-1].bodies[0, 2] < frames[0].bodies[0, 2]
    assert done.size == path.stat().st_size
    assert reports


@pytest.fixture
def recording(server, tmp_path):
    """The file of a command that was ended by Ctrl-C."""
    if not (FOLDER / "index.html").is_file():
        lacking("the page has not been built (make page)")
    path = tmp_path / "out.html"
    command = [sys.executable, "-m", "mjplug", "view", "--record", str(path), "-e", server.endpoint, "--wait", "60"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "COLUMNS": "200"})
    until = time.monotonic() + TIMEOUT
    while not path.exists() or sum(kind == "items" for kind, _, _ in chunks(path.read_text())) < 2:
        assert process.poll() is None
        assert time.monotonic() < until
        time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    printed, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0
    assert re.search(r"out\.html: \d+\.\d s, \d+ frames, \d+\.\d\d MB", printed)
    return path


def test_a_browser_plays_a_recording_from_the_file_and_the_user_moves_in_it(browser, recording):
    page = browser.new_page(viewport={"width": 480, "height": 360})
    page.set_default_timeout(1000 * TIMEOUT)
    requests, errors = [], []
    page.on("request", lambda request: requests.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(recording.as_uri())
    slider, clock = page.locator(".player input[type=range]"), page.locator(".player .clock")
    status = page.locator(".status .time")
    length = clock.inner_text().partition(" / ")[2]
    assert re.fullmatch(r"0:\d\d\.\d", length)
    # Plays by itself to the end.
    page.wait_for_function("document.querySelector('.player .clock').textContent.split(' / ')[0] !== '0:00.0'")
    simulated = {}
    for position in ("0", "10000", "3000"):
        slider.evaluate(
            "(element, value) => { element.dispatchEvent(new Event('pointerdown')); element.value = value;"
            " element.dispatchEvent(new Event('input')); }",
            position,
        )
        page.wait_for_timeout(1500)
        simulated[position] = float(status.inner_text().split()[0])
    assert simulated["0"] < simulated["3000"] < simulated["10000"]
    # The position stays while the user holds the slider.
    held = clock.inner_text()
    page.wait_for_timeout(500)
    assert clock.inner_text() == held
    assert errors == []
    assert requests == [recording.as_uri()]
    page.close()
