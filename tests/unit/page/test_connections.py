"""Orders of a browser: for how long they are followed."""

from __future__ import annotations

import asyncio

import pytest

from compd.page.browsers import ARMED_S
from compd.page.guard import COOKIE, Guard, Token, hashed
from compd.page.recordings import Recordings
from compd.page.server import Server
from tests.support.asgi_client import AsgiClient
from tests.support.hand_clock import HandClock
from tests.support.patience import PATIENCE_S
from tests.support.scripted_page import ORDERS, ScriptedLink

HOST = "127.0.0.1:7760"


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def server(tmp_path, clock):
    return Server(ScriptedLink("/no/socket"), Recordings(tmp_path, "/no/socket"), clock=clock)


def run(server, conversation):
    """The conversation of a person's client with the server, its tasks beside it."""

    async def all_of_it():
        app = server.app()
        guarded = Guard(app, [Token("Anna", ORDERS, hashed("anna's"))], [f"http://{HOST}"], 7760)
        headers = {"Host": HOST, "Origin": f"http://{HOST}", "Cookie": f"{COOKIE}7760=anna's"}
        async with asyncio.timeout(PATIENCE_S), app.router.lifespan_context(app):
            await conversation(AsgiClient(guarded, headers))

    asyncio.run(all_of_it())


def test_orders_are_followed_for_a_minute_and_no_longer_than_the_connection(server, clock):
    async def conversation(client):
        async def ordered():
            """The link is to no daemon: an order that is followed finds none."""
            status, answer = await client.post("/orders/zero", {"id": id})
            assert (status == 403) == (
                answer["reason"] in ("this browser is not armed", "this browser is not connected")
            )
            return status == 409 and "no daemon answers" in answer["reason"]

        async with client.stream("/live") as stream:
            id = (await stream.event())[1]["id"]
            assert not await ordered()
            assert await client.post("/arm", {"id": id}) == (200, {"armed_s": ARMED_S})
            clock.now_s += ARMED_S - 0.1
            assert await ordered()
            clock.now_s += 0.2
            assert not await ordered()
            await client.post("/arm", {"id": id})
            assert await ordered()
        assert not await ordered()

    run(server, conversation)
