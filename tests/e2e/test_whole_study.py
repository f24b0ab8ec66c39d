"""The paper's whole study, 175 queries, by a scripted browser: nothing breaks; prints the waits and what grows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import CDPSession

from app.settings import find_study
from tests.e2e.conftest import OpenPage
from tests.e2e.person import WAIT_MS, Person, join
from tests.support.server import ServerProcess, running_server

pytestmark = [pytest.mark.browser, pytest.mark.slow]

STUDY = find_study("katz2021")
N_SETTLED = 20
"""So many queries until everything that is kept is there."""

# From the press of a key to the first animation frame in which the next question can be answered.
_WAIT_FOR_NEXT = """([key, number]) => new Promise((done) => {
  const began = performance.now();
  const isNext = () => document.querySelector("#count").textContent.includes(` ${number} `)
    && !document.querySelector("#answer-first").disabled;
  const look = () => isNext() ? done(performance.now() - began) : requestAnimationFrame(look);
  document.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
  requestAnimationFrame(look);
})"""


@pytest.fixture
def katz2021(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    with running_server(tmp_path_factory.mktemp("whole"), "katz2021") as started:
        yield started


def page_bytes(devtools: CDPSession) -> int:
    """What the page's objects take, after everything that nobody needs has been let go."""
    devtools.send("HeapProfiler.collectGarbage")
    metrics = {one["name"]: one["value"] for one in devtools.send("Performance.getMetrics")["metrics"]}
    return int(metrics["JSHeapUsedSize"])


def server_bytes(server: ServerProcess) -> int:
    """Resident memory of the web server's process."""
    status = Path(f"/proc/{server.process.pid}/status").read_text()
    return 1024 * int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS:")))


def growth_per_query(sizes: list[int]) -> float:
    """Slope of a line through the sizes, in bytes a query."""
    return float(np.polyfit(np.arange(len(sizes)), sizes, 1)[0])


def test_the_whole_study_in_a_browser(katz2021: ServerProcess, open_page: OpenPage) -> None:
    person = join(open_page(), katz2021, STUDY.name)
    devtools = person.page.context.new_cdp_session(person.page)
    devtools.send("Performance.enable")
    waits_ms, of_page, of_server = [], [], []
    rng = np.random.default_rng(175)
    sees_question(person, 1)
    for number in range(1, STUDY.n_queries + 1):
        key = "ab"[rng.integers(2)]
        if number == STUDY.n_queries:
            person.presses(key)
            break
        waits_ms.append(person.page.evaluate(_WAIT_FOR_NEXT, [key, number + 1]))
        if number > N_SETTLED:
            of_page.append(page_bytes(devtools))
            of_server.append(server_bytes(katz2021))
    person.sees_the_end()
    report(waits_ms, of_page, of_server)
    assert person.problems == []
    assert len(person.answers()) == STUDY.n_queries
    # Wide bounds, set by what was seen: they tell of a page or server that keeps every clip (some 60 kB), not of less.
    assert growth_per_query(of_page) < 30_000
    assert growth_per_query(of_server) < 60_000


def sees_question(person: Person, number: int) -> None:
    person.page.wait_for_function(
        "(number) => document.querySelector('#count').textContent.includes(` ${number} `)"
        " && !document.querySelector('#answer-first').disabled",
        arg=number,
        timeout=WAIT_MS,
    )


def report(waits_ms: list[float], of_page: list[int], of_server: list[int]) -> None:
    print(
        f"\n{len(waits_ms)} next questions: median {np.median(waits_ms):.0f} ms, "
        f"90 % within {np.quantile(waits_ms, 0.9):.0f} ms; "
        f"page {of_page[0] / 1e6:.1f} to {of_page[-1] / 1e6:.1f} MB, {growth_per_query(of_page):+.0f} bytes a query; "
        f"server {of_server[0] / 1e6:.1f} to {of_server[-1] / 1e6:.1f} MB, "
        f"{growth_per_query(of_server):+.0f} bytes a query"
    )
