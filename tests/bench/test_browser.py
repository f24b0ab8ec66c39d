import asyncio

from websockets.asyncio.client import connect

from app.bench.browser import camera_message, clips_in
from app.stage.clip import build_clip
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
    assert found == [build_clip(a, b, Layout.WIDE)]


def test_the_first_message_is_one_that_a_browser_may_send():
    assert checked(camera_message())
