"""Routes of the workbench: recordings to open, data to draw, trials, steps of the model."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from compd.errors import CompdError, StateError
from compd.page.downloads import Downloads, in_pieces
from compd.page.recordings import NAME, Recordings, is_own, recording_tables
from compd.page.requests import LOOKS_ONLY, keys_of, may_change, refused
from compd.page.shares import ASKER, looks_only, shares_of
from compd.page.workbench.diagnoses import Diagnoses
from compd.page.workbench.effect_libraries import OWN_NAME, EffectLibraries
from compd.page.workbench.handlers import HANDLERS, Handler, plain
from compd.page.workbench.open_workbench import OpenWorkbench
from compd.page.workbench.plan_handlers import PLAN_HANDLERS
from compd.page.workers.answering import CLIENT_GONE, BrowserGone, while_asked
from compd.page.workers.limits import too_many
from compd.page.workers.workers import Workers

_QUESTIONS = "compd.page.workbench.formula_questions:"


async def _form(request: Request, workbench: OpenWorkbench) -> Response:
    return plain(await workbench.ask(f"{_QUESTIONS}form"))


async def _check(request: Request, workbench: OpenWorkbench) -> Response:
    """Allowed to everyone, since it changes nothing."""
    declaration = _declaration(await keys_of(request))
    return plain(await workbench.ask(f"{_QUESTIONS}checked", declaration))


async def _save(request: Request, workbench: OpenWorkbench) -> Response:
    """Save an effect, or with `delete` remove one; the answer is the summary."""
    keys = await keys_of(request)
    if not may_change(request):
        return refused(LOOKS_ONLY, 403)
    if "delete" in keys:
        return plain(await workbench.ask(f"{_QUESTIONS}deleted", str(keys["delete"])))
    return plain(await workbench.ask(f"{_QUESTIONS}saved", _declaration(keys), keys.get("replace") is True))


def _declaration(keys: Mapping[str, Any]) -> dict[str, Any]:
    """The effect in a request. Raises HTTPException for any other body, StateError for text that no file can hold."""
    declaration = keys.get("declaration")
    if not isinstance(declaration, dict):
        raise HTTPException(400, "declaration is a mapping: id, port, formula ...")
    try:
        json.dumps(declaration, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        what = "an invalid character, which no file can hold"
        raise StateError.of("formula", what, next_step="type it anew") from error
    return declaration


FORMULA_HANDLERS = (
    Handler("/formula", _form),
    Handler("/formula", _check, "POST"),
    Handler("/own", _save, "POST"),
)


# The page of a diagnosis is one file including its scripts and styles. Its sandbox has no cookie of this server and
# allows no request to any server.
_PAGE_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


# Time (s) for which a browser that follows a running diagnosis waits for its progress.
FOLLOWED_S = 0.4


async def _diagnosis(request: Request, workbench: OpenWorkbench) -> Response:
    """Progress of the newest diagnosis; with its findings, unless the browser already shows them.

    `follow`: a running one is answered a moment later, so that a browser follows it without a timer of its own.
    """
    with workbench.follower():
        if "follow" in request.query_params and workbench.is_diagnosing:
            await while_asked(request, asyncio.sleep(FOLLOWED_S, b""))
        return JSONResponse(workbench.diagnosis_summary(request.query_params.get("shown", "")))


async def _diagnose(request: Request, workbench: OpenWorkbench) -> Response:
    """`cancel`: end the running one; else begin one. Allowed to everyone, since it changes nothing."""
    keys = await keys_of(request)
    if keys.get("cancel"):
        if workbench.diagnosis is not None:
            workbench.diagnosis.cancel()
    else:
        await workbench.diagnose()
    with workbench.follower():
        return JSONResponse(workbench.diagnosis_summary())


DIAGNOSIS_HANDLERS = (
    Handler("/diagnosis", _diagnosis),
    Handler("/diagnosis", _diagnose, "POST"),
)


# Name of a model file that the page may create.
MODEL_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}\.model\.yaml")
# Most open workbenches: each takes memory, and any browser can open one.
MAX_OPEN = 32
_NOT_OPEN = "it is not open any more: open it again"

_BASE = "/workbench/{recording}/{model}"


class WorkbenchRoutes:
    """Open workbenches by recording and model file; used by the event loop's thread alone."""

    def __init__(
        self,
        recordings: Recordings,
        models: Path | None,
        machine: Path | None,
        page: Path,
        workers: Workers | None = None,
        downloads: Downloads | None = None,
    ) -> None:
        """models : directory of model files, None for that of the recordings. machine : the page's configuration.
        page : the HTML file. workers, downloads : of the page's server."""
        self._workers = workers or Workers()
        self._downloads = downloads or Downloads()
        self._recordings = recordings
        self._models = models or recordings.directory
        self._machine = machine
        self._page = page
        # by whether its browsers only look, and key: nobody who only looks can keep an operator's workbench busy
        self._open: dict[tuple[bool, str], OpenWorkbench] = {}
        self._diagnoses = Diagnoses(self._workers)
        self._libraries = EffectLibraries(self._models, OWN_NAME)

    def routes(self) -> list[Route]:
        """All of them; /workbench is the page itself."""
        page = Handler("/diagnosis/page", self._diagnosis_page)
        return [
            Route("/workbench", self._index),
            Route("/workbench/libraries", self._list_libraries),
            Route("/workbench/open", self._open_one, methods=["POST"]),
            *(
                Route(_BASE + of.path, self._of_open(of), methods=[of.method], max_body_size=of.max_body_size)
                for of in (*HANDLERS, *DIAGNOSIS_HANDLERS, *FORMULA_HANDLERS, *PLAN_HANDLERS, page)
            ),
        ]

    async def _index(self, request: Request) -> Response:
        self._workers.prepare()
        return FileResponse(self._page)

    async def _diagnosis_page(self, request: Request, workbench: OpenWorkbench) -> Response:
        """The page as its worker has compressed it."""
        page = b"" if workbench.diagnosis is None else workbench.diagnosis.page
        if not page:
            return refused("there is no page of a diagnosis yet", 404)
        headers = {"Content-Security-Policy": _PAGE_POLICY, "Content-Encoding": "gzip"}
        return self._downloads.answer(in_pieces(page), "text/html", headers)

    async def _list_libraries(self, request: Request) -> Response:
        return JSONResponse({"libraries": self._libraries.names()})

    async def _open_one(self, request: Request) -> Response:
        keys = await keys_of(request)
        recording, model = str(keys.get("recording", "")), str(keys.get("model", ""))
        path = recording_tables(self._recordings.directory).get(recording)
        if not NAME.fullmatch(recording) or path is None:
            return refused("there is no such recording", 404)
        if not MODEL_NAME.fullmatch(model):
            return refused("a model file is NAME.model.yaml, with letters, digits, - and _", 400)
        model_path = self._models / model
        if model_path.is_symlink() or (model_path.exists() and not is_own(model_path)):
            return refused(f"{model} is a link or no file, which the page does not open", 409)
        key = f"{recording}/{model}"
        try:
            libraries = self._named_libraries(keys.get("libraries"))
            return await self._opened(key, path, model_path, libraries)
        except CompdError as error:
            return refused(str(error), 409)

    def _named_libraries(self, names: object) -> list[str] | None:
        """Files of effects by their names; None if the request omits them. Raises HTTPException, StateError."""
        if names is None:
            return None
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise HTTPException(400, "libraries is a list of names")
        return self._libraries.sources(names)

    async def _opened(self, key: str, path: Path, model_path: Path, libraries: list[str] | None) -> Response:
        """The summary of the workbench with that key.

        Raises CompdError with every problem of the recording, its machine, the model and the libraries.
        """
        place = (looks_only(ASKER.get()), key)
        workbench, closed = self._open.get(place), None
        if workbench is None:
            closed = self._close_oldest()
            workbench = OpenWorkbench(self._workers, self._diagnoses, path, model_path, self._machine)
            self._open[place] = workbench  # before any await, so that the next request finds it
        try:
            if closed is not None:
                await asyncio.to_thread(closed.rest)
            return plain(await workbench.ask("open_again", key, libraries))
        finally:
            if workbench.worker.kept is None:  # it could not be opened
                self._open.pop(place, None)
                await asyncio.to_thread(workbench.rest)

    def _close_oldest(self) -> OpenWorkbench | None:
        """Close the least recently used workbench of the first share of the token that is used up.

        Raises StateError if all of them are busy.
        """
        for share in shares_of(ASKER.get(), MAX_OPEN):
            held = [place for place, workbench in self._open.items() if share.holds(workbench.token)]
            if len(held) < share.most:
                continue
            idle = [place for place in held if not self._open[place].is_busy]
            if not idle:
                raise too_many("the workbench", share.most, share.whose)
            return self._open.pop(min(idle, key=lambda place: self._open[place].worker.used_s))
        return None

    def _of_open(self, handler: Handler) -> Callable[[Request], Awaitable[Response]]:
        """The handler with the workbench of the address."""

        async def handled(request: Request) -> Response:
            key = "{recording}/{model}".format(**request.path_params)
            workbench = self._open.get((looks_only(ASKER.get()), key))
            if workbench is None:
                return refused(_NOT_OPEN, 404)
            try:
                return await handler.answer(request, workbench)
            except BrowserGone:
                return refused("the browser has gone", CLIENT_GONE)
            except CompdError as error:
                return refused(str(error), 409)
            except (KeyError, IndexError):
                return refused("there is no such effect", 404)

        return handled
