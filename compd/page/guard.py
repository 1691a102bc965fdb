"""Access to the page: a token opens it, a cookie keeps it open, requests from other sites are refused.

On this computer the token is made anew at every start and stands in the address that `compd page` prints. For other
computers tokens are kept in a file, each with a name and a role, as SHA-256. A foreign site cannot use the browser of a
person who has the page open: requests must name this server (`Host`), orders come from its own pages (`Origin`), and
nothing of it is loaded into a foreign page (`Sec-Fetch-Site`).

Nothing that has no token is read further than its head, but for the form that takes a token.
"""

from __future__ import annotations

import hashlib
import hmac
import html
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from urllib.parse import parse_qs, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, HTTPConnection, Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from compd.clock import Clock, MonotonicClock
from compd.live.service import WRONG_TOKEN_REST_S
from compd.page.limited_protocol import LimitedProtocol
from compd.page.shares import ASKER

# Most waiting addresses. Beyond it all addresses wait, since they belong to one attacker.
_MAX_ADDRESSES = 256


class WrongTokens:
    """Addresses that have just shown a wrong token; used by the event loop's thread alone."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._until_s: dict[str, float] = {}

    def may_try(self, address: str) -> bool:
        """Whether a token from this address is checked."""
        now_s = self._clock.monotonic()
        self._until_s = {waiting: until_s for waiting, until_s in self._until_s.items() if until_s > now_s}
        return address not in self._until_s and len(self._until_s) < _MAX_ADDRESSES

    def note(self, address: str) -> None:
        """Note a wrong token from this address."""
        self._until_s[address] = self._clock.monotonic() + WRONG_TOKEN_REST_S


# Path of the form's target.
FORM_PATH = "/token"
# Static files of the form, served without a token.
FORM_FILES = ("/static/page.css", "/static/axes.css", "/static/token.css", "/static/icon.svg")
# Most bytes of the form; a token has 32 characters.
MAX_FORM_BYTES = 512
_PAGE = Path(__file__).parent / "static" / "token.html"
_PROBLEM = "<!-- problem -->"


def token_form(problem: str = "", status: int = 403) -> Response:
    """The form. problem : reason why the previous token was refused."""
    said = f'<p id="problem" role="alert">{html.escape(problem)}</p>' if problem else ""
    return HTMLResponse(_PAGE.read_text(encoding="utf-8").replace(_PROBLEM, said), status)


async def posted_token(request: Request) -> str | None:
    """The token in the form; None for any other body, which is not read further.

    Raises ClientDisconnect where the browser goes meanwhile.
    """
    length = request.headers.get("content-length", "0")
    if not length.isdecimal() or int(length[:10]) > MAX_FORM_BYTES:
        return None
    body = b""
    async for piece in request.stream():
        body += piece
        if len(body) > MAX_FORM_BYTES:
            return None
    try:
        fields = parse_qs(body.decode("ascii"), max_num_fields=4)
    except ValueError:
        return None
    return fields.get("token", [""])[0].strip()


Role = Literal["view", "operate"]

# The port follows: a browser sends a cookie to every port of a host.
COOKIE = "compd_page_"
# Everything comes from this server; scripts may set styles of elements through the DOM. An answer with a policy of its
# own keeps it.
CONTENT_SECURITY_POLICY = "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
_HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    # "no-referrer" would remove the origin from a form submitted without a script
    "Referrer-Policy": "same-origin",
    "Cache-Control": "no-store",
    # Another port of this computer is another origin: its pages may neither load from here nor keep a handle of a
    # window.
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
LEAVE_PATH = "/leave"
# Most headers of a request; browsers send some twenty. h11 limits the size of an incomplete head alone.
MAX_HEADERS = 64
_OWN_PATH = re.compile(r"(/[A-Za-z0-9_.-]+)*/?")
_NEEDS_TOKEN = "This page needs the address that `compd page` printed, with its token, or a token of your own."


@dataclass(frozen=True)
class Token:
    """A stored token. name : of its person or screen. sha256 : of the token, hexadecimal."""

    name: str
    role: Role
    sha256: str


def hashed(token: str) -> str:
    """SHA-256 of a token, hexadecimal."""
    return hashlib.sha256(token.encode(errors="surrogatepass")).hexdigest()


def new_token() -> str:
    """A new random token."""
    return secrets.token_urlsafe(24)


class Guard:
    """ASGI middleware: admits requests with a token, and adds the headers that bind the browser to this server."""

    def __init__(
        self, app: ASGIApp, tokens: Sequence[Token], origins: Sequence[str], port: int, clock: Clock | None = None
    ) -> None:
        """`origins`: by which browsers reach this server, as "http://127.0.0.1:7760". `port`: where it listens.
        `clock`: by which somebody who has shown a wrong token in the form waits."""
        self._app = app
        self._tokens = tuple(tokens)
        self._origins = frozenset(origins)
        self._hosts = frozenset(urlsplit(origin).netloc for origin in origins)
        self._cookie = f"{COOKIE}{port}"
        self._wrong = WrongTokens(clock or MonotonicClock())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope, receive)
        try:
            refusal = self._foreign(request) or await self._of_token(request) or self._without_token(request)
            if refusal is not None:
                refusal.headers["Connection"] = "close"  # further messages are ignored
            ASKER.set(scope.get("token"))
            await (refusal or self._app)(scope, receive, _with_headers(send))
        except ClientDisconnect:
            return  # it left while sending: an answer has no receiver

    def _foreign(self, connection: HTTPConnection) -> Response | None:
        """Reason why a request is from another site; None for one of this server's own pages."""
        headers: Headers = connection.headers
        if len(headers) > MAX_HEADERS:
            return PlainTextResponse(f"a request has {MAX_HEADERS} headers at most", 431)
        host = headers.get("host", "")
        if host not in self._hosts:
            return PlainTextResponse(f"this server is not {host!r}; it is {', '.join(sorted(self._hosts))}", 400)
        looks = connection.scope["method"] in ("GET", "HEAD")
        origin = headers.get("origin", "")
        own = origin in self._origins and urlsplit(origin).netloc == host
        if (not own and (not looks or "origin" in headers)) or _is_loaded_elsewhere(headers, looks):
            return PlainTextResponse("requests come from this server's own pages only", 403)
        return None

    async def _of_token(self, request: Request) -> Response | None:
        """The answer to a login or logout; None for every other request."""
        path, posts = request.url.path, request.method == "POST"
        if posts and path == LEAVE_PATH:
            response = RedirectResponse("/", 303)
            response.delete_cookie(self._cookie, httponly=True, samesite="strict", secure=self._is_secure(request))
            return response
        by_form = posts and path == FORM_PATH
        if not by_form and "token" not in request.query_params:
            return None
        address = request.client.host if request.client else ""
        if by_form and not self._wrong.may_try(address):
            return token_form("A wrong token came from there a moment ago. Try again in a second.", 429)
        token_text = await posted_token(request) if by_form else request.query_params["token"]
        if token_text is None or self._known(token_text) is None:
            if by_form:
                self._wrong.note(address)
            if (connection := LimitedProtocol.of(request.scope)) is not None:
                connection.note("wrong_token")
            return token_form("This token is not known here.") if by_form else PlainTextResponse(_NEEDS_TOKEN, 403)
        response = RedirectResponse("/" if by_form else _same_address(request), 303)
        secure = self._is_secure(request)
        response.set_cookie(self._cookie, token_text, httponly=True, samesite="strict", secure=secure)
        return response

    def _without_token(self, connection: HTTPConnection) -> Response | None:
        """Reason of a refusal; None for an accepted request, whose scope then has the token's name and role."""
        token = self._known(connection.cookies.get(self._cookie, ""))
        if token is None:
            looks = connection.scope["method"] in ("GET", "HEAD")
            if looks and connection.url.path in FORM_FILES:
                return None
            reads_html = looks and "text/html" in connection.headers.get("accept", "")
            return token_form() if reads_html else PlainTextResponse(_NEEDS_TOKEN, 403)
        limited = LimitedProtocol.of(connection.scope)
        if limited is not None and not limited.admit(token.name):
            return PlainTextResponse("there are too many connections with this token", 503)
        connection.scope["token"] = token
        return None

    def _is_secure(self, connection: HTTPConnection) -> bool:
        return f"https://{connection.headers.get('host', '')}" in self._origins

    def _known(self, token_text: str) -> Token | None:
        """The token of that text; each comparison takes the same time."""
        digest = hashed(token_text)
        known = [token for token in self._tokens if hmac.compare_digest(token.sha256, digest)]
        return known[0] if known else None


def _is_loaded_elsewhere(headers: Headers, looks: bool) -> bool:
    """Whether a page of another site, or port, loads something from here, other than to show it by itself."""
    if headers.get("sec-fetch-site", "none") in ("none", "same-origin"):
        return False
    shown = (headers.get("sec-fetch-mode"), headers.get("sec-fetch-dest")) == ("navigate", "document")
    return not (looks and shown)


def _same_address(request: Request) -> str:
    """The address without its token, to redirect a browser to; "/" where that may be taken for another server's."""
    if not _OWN_PATH.fullmatch(request.url.path):
        return "/"
    query = urlencode([(key, value) for key, value in request.query_params.multi_items() if key != "token"])
    return f"{request.url.path}?{query}" if query else request.url.path


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = list(message.get("headers", []))
            names = {name.lower() for name, _ in headers}
            own = [(name.lower().encode(), value.encode()) for name, value in _HEADERS.items()]
            message = {**message, "headers": [*headers, *(header for header in own if header[0] not in names)]}
        await send(message)

    return send_with_headers
