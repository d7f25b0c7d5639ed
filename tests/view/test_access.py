"""Which HTTP requests are answered, and with which headers."""

import gzip
import http.client
import socket

import pytest
import websockets
from view.page_client import Page
from websockets.exceptions import InvalidStatus

from mjplug.view.access import Access, Refusal, is_loopback, own_names


def get(relay, path="/", host=None, method="GET", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", relay.port, timeout=20)
    connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
    for name, value in {"Host": host or f"127.0.0.1:{relay.port}", **headers}.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response, body


@pytest.fixture
def relay(new_server, new_relay):
    return new_relay()


@pytest.fixture
def guarded(new_relay):
    return new_relay(token="the-token")


@pytest.mark.parametrize("path", ["/", "/index.html", "/some/prefix/", "/proxy/8080/index.html?x=1"])
def test_the_page_is_served_below_any_prefix(relay, path):
    response, body = get(relay, path)
    assert (response.status, body) == (200, b"<!doctype html><title>mjplug</title>")
    assert response.headers["Content-Type"] == "text/html; charset=utf-8"


def test_files_are_compressed_and_revalidated(relay):
    response, body = get(relay, "/page.js", Accept_Encoding="gzip, br")
    assert response.headers["Content-Encoding"] == "gzip"
    assert gzip.decompress(body) == b"// page\n" * 1000
    plain, body = get(relay, "/page.js")
    assert (plain.headers["Content-Encoding"], body) == (None, b"// page\n" * 1000)
    unchanged, body = get(relay, "/page.js", If_None_Match=plain.headers["ETag"])
    assert (unchanged.status, body) == (304, b"")
    font, body = get(relay, "/fonts/a.woff2")
    assert (font.headers["Content-Type"], body) == ("font/woff2", b"\0font")


def test_every_response_has_the_headers_that_protect_the_page(relay):
    for path in ("/", "/nothing", "/scene/x", "/socket"):
        headers = get(relay, path)[0].headers
        policy = headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'self'; ")
        assert "frame-ancestors 'none'" in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["Connection"] == "close"
        assert headers["Access-Control-Allow-Origin"] is None


@pytest.mark.parametrize(
    "path",
    [
        "/../secret.txt", "/..%2fsecret.txt", "/%2e%2e/secret.txt", "/fonts/../../secret.txt", "//secret.txt",
        "/fonts", "/fonts/", "/..", "/.", "/%00", "/page.js/", "/scene/../secret.txt", "/..%5csecret.txt",
        "/\\..\\secret.txt", "secret.txt", "?", "//", "http://127.0.0.1/../secret.txt",
    ],
)  # fmt: skip
def test_no_path_leads_out_of_the_folder(relay, path):
    response, body = get(relay, path)
    assert body != b"secret"
    assert (response.status, body) in [
        (404, b"there is no such file\n"),
        (404, b"the hash of a scene has 64 hexadecimal digits\n"),
        # A path that ends with a slash is a prefix.
        (200, b"<!doctype html><title>mjplug</title>"),
    ]


@pytest.mark.parametrize(
    "host", ["evil.com", "127.0.0.1.evil.com", "localhost.evil.com:80", "192.168.1.5", "", "[::1", "::1:::", "a b"]
)
def test_a_foreign_host_is_refused(relay, host):
    response, body = get(relay, "/", host=host or " ")
    assert response.status == 403
    assert b"use the URL that `mjplug view` has printed" in body


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:9", "127.0.0.1:80", "[::1]:8080", "127.8.8.8"])
def test_loopback_is_accepted_with_any_port_because_of_tunnels(relay, host):
    assert get(relay, "/", host=host)[0].status == 200


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.com", "https://127.0.0.1:1", "http://localhost:{port}", "null", "", "file://", "http://127.0.0.1",
        "http://127.0.0.1:{port}.evil.com", "ftp://127.0.0.1:{port}", "127.0.0.1:{port}", "http://evil@127.0.0.1:{port}",
    ],
)  # fmt: skip
def test_a_foreign_origin_is_refused_on_the_upgrade(relay, origin):
    with pytest.raises(InvalidStatus) as refused:
        Page(relay.url, origin=origin.format(port=relay.port))
    assert refused.value.response.status_code == 403
    assert relay.relay.network.feeds.keys == []


