"""Access to the studio: a token in the first address, a cookie afterwards, and requests of its own pages only."""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any
from urllib.parse import parse_qs, urlsplit

from starlette.responses import PlainTextResponse

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

_REFUSED = "The studio opens with the address that `rso-lidar studio` prints, which contains its token.\n"
# Pages load nothing from other hosts, and no other page may frame them. NiceGUI needs inline scripts and `eval`.
_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; worker-src 'self' blob:; "
    "frame-ancestors 'none'; base-uri 'self'; form-action 'self'"
)
_HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "cross-origin-resource-policy": "same-origin",  # pages at other ports of this machine embed no frame
    "referrer-policy": "no-referrer",  # the token stays out of the addresses that other hosts see
}


class AccessControl:
    """ASGI middleware that answers only requests with the token, for pages and for web sockets alike.

    A request whose query has the token gets a cookie, and is redirected to the page, without it. Requests whose `Host` or
    `Origin` is another name are refused: a page of another site cannot reach the studio by a name of its own.
    """

    def __init__(self, app: Any, *, token: str, hosts: frozenset[str] | None, port: int) -> None:
        """Wrap an application.

        Parameters
        ----------
        hosts : host names that requests may give, without the port (None: any)
        port : of the server; it names the cookie, because browsers share cookies among the ports of a host
        """
        self._app, self._token, self._hosts = app, token, hosts
        self._cookie = f"rso_lidar_studio_{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {key.decode("latin-1"): value.decode("latin-1") for key, value in scope["headers"]}
        if self._is_of_our_pages(headers):
            given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
            if scope["type"] == "http" and self._matches(given):
                cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"
                headers = {**_HEADERS, "location": "/", "set-cookie": cookie}
                await PlainTextResponse("", 303, headers)(scope, receive, send)
                return
            if self._matches(self._read_cookie(headers.get("cookie", ""))):
                await self._app(scope, receive, _add_headers(send) if scope["type"] == "http" else send)
                return
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            await PlainTextResponse(_REFUSED, 403, _HEADERS)(scope, receive, send)

    def _is_of_our_pages(self, headers: dict[str, str]) -> bool:
        host, origin = headers.get("host", ""), headers.get("origin")
        is_embedded = headers.get("sec-fetch-mode") == "no-cors"  # an image, say: it has the cookie, and no origin
        if is_embedded and headers.get("sec-fetch-site") in ("same-site", "cross-site"):
            return False
        try:
            is_known = self._hosts is None or _read_host(host) in self._hosts
            return is_known and (origin is None or urlsplit(origin).netloc == host)
        except ValueError:  # half an IPv6 address, or no port
            return False

    def _matches(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), self._token.encode())

    def _read_cookie(self, header: str) -> str:
        # Not by http.cookies: it stops at the first odd cookie, and other servers of this machine may have set one.
        pairs = (pair.strip().partition("=") for pair in header.split(";"))
        return next((value for name, _, value in pairs if name == self._cookie), "")


def _read_host(header: str) -> str:
    """Return the name in a `Host` header, which is a name or address and perhaps a port, and nothing else."""
    parts = urlsplit(f"//{header}")
    name, port = parts.hostname or "", parts.port
    written = f"[{name}]" if ":" in name else name
    if header.lower() not in (written, f"{written}:{port}"):
        raise ValueError(f"{header}: is not a host with its port")
    return name


def _add_headers(send: Send) -> Send:
    """Wrap `send` so that each response has the headers of the studio."""

    async def send_with_headers(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            more = [(key.encode(), value.encode()) for key, value in _HEADERS.items()]
            message["headers"] = [*message.get("headers", ()), *more]
        await send(message)

    return send_with_headers
