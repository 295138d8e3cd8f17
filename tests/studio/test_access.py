"""Who may reach the studio: the token, the cookie that follows it, and requests of the studio's own pages only."""

import asyncio
import base64
import contextlib
import http.client
import os
import socket

import pytest

from rso_lidar.studio.access import AccessControl

TOKEN = "a-token-of-the-tests"
PROTECTED = (
    "/",
    "/?token=",
    "/?token=wrong",
    "/no_such_page",
    "/_nicegui/x",
    "/docs",
    "/openapi.json",
    "/../../etc/passwd",
)


def ask(studio, path, **headers):
    """Return status, headers and body of a request."""
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", studio.port, timeout=30)) as connection:
        connection.request("GET", path, headers=headers)
        with connection.getresponse() as response:
            return response.status, response.headers, response.read().decode("utf-8", "replace")


def shake_hands(studio, **headers):
    """Return the status of the handshake of a web socket, as a browser asks for it."""
    given = {
        "Host": f"127.0.0.1:{studio.port}",
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(),
        "Sec-WebSocket-Version": "13",
        **headers,
    }
    asked = "GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1\r\n"
    asked += "".join(f"{name}: {value}\r\n" for name, value in given.items()) + "\r\n"
    with socket.create_connection(("127.0.0.1", studio.port), timeout=30) as connection:
        connection.sendall(asked.encode())
        return int(connection.recv(4096).split()[1])


@pytest.mark.parametrize("path", PROTECTED)
def test_nothing_answers_without_the_token(studio, path):
    status, headers, body = ask(studio, path)
    assert status == 403
    assert "address that `rso-lidar studio` prints" in body
    assert "set-cookie" not in headers


def test_the_token_becomes_a_cookie_that_scripts_and_other_sites_cannot_use(studio):
    status, headers, _ = ask(studio, f"/?token={studio.token}")
    assert (status, headers["location"]) == (303, "/")
    assert headers["set-cookie"] == f"{studio.cookie}; Path=/; HttpOnly; SameSite=Strict"
    status, _, body = ask(studio, "/", Cookie=studio.cookie)
    assert status == 200 and "<title>" in body
    assert studio.token not in body


def test_the_token_cannot_redirect_to_another_host_or_write_headers(studio):
    """A link such as ``//elsewhere/?token=...`` leads into the studio, and so does one with a line break in its path."""
    for path in (
        "//elsewhere.example/",
        "/%0d%0aset-cookie:%20a=b",
        "/%5Celsewhere.example",
        "/%2f%2felsewhere.example",
    ):
        status, headers, _ = ask(studio, f"{path}?token={studio.token}")
        assert (status, headers["location"]) == (303, "/")
        assert headers.get_all("set-cookie") == [f"{studio.cookie}; Path=/; HttpOnly; SameSite=Strict"]


@pytest.mark.parametrize(
    "cookie",
    [
        "",
        "rso_lidar_studio_{port}=wrong",
        "rso_lidar_studio_{port}=",
        "rso_lidar_studio_1={token}",  # of a studio at another port
        "token={token}",
        "rso_lidar_studio_{port}={token}x",
        '="; =; \xff',
    ],
)
def test_another_cookie_is_refused(studio, cookie):
    text = cookie.format(port=studio.port, token=studio.token)
    assert ask(studio, "/", Cookie=text)[0] == 403
    assert shake_hands(studio, Cookie=text) == 403


@pytest.mark.parametrize(
    "host",
    ["rebound.example", "rebound.example:{port}", "127.0.0.1.rebound.example", "192.168.0.1", "[", "[::1", "", "a b"],
)
def test_another_host_name_is_refused(studio, host):
    """DNS rebinding: a page of another site whose name leads to this machine has that name in `Host`."""
    name = host.format(port=studio.port)
    status, _, body = ask(studio, "/", Host=name, Cookie=studio.cookie)
    assert status in (400, 403) and "<title>" not in body
    assert ask(studio, f"/?token={studio.token}", Host=name)[0] in (400, 403)
    assert shake_hands(studio, Host=name, Cookie=studio.cookie) in (400, 403)


@pytest.mark.parametrize("host", ["127.0.0.1:{port}", "localhost:{port}", "[::1]:{port}", "LOCALHOST:{port}"])
def test_names_of_this_machine_are_taken(studio, host):
    assert ask(studio, "/", Host=host.format(port=studio.port), Cookie=studio.cookie)[0] == 200


