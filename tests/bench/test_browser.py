import asyncio
import json

import httpx
import pytest
from websockets.asyncio.client import connect

from app.bench.browser import Browser, Diary, camera_message, clips_in
from app.bench.report import BenchError
from app.stage.clip import N_FLAGS, build_clip
from app.stage.framing import Layout
from app.stage.proxy import SUBPROTOCOL, checked
from app.stage.stage import Picture, Stage
from study_core.domains.driving.domain import DRIVING_V1


async def first_clips(port):
    async with connect(f"ws://127.0.0.1:{port}", subprotocols=[SUBPROTOCOL], proxy=None) as stage:
        await stage.send(camera_message())
        async for message in stage:
            if clips := clips_in(message):
                return clips
    return []


def test_a_clip_is_found_in_what_a_stage_sends():
    a, b = (DRIVING_V1.scene(DRIVING_V1.control_upper * share) for share in (0.1, 0.2))
    stage = Stage()
    try:
        stage.show(Picture(0, a, b))
        found = asyncio.run(asyncio.wait_for(first_clips(stage.port), 10.0))
    finally:
        stage.close()
    assert found in [[build_clip(a, b, Layout.WIDE, flag=flag)] for flag in range(N_FLAGS)]


def test_the_first_message_is_one_that_a_browser_may_send():
    assert checked(camera_message())


def follow(status, *screens):
    """Lets a browser follow a server that sends these screens and no more; returns the browser."""
    sent = "".join(f"data: {json.dumps(screen)}\n\n" for screen in screens)
    transport = httpx.MockTransport(lambda _: httpx.Response(status, text=sent))

    async def follow_all():
        async with httpx.AsyncClient(base_url="http://server", transport=transport) as http:
            browser = Browser(http, "token", Diary())
            await browser.follow()
            return browser

    return asyncio.run(asyncio.wait_for(follow_all(), 10.0))


QUESTION = {"kind": "question", "position": 2, "query_index": 0}
FINISHED = {"kind": "finished", "position": 3, "query_index": None}


def test_a_browser_follows_the_screens_until_the_session_is_finished():
    assert follow(200, QUESTION, QUESTION, FINISHED).is_finished


def test_screens_that_are_refused_or_end_too_early_are_a_failure():
    with pytest.raises(BenchError, match=r"until the session is finished, but the server ended them\."):
        follow(200, QUESTION)
    with pytest.raises(BenchError, match=r"to be served, got 404\."):
        follow(404)