def test_the_own_origin_and_one_that_is_permitted_are_accepted(relay, new_relay):
    with Page(relay.url, origin=f"http://127.0.0.1:{relay.port}"):
        pass
    proxied = new_relay(origins=["https://sim.example.org"])
    with Page(proxied.url, origin="https://sim.example.org"):
        pass
    assert get(proxied, "/", host="sim.example.org")[0].status == 200
    with pytest.raises(InvalidStatus):
        Page(proxied.url, origin="https://sim.example.com")


def test_without_the_token_everything_is_refused(guarded):
    for path in ("/", "/page.js", "/scene/" + "0" * 64, "/socket", "/?token=", "/?token=the-toke", "/the-toke/"):
        response, body = get(guarded, path)
        assert response.status == 403, path
        assert body == b"the token is missing or wrong; open the URL that `mjplug view` has printed\n"
    for cookie in ("mjplug_view_1=the-token", f"mjplug_view_{guarded.port}=other", ";;=;", "\xff"):
        assert get(guarded, "/", Cookie=cookie)[0].status == 403
    with pytest.raises(InvalidStatus):
        Page(guarded.url)


def test_the_token_in_the_url_becomes_a_cookie(guarded):
    response, body = get(guarded, "/?token=the-token")
    assert (response.status, body, response.headers["Location"]) == (303, b"", "./")
    cookie = response.headers["Set-Cookie"]
    assert cookie == f"mjplug_view_{guarded.port}=the-token; Path=/; HttpOnly; SameSite=Strict"
    assert get(guarded, "/", Cookie=f"other=1; {cookie.partition(';')[0]}")[0].status == 200
    with Page(guarded.url, additional_headers={"Cookie": cookie.partition(";")[0]}):
        pass


def test_the_token_may_be_a_part_of_the_path_for_pages_in_frames(guarded):
    assert get(guarded, "/the-token/")[0].status == 200
    assert get(guarded, "/the-token/page.js")[0].status == 200
    with Page(f"{guarded.url}the-token/"):
        pass


def test_the_scene_is_served_once_fetched_by_its_hash(new_server, relay, new_page):
    server = new_server(pack=b"drawing pack")
    page = new_page(relay)
    if not page.hello["servers"]:
        page.text("servers")
    assert get(relay, f"/scene/{server.hash}")[1].startswith(b"no server has the scene '")
    page.do(op="watch", server=0)
    page.text("info")
    for _ in range(3):
        response, body = get(relay, f"/scene/{server.hash}")
        assert (response.status, gzip.decompress(body)) == (200, b"drawing pack")
    assert response.headers["Content-Encoding"] == "gzip"
    assert "immutable" in response.headers["Cache-Control"]
    assert server.queried["mjplug/@view/scene"] == 1


def test_a_pack_with_another_hash_is_refused(new_server, relay, new_page):
    server = new_server()
    server.pack = b"manipulated"
    page = new_page(relay)
    if not page.hello["servers"]:
        page.text("servers")
    page.do(op="watch", server=0)
    page.text("info")
    response, body = get(relay, f"/scene/{server.hash}")
    assert response.status == 404
    assert b"the server has another scene now" in body


@pytest.mark.parametrize("method", ["POST", "OPTIONS", "DELETE"])
def test_other_methods_are_refused(relay, method):
    try:
        assert get(relay, "/", method=method)[0].status == 405
    except http.client.RemoteDisconnected:
        # As websockets did before it parsed other methods.
        assert int(websockets.__version__.partition(".")[0]) < 17


def test_beyond_loopback_own_names_and_addresses_are_accepted_but_no_foreign_names():
    access = Access("0.0.0.0", 8080, "token")
    headers = _headers(Host=f"{socket.gethostname()}:8080")
    assert access.check(headers, [], "token=token") is True
    assert access.check(_headers(Host="192.168.1.5:8080"), ["token"], "") is False
    with pytest.raises(Refusal, match=r"host 'evil\.com'"):
        access.check(_headers(Host="evil.com"), ["token"], "")
    assert socket.gethostname().lower() in own_names()


def test_loopback_addresses():
    assert all(map(is_loopback, ("127.0.0.1", "localhost", "::1", "[::1]", "127.1.2.3")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "", "192.168.1.5", "localhost.evil.com")))


def _headers(**values):
    from websockets.datastructures import Headers

    return Headers(values)
