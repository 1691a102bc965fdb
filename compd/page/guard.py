"""Who may use the page: a token opens it, a cookie keeps it open, and a request from another site is refused.

On this computer the token is made anew at every start and stands in the address that `compd page` prints. For other
computers tokens are kept in a file, each with a name and a role, as SHA-256. A foreign site cannot use the browser of a
person who has the page open: requests must name this server (`Host`), and orders come from its own pages (`Origin`).
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

Role = Literal["view", "operate"]

# Followed by the port: a browser sends a cookie to every port of a host.
COOKIE = "compd_page_"
# Everything comes from this server; styles of elements are set by scripts through the DOM, which this allows. An answer
# that brings a policy of its own keeps it.
CONTENT_SECURITY_POLICY = "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
_HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
_NEEDS_TOKEN = "This page needs the address that `compd page` printed, with its token, or a token of your own."


@dataclass(frozen=True)
class Token:
    """A token as it is kept. name : of the person or screen that has it. sha256 : of the token, hexadecimal."""

    name: str
    role: Role
    sha256: str


def hashed(token: str) -> str:
    """SHA-256 of a token, hexadecimal."""
    return hashlib.sha256(token.encode()).hexdigest()


def new_token() -> str:
    """A token that cannot be guessed."""
    return secrets.token_urlsafe(24)


class Guard:
    """ASGI middleware: lets through who has a token, and adds the headers that bind the browser to this server."""

    def __init__(self, app: ASGIApp, tokens: Sequence[Token], origins: Sequence[str], port: int) -> None:
        """`origins`: by which browsers reach this server, as "http://127.0.0.1:7760". `port`: where it listens."""
        self._app = app
        self._tokens = tuple(tokens)
        self._origins = frozenset(origins)
        self._hosts = frozenset(urlsplit(origin).netloc for origin in origins)
        self._cookie = f"{COOKIE}{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(HTTPConnection(scope))
        if refusal is not None:
            await refusal(scope, receive, _with_headers(send))
            return
        await self._app(scope, receive, _with_headers(send))

    def _refusal(self, connection: HTTPConnection) -> Response | None:
        """Why a request is not followed; None where it is. The scope then has the token's name and role."""
        headers: Headers = connection.headers
        host = headers.get("host", "")
        if host not in self._hosts:
            return PlainTextResponse(f"this server is not {host!r}; it is {', '.join(sorted(self._hosts))}", 400)
        looks = connection.scope["method"] in ("GET", "HEAD")
        origin = headers.get("origin", "")
        own = origin in self._origins and urlsplit(origin).netloc == host
        if not own and (not looks or "origin" in headers):
            return PlainTextResponse("requests come from this server's own pages only", 403)
        token_text = connection.query_params.get("token")
        if token_text is not None:
            if self._known(token_text) is None:
                return PlainTextResponse(_NEEDS_TOKEN, 403)
            response = RedirectResponse(connection.url.path, 303)
            secure = f"https://{host}" in self._origins
            response.set_cookie(self._cookie, token_text, httponly=True, samesite="strict", secure=secure)
            return response
        token = self._known(connection.cookies.get(self._cookie, ""))
        if token is None:
            return PlainTextResponse(_NEEDS_TOKEN, 403)
        connection.scope["token"] = token
        return None

    def _known(self, token_text: str) -> Token | None:
        """The token of that text; each is compared in the same time."""
        digest = hashed(token_text)
        known = [token for token in self._tokens if hmac.compare_digest(token.sha256, digest)]
        return known[0] if known else None


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = list(message.get("headers", []))
            names = {name.lower() for name, _ in headers}
            own = [(name.lower().encode(), value.encode()) for name, value in _HEADERS.items()]
            message = {**message, "headers": [*headers, *(header for header in own if header[0] not in names)]}
        await send(message)

    return send_with_headers
