"""The paper's whole study, 175 queries, by a scripted browser: nothing breaks; prints the waits and what grows."""

from __future__ import annotations

import json
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
N_BETWEEN = 25
"""Queries from one look at the page's memory to the next."""
REST_MS = 1000
"""By then what the last change needed has been let go."""
N_SETTLED = 100
"""By then the server's caches, the database's first among them, are full, so that what grows is a leak."""

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
    """What the objects of the page and its stage take; what the browser compiles and notes of them isn't counted."""
    chunks: list[str] = []

    def keep(event: dict[str, str]) -> None:
        chunks.append(event["chunk"])

    devtools.on("HeapProfiler.addHeapSnapshotChunk", keep)
    devtools.send("HeapProfiler.collectGarbage")
    devtools.send("HeapProfiler.takeHeapSnapshot", {"reportProgress": False})
    devtools.remove_listener("HeapProfiler.addHeapSnapshotChunk", keep)
    heap = json.loads("".join(chunks))
    fields, [kinds, *_] = heap["snapshot"]["meta"]["node_fields"], heap["snapshot"]["meta"]["node_types"]
    nodes = np.array(heap["nodes"]).reshape(-1, len(fields))
    is_counted = ~np.isin(nodes[:, fields.index("type")], [kinds.index("code"), kinds.index("native")])
    return int(nodes[is_counted, fields.index("self_size")].sum())


def server_bytes(server: ServerProcess) -> int:
    """Resident memory of the web server's process."""
    status = Path(f"/proc/{server.process.pid}/status").read_text()
    return 1024 * int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS:")))


def growth_per_query(sizes: dict[int, int]) -> float:
    """Slope of a line through the sizes by query, in bytes a query."""
    return float(np.polyfit(list(sizes), list(sizes.values()), 1)[0])


def test_the_whole_study_in_a_browser(katz2021: ServerProcess, open_page: OpenPage) -> None:
    person = join(open_page(), katz2021, STUDY.name)
    devtools = person.page.context.new_cdp_session(person.page)
    waits_ms: list[float] = []
    of_page: dict[int, int] = {}
    of_server: dict[int, int] = {}
    rng = np.random.default_rng(175)
    sees_question(person, 1)
    for number in range(1, STUDY.n_queries):
        waits_ms.append(person.page.evaluate(_WAIT_FOR_NEXT, ["ab"[rng.integers(2)], number + 1]))
        of_server[number] = server_bytes(katz2021)
        if number % N_BETWEEN == 0:
            person.page.wait_for_timeout(REST_MS)
            of_page[number] = page_bytes(devtools)
    person.presses("a")
    person.sees_the_end()
    settled = {number: size for number, size in of_server.items() if number >= N_SETTLED}
    report(waits_ms, of_page, of_server, settled)
    assert person.problems == []
    assert len(person.answers()) == STUDY.n_queries
    # A page or server that kept the clips would grow by some 60,000 a query.
    assert growth_per_query(of_page) < 3_000
    assert growth_per_query(of_server) < 60_000
    assert growth_per_query(settled) < 50_000


def sees_question(person: Person, number: int) -> None:
    person.page.wait_for_function(
        "(number) => document.querySelector('#count').textContent.includes(` ${number} `)"
        " && !document.querySelector('#answer-first').disabled",
        arg=number,
        timeout=WAIT_MS,
    )


def report(
    waits_ms: list[float], of_page: dict[int, int], of_server: dict[int, int], settled: dict[int, int]
) -> None:
    print(
        f"\n{len(waits_ms)} next questions: median {np.median(waits_ms):.0f} ms, "
        f"90 % within {np.quantile(waits_ms, 0.9):.0f} ms"
    )
    for name, sizes in (("page", of_page), ("server", of_server), ("server, settled", settled)):
        (first, *_), (*_, last) = sizes, sizes
        print(
            f"{name}: {sizes[first] / 1e6:.2f} MB after {first} queries, {sizes[last] / 1e6:.2f} MB after {last}, "
            f"{growth_per_query(sizes):+.0f} bytes a query"
        )
