"""Routes of the workbench: recordings to open, data to draw, trials, steps of the model."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from compd.errors import CompdError
from compd.page.recordings import NAME, Recordings, is_own, recording_tables
from compd.page.requests import keys_of, refused
from compd.page.workbench.diagnoses import Diagnoses
from compd.page.workbench.diagnosis_handlers import DIAGNOSIS_HANDLERS
from compd.page.workbench.effect_libraries import OWN_NAME, EffectLibraries
from compd.page.workbench.formula_handlers import FORMULA_HANDLERS
from compd.page.workbench.handlers import HANDLERS, Handler, plain
from compd.page.workbench.open_workbench import OpenWorkbench
from compd.page.workbench.plan_handlers import PLAN_HANDLERS
from compd.page.workers.answering import CLIENT_GONE, BrowserGone
from compd.page.workers.limits import too_many
from compd.page.workers.workers import Workers

# Name of a model file that the page may create.
MODEL_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}\.model\.yaml")
# Most open workbenches: each takes memory, and any browser can open one.
MOST_OPEN = 32
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
    ) -> None:
        """models : directory of model files, None for that of the recordings. machine : the page's configuration.
        page : the HTML file. workers : of the page's server."""
        self._workers = workers or Workers()
        self._recordings = recordings
        self._models = models or recordings.directory
        self._machine = machine
        self._page = page
        self._open: dict[str, OpenWorkbench] = {}
        self._diagnoses = Diagnoses(self._workers)
        self._libraries = EffectLibraries(self._models, OWN_NAME)

    def routes(self) -> list[Route]:
        """All of them; /workbench is the page itself."""
        return [
            Route("/workbench", self._index),
            Route("/workbench/libraries", self._list_libraries),
            Route("/workbench/open", self._open_one, methods=["POST"]),
            *(
                Route(f"{_BASE}{handler.path}", self._of_open(handler), methods=[handler.method])
                for handler in (*HANDLERS, *DIAGNOSIS_HANDLERS, *FORMULA_HANDLERS, *PLAN_HANDLERS)
            ),
        ]

    async def _index(self, request: Request) -> Response:
        self._workers.prepare()
        return FileResponse(self._page)

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
        workbench, closed = self._open.get(key), None
        if workbench is None:
            closed = self._close_oldest()
            workbench = OpenWorkbench(self._workers, self._diagnoses, path, model_path, self._machine)
            self._open[key] = workbench  # before any await, so that the next request finds it
        try:
            if closed is not None:
                await asyncio.to_thread(closed.rest)
            return plain(await workbench.ask("open_again", key, libraries))
        finally:
            if workbench.worker.kept is None:  # it could not be opened
                self._open.pop(key, None)
                await asyncio.to_thread(workbench.rest)

    def _close_oldest(self) -> OpenWorkbench | None:
        """Close the least recently used workbench if the limit is reached. Raises StateError if all are busy."""
        if len(self._open) < MOST_OPEN:
            return None
        idle = [key for key, workbench in self._open.items() if not workbench.is_busy]
        if not idle:
            raise too_many("the workbench", MOST_OPEN)
        return self._open.pop(min(idle, key=lambda key: self._open[key].worker.used_s))

    def _of_open(self, handler: Handler) -> Callable[[Request], Awaitable[Response]]:
        """The handler with the workbench of the address."""

        async def handled(request: Request) -> Response:
            workbench = self._open.get("{recording}/{model}".format(**request.path_params))
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