@pytest.mark.parametrize(
    "origin", ["http://rebound.example", "http://127.0.0.1:1", "https://rebound.example:{port}", "null", "http://[", ""]
)
def test_another_origin_is_refused(studio, origin):
    """Another page in the same browser, which sends the cookie along, as one at another port of this machine does."""
    name = origin.format(port=studio.port)
    assert ask(studio, "/", Origin=name, Cookie=studio.cookie)[0] == 403
    assert shake_hands(studio, Origin=name, Cookie=studio.cookie) == 403


def test_the_own_page_has_its_web_socket(studio):
    assert shake_hands(studio, Origin=f"http://127.0.0.1:{studio.port}", Cookie=studio.cookie) == 101
    assert shake_hands(studio, Origin=f"http://127.0.0.1:{studio.port}") == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_pages_of_other_sites_embed_nothing(studio, site):
    """An image or a script of the studio, named by a page at another port: it has the cookie, and no `Origin`."""
    given = {"Cookie": studio.cookie, "Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "image"}
    assert ask(studio, "/", **given, **{"Sec-Fetch-Site": site})[0] == 403
    assert ask(studio, "/", **given, **{"Sec-Fetch-Site": "same-origin"})[0] == 200


def test_pages_load_nothing_from_other_hosts(studio):
    for cookie in (studio.cookie, ""):
        headers = ask(studio, "/", Cookie=cookie)[1]
        policy = dict(one.strip().partition(" ")[::2] for one in headers["content-security-policy"].split(";"))
        assert policy["default-src"] == "'self'" and policy["frame-ancestors"] == "'none'"
        assert not {"*", "http:", "https:"} & {word for words in policy.values() for word in words.split()}
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cross-origin-resource-policy"] == "same-origin"


def call(scope, *, hosts=frozenset({"127.0.0.1"})):
    """Return the type of the first message that the middleware sends for a scope, and whether it called the application."""
    called, sent = [], []

    async def application(scope, receive, send):
        called.append(scope["type"])

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message)

    asyncio.run(AccessControl(application, token=TOKEN, hosts=hosts, port=80)(scope, receive, send))
    return sent[0].get("status", sent[0]["type"]) if sent else None, bool(called)


def test_lifespan_passes_and_other_scopes_need_the_token():
    given = [(b"host", b"127.0.0.1")]
    assert call({"type": "lifespan"}) == (None, True)
    assert call({"type": "websocket", "path": "/", "headers": given}) == ("websocket.close", False)
    assert call({"type": "http", "path": "/", "headers": given}) == (403, False)
    cookie = (b"cookie", b"rso_lidar_studio_80=" + TOKEN.encode())
    assert call({"type": "http", "path": "/", "headers": [*given, cookie]}) == (None, True)


def test_a_token_in_the_query_opens_no_web_socket():
    scope = {
        "type": "websocket",
        "path": "/",
        "query_string": f"token={TOKEN}".encode(),
        "headers": [(b"host", b"127.0.0.1")],
    }
    assert call(scope) == ("websocket.close", False)


@pytest.mark.parametrize(
    "query", [b"token=%ff%fe", b"token=%00", b"token=" + b"a" * 60_000, b"&" * 5000, b"token=a&token=b"]
)
def test_odd_queries_are_refused_in_one_line(query):
    given = {"type": "http", "path": "/", "query_string": query, "headers": [(b"host", b"127.0.0.1")]}
    assert call(given) == (403, False)


def test_any_name_reaches_an_address_that_other_machines_can():
    """Whoever asks for another address decides by which names the machine is known. The origin still has to be the same."""
    cookie = (b"cookie", b"rso_lidar_studio_80=" + TOKEN.encode())
    scope = {"type": "http", "path": "/", "headers": [(b"host", b"lab.example"), cookie]}
    assert call(scope, hosts=None) == (None, True)
    scope["headers"].append((b"origin", b"http://other.example"))
    assert call(scope, hosts=None) == (403, False)


@pytest.mark.parametrize(
    "host",
    [
        "evil.example@127.0.0.1:{port}",
        "127.0.0.1:{port}/x",
        "127.0.0.1:{port}?x",
        "127.0.0.1:x",
        "localhost.evil",
        "127.0.0.1:{port}#",
        "",
    ],
)
def test_a_host_is_a_name_and_a_port_only(studio, host):
    cookie = f"rso_lidar_studio_{studio.port}={studio.token}"
    assert ask(studio, "/", Host=f"127.0.0.1:{studio.port}", Cookie=cookie)[0] == 200
    assert ask(studio, "/", Host=host.format(port=studio.port), Cookie=cookie)[0] in (400, 403)
