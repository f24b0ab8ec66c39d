"""How long a person waits for the next clip while many others answer at the same time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence
from dataclasses import dataclass
from http.cookiejar import CookieJar, DefaultCookiePolicy
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

import httpx
import numpy as np
from rich.progress import Progress
from websockets.exceptions import WebSocketException

from app.bench.browser import Browser, Diary, join, open_page
from app.bench.ledger import audit
from app.bench.report import BenchError, percentile, provenance
from app.bench.server import free_database, running_server
from app.bench.walk import prepare_sessions
from study_core.plan import Position
from study_core.streams import stream

_STUDY = "katz2021"
_MOST_ANSWERS_BEFORE = 150
_THINKING_S = (2.0, 6.0)
_LAST_CLIPS_S = 2.0
_ARRIVAL_GAP_S = 0.1
_TIMEOUT_S = 40.0


def run(seed: int, people: int, answers: int, progress: Progress) -> dict[str, Any]:
    """Lets simulated people answer at once against a server of its own, and counts and times.

    A browser knows nothing of features, so while the clock runs choices are drawn by a fair coin. That is the harder
    case for computing ahead, which begins with the likelier answer.

    Args:
        seed: Of the simulated people.
        people: How many are there at once; their sessions hold 0 to 150 answers when the clock starts.
        answers: How many they give together, at least.
        progress: Shows how far it is.

    Returns:
        Percentiles of the time from sending an answer to the last byte of the next clip, and to the reply; how many
        acknowledged answers the database has lost or doubled; and where it was measured.

    Raises:
        BenchError: The server doesn't start, refuses something or closes a stage.
    """
    if people < 1 or answers < 1:
        raise BenchError(f"Expected at least one person and one answer, got {people} and {answers}.")
    before = np.linspace(0, _MOST_ANSWERS_BEFORE, people).round().astype(int).tolist()
    with TemporaryDirectory(prefix="prefstudy-bench-") as folder:
        database = free_database(folder)
        tokens = prepare_sessions(database, _STUDY, seed, before, progress)
        with running_server(database, _STUDY) as link:
            crowd = _Crowd(link, seed, answers, progress)
            asyncio.run(crowd.gather(tokens))
        found = audit(database, crowd.diary)
    given = crowd.diary.answers
    waits_ms, replies_ms = found.waits_ms, [1e3 * (each.replied_at - each.sent_at) for each in given]
    return {
        "people": people,
        "answers": len(given),
        "p50_ms": percentile(waits_ms, 50),
        "p99_ms": percentile(waits_ms, 99),
        "max_ms": percentile(waits_ms, 100),
        "reply_p50_ms": percentile(replies_ms, 50),
        "reply_p99_ms": percentile(replies_ms, 99),
        "not_ready": sum(each.next_screen == "preparing" for each in given) / len(given),
        "resent": crowd.diary.n_resent,
        "clips_missing": found.n_clips_missing,
        "lost": found.n_lost,
        "doubled": found.n_doubled,
        "seconds": round(crowd.seconds, 1),
        "client_cpu_share": round(crowd.cpu_share, 3),
        **provenance(seed),
    }


@dataclass
class _Crowd:
    """Everybody, in one event loop."""

    link: str
    seed: int
    n_wanted: int
    progress: Progress
    seconds: float = 0.0
    cpu_share: float = 0.0

    def __post_init__(self) -> None:
        self.diary = Diary()
        self._n_begun = 0

    async def gather(self, tokens: Sequence[str]) -> None:
        """Brings everybody in, then starts the clock and lets them answer until there are enough answers."""
        parts = urlsplit(self.link)
        base = f"{parts.scheme}://{parts.netloc}"
        limits = httpx.Limits(max_connections=None, max_keepalive_connections=None)
        everyone_is_here = asyncio.Barrier(len(tokens) + 1)
        try:
            async with (
                httpx.AsyncClient(
                    base_url=base,
                    headers={"Origin": base},
                    limits=limits,
                    timeout=_TIMEOUT_S,
                    trust_env=False,
                    # One cookie jar for everybody would lead whoever joins anew into somebody else's session.
                    cookies=CookieJar(DefaultCookiePolicy(allowed_domains=[])),
                ) as http,
                asyncio.TaskGroup() as group,
            ):
                for number, token in enumerate(tokens):
                    group.create_task(self._stay(http, token, number, everyone_is_here))
                group.create_task(self._keep_time(everyone_is_here))
        except ExceptionGroup as failures:
            raise _first(failures) from failures

    async def _keep_time(self, everyone_is_here: asyncio.Barrier) -> None:
        """Measures from the moment when the last person has arrived to the last answer."""
        await everyone_is_here.wait()
        began, cpu_began = time.perf_counter(), time.process_time()
        task = self.progress.add_task("answers", total=self.n_wanted)
        while len(self.diary.answers) < self.n_wanted:
            await asyncio.sleep(0.5)
            self.progress.update(task, completed=len(self.diary.answers))
        self.seconds = time.perf_counter() - began
        self.cpu_share = (time.process_time() - cpu_began) / self.seconds

    async def _stay(
        self, http: httpx.AsyncClient, token: str, number: int, everyone_is_here: asyncio.Barrier
    ) -> None:
        """One person: answers until there are enough answers; at the end of a session joins anew."""
        rng = stream(self.seed, "bench-thinking", number)
        await asyncio.sleep(number * _ARRIVAL_GAP_S)
        async with open_page(http, token, self.diary) as browser:
            await browser.picture()
            await everyone_is_here.wait()
            await self._answer_all(browser, rng)
        while not self._is_enough():
            token = await join(http, _STUDY)
            async with open_page(http, token, self.diary) as browser:
                await self._answer_all(browser, rng)

    async def _answer_all(self, browser: Browser, rng: np.random.Generator) -> None:
        while (index := await browser.question()) is not None and not self._is_enough():
            thinking_s = rng.uniform(*_THINKING_S)
            await asyncio.sleep(thinking_s)
            self._n_begun += 1
            await browser.answer(index, list(Position)[rng.integers(2)], round(1e3 * thinking_s))
        await asyncio.sleep(_LAST_CLIPS_S)

    def _is_enough(self) -> bool:
        return self._n_begun >= self.n_wanted


def _first(failures: ExceptionGroup[Exception]) -> Exception:
    """Returns what went wrong first; the rest follows from it."""
    first = failures.exceptions[0]
    if isinstance(first, ExceptionGroup):
        return _first(first)
    if isinstance(first, httpx.HTTPError | WebSocketException | OSError):
        return BenchError(f"Expected the server to answer, got {type(first).__name__}: {first}.")
    return first
