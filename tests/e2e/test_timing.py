"""How exactly the page knows when a person first sees a clip: compared with what viser's renderer draws when."""

from __future__ import annotations

from statistics import median
from typing import Any

import pytest
from playwright.sync_api import Request

from tests.e2e.conftest import OpenPage
from tests.e2e.person import N_QUERIES, Person, join
from tests.support.server import ServerProcess

pytestmark = [pytest.mark.browser, pytest.mark.slow]

# In the stage's frame: three.js calls `onAfterRender` of a mesh when it has drawn it. The first time that happens to
# a mesh, the animation frame's own time is written down.
_WATCH_RENDERER = """() => {
  if (window === top) return;
  window.drawn = [];
  const hooked = new WeakSet();
  const hook = (clip) => {
    let isNoted = false;
    clip.traverse((node) => {
      if (!node.isMesh || hooked.has(node)) return;
      hooked.add(node);
      node.onAfterRender = () => {
        if (!isNoted) window.drawn.push(performance.timeOrigin + document.timeline.currentTime);
        isNoted = true;
        node.onAfterRender = () => undefined;
      };
    });
  };
  const look = () => {
    for (const name of ["/0", "/1", "/2", "/3"]) {
      const clip = window.__viserMutable?.nodeRefFromName?.[name];
      if (clip) hook(clip);
    }
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}"""

_NOTE_PRESSES = """() => {
  window.pressed = [];
  const note = () => window.pressed.push(performance.timeOrigin + performance.now());
  addEventListener("keydown", note, { capture: true });
}"""


def errors_ms(person: Person, n_questions: int) -> tuple[list[float], list[float]]:
    """Answers questions; returns for each how late the page took its first frame to be, and its frame's length."""
    bodies: list[dict[str, Any]] = []

    def keep(request: Request) -> None:
        if request.url.endswith("/answer"):
            bodies.append(request.post_data_json)

    person.page.on("request", keep)
    person.page.evaluate(_NOTE_PRESSES)
    late, frames = [], []
    for number in range(1, n_questions + 1):
        person.sees_question(number)
        drawn = person.stage.evaluate("() => window.drawn.at(-1)")
        person.page.wait_for_timeout(700)
        person.presses("a")
        person.sees_question(number + 1)
        pressed = person.page.evaluate("() => window.pressed.at(-1)")
        assert bodies[-1]["client"]["first_frame"] == "seen"
        late.append(pressed - bodies[-1]["response_time_ms"] - drawn)
        frames.append(bodies[-1]["client"]["frame_ms"])
    return late, frames


def test_response_times_count_from_the_very_frame_in_which_the_clip_is_drawn(
    server: ServerProcess, open_page: OpenPage
) -> None:
    page = open_page(viewport={"width": 480, "height": 320})
    page.context.add_init_script(f"({_WATCH_RENDERER})()")
    late, frames = errors_ms(join(page, server), N_QUERIES - 1)
    frame_ms = median(frames)
    print(
        f"\nfirst frame, page minus renderer: median {median(late):+.1f} ms, from {min(late):+.1f} "
        f"to {max(late):+.1f} ms over {len(late)} questions; a frame takes {frame_ms:.0f} ms"
    )
    # The rounding of response times to milliseconds, and of the browser's clock.
    assert abs(median(late)) < 1.5
    assert max(abs(each) for each in late) < 1.5 + frame_ms
