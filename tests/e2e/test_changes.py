"""From one question to the next without a flicker: every frame that reaches the screen shows two roads."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.e2e.person import Person

pytestmark = pytest.mark.browser

N_CHANGES = 3


def differing(half: np.ndarray) -> float:
    """Share of a picture's pixels that differ from its commonest colour; near zero where there is nothing."""
    coarse = (half // 24).reshape(-1, 3).astype(np.int64)
    codes = coarse @ (1, 100, 10_000)
    return 1.0 - float(np.unique(codes, return_counts=True)[1].max()) / len(codes)


def halves(png: bytes, pane: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Returns A's and B's half of the pane without their letters."""
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
    x, y, w, h = (round(pane[key]) for key in ("x", "y", "width", "height"))
    pixels = pixels[y : y + h, x + w // 5 : x + w - w // 20]
    return pixels[8 : h // 2 - 8], pixels[h // 2 + 8 : h - 8]


def shown(png: bytes, pane: dict[str, float]) -> float:
    """How much there is to see in the emptier half of the pane."""
    return min(differing(half) for half in halves(png, pane))


def test_no_frame_of_a_change_shows_an_empty_stage(person: Person) -> None:
    person.sees_question(1)
    pane = person.page.locator(".pane").bounding_box()
    assert pane is not None
    # The stage's very first picture takes a while on a slow machine; this is about what comes after it.
    for _ in range(300):
        if shown(person.page.screenshot(), pane) > 0.05:
            break
        person.page.wait_for_timeout(100)
    frames: list[bytes] = []
    devtools = person.page.context.new_cdp_session(person.page)

    def keep(event: dict[str, Any]) -> None:
        frames.append(base64.b64decode(event["data"]))
        devtools.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})

    devtools.on("Page.screencastFrame", keep)
    devtools.send("Page.startScreencast", {"format": "png", "everyNthFrame": 1})
    for number in range(1, N_CHANGES + 1):
        person.presses("ab"[number % 2])
        person.sees_question(number + 1)
        n_frames = len(frames)
        # Until well after the old clip has been removed.
        for _ in range(100):
            person.page.wait_for_timeout(100)
            if len(frames) >= n_frames + 8:
                break
    devtools.send("Page.stopScreencast")
    assert len(frames) > 10 * N_CHANGES
    drawn = [shown(frame, pane) for frame in frames]
    assert min(drawn) > 0.05, f"frame {int(np.argmin(drawn))} of {len(frames)} shows nothing"


def test_an_empty_picture_would_be_noticed() -> None:
    road = np.full((100, 100, 3), 130, np.uint8)
    assert differing(road) == 0.0
    road[40:60] = 40
    assert differing(road) > 0.05
