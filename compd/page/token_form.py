"""The form by which a person on a tablet shows a token; it works without a script."""

from __future__ import annotations

import html
from pathlib import Path
from urllib.parse import parse_qs

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

# Path of the form's target.
FORM_PATH = "/token"
# Static files of the form, served without a token.
FORM_FILES = ("/static/page.css", "/static/token.css", "/static/icon.svg")
# Most bytes of the form; a token has 32 characters.
LONGEST_FORM_BYTES = 512
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
    if not length.isdecimal() or int(length[:10]) > LONGEST_FORM_BYTES:
        return None
    body = b""
    async for piece in request.stream():
        body += piece
        if len(body) > LONGEST_FORM_BYTES:
            return None
    try:
        fields = parse_qs(body.decode("ascii"), max_num_fields=4)
    except ValueError:
        return None
    return fields.get("token", [""])[0].strip()
