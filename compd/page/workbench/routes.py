"""The routes of the workbench: recordings to open, what a browser draws of one, trials, steps of the model."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from compd.errors import CompdError
from compd.page.recording_machine import machine_of
from compd.page.recordings import NAME, Recordings, recording_tables
from compd.page.requests import keys_of, refused
from compd.page.workbench.diagnoses import Diagnoses
from compd.page.workbench.diagnosis_handlers import DIAGNOSIS_HANDLERS
from compd.page.workbench.effect_libraries import EffectLibraries
from compd.page.workbench.formula_handlers import FORMULA_HANDLERS
from compd.page.workbench.handlers import HANDLERS, Handler
from compd.page.workbench.own_effects import NAME as OWN_NAME
from compd.page.workbench.plan_handlers import PLAN_HANDLERS
from compd.page.workbench.workbench import Workbench

# A model file that the page may begin.
MODEL_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}\.model\.yaml")
_NOT_OPEN = "it is not open any more: open it again"

_BASE = "/workbench/{recording}/{model}"


class WorkbenchRoutes:
    """What is open, by recording and model file; used by the event loop's thread alone."""

    def __init__(self, recordings: Recordings, models: Path | None, machine: Path | None, page: Path) -> None:
        """models : directory of model files, None for that of the recordings. machine : the page's configuration.
        page : the HTML file."""
        self._recordings = recordings
        self._models = models or recordings.directory
        self._machine = machine
        self._page = page
        self._open: dict[str, Workbench] = {}
        self._diagnoses = Diagnoses()
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
        key = f"{recording}/{model}"
        if key not in self._open:
            try:
                opened = await asyncio.to_thread(self._opened, path, self._models / model)
            except CompdError as error:
                return refused(str(error), 409)
            self._open.setdefault(key, opened)
        workbench = self._open[key]
        try:
            await workbench.ask(workbench.refresh)
            if isinstance(libraries := keys.get("libraries"), list):
                await workbench.ask(partial(workbench.use_libraries, self._libraries.sources(libraries)))
        except CompdError as error:
            return refused(str(error), 409)
        return JSONResponse({"key": key, **await workbench.ask(workbench.summary)})

    def _opened(self, path: Path, model_path: Path) -> Workbench:
        """Open them, by the page's configuration where it is of the recording's machine.

        Raises CompdError with every problem of the recording, its machine and the model.
        """
        return Workbench(path, model_path, machine_of(path, self._machine), self._diagnoses)

    def _of_open(self, handler: Handler) -> Callable[[Request], Awaitable[Response]]:
        """The handler with the workbench that the address names."""

        async def handled(request: Request) -> Response:
            workbench = self._open.get("{recording}/{model}".format(**request.path_params))
            if workbench is None:
                return refused(_NOT_OPEN, 404)
            try:
                return await handler.answer(request, workbench)
            except CompdError as error:
                return refused(str(error), 409)
            except (KeyError, IndexError):
                return refused("there is no such effect", 404)

        return handled
