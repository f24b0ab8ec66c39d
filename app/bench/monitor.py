"""How long an experimenter waits for the monitor of a study with many people."""

from __future__ import annotations

import time
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

import httpx
from rich.progress import Progress

from app.bench.report import BenchError, percentile, provenance
from app.bench.server import free_database, running_server
from app.desk.admission import COOKIE, LIVE
from app.services.tokens import hash_token, new_token
from app.settings import find_study
from app.store import ExternalPerson, Role, Source, Standing, Store, open_store
from study_core.streams import stream
from study_core.study import Study

_STUDY = "katz2021"
_OWNER = "bench"
_SOME_HAVE_ENDED = 0.8


def run(seed: int, people: int, loads: int, progress: Progress) -> dict[str, Any]:
    """Loads the monitor of a study in which everybody stands somewhere, from a server of its own.

    Args:
        seed: Of where people stand.
        people: How many there are.
        loads: How often each page is loaded.
        progress: Shows how far it is.

    Returns:
        Percentiles of the time from the request to the last byte, in ms, of the monitor at first, as it keeps
        itself up to date, sorted by held-out accuracy, and of the JSON API's list; the monitor's size; and where it was
        measured.

    Raises:
        BenchError: The server doesn't start, or refuses something.
    """
    study, secret = find_study(_STUDY), new_token()
    with TemporaryDirectory(prefix="prefstudy-bench-") as folder:
        database = free_database(folder)
        with open_store(database) as store:
            _fill(store, study, seed, people, progress)
            store.desk.add_experimenter(_OWNER, "nobody logs in with it", Role.OWNER)
            store.desk.begin_login(_OWNER, hash_token(secret))
        with running_server(database, _STUDY) as link:
            parts = urlsplit(link)
            with httpx.Client(base_url=f"{parts.scheme}://{parts.netloc}", timeout=60.0) as browser:
                browser.headers["Cookie"] = f"{COOKIE}={secret}"
                result = _measure(browser, loads, progress)
    return {"people": people, "answers_each": study.n_queries, **result, **provenance(seed)}


def _fill(store: Store, study: Study, seed: int, people: int, progress: Progress) -> None:
    """Keeps people as the server itself would leave them, but for their logs, which no monitor reads."""
    rng = stream(seed, "monitor-people")
    store.put_study(study.hash, study.name, study.text, study.version, None)
    task = progress.add_task("people", total=people)
    n_test = study.protocol.test_queries
    for number in range(people):
        person = ExternalPerson(study.name, f"person-{number:05d}")
        session = store.create_session(study.hash, hash_token(new_token()), Source.JOINED, person=person)
        has_ended = rng.random() < _SOME_HAVE_ENDED
        n_answers = study.n_queries if has_ended else int(rng.integers(study.n_queries))
        n_sided, n_done = n_answers, max(0, n_answers - study.first_test)
        standing = Standing(
            step=len(study.file.path) - 1,
            n_answers=n_answers,
            test_answers="".join(rng.choice(["a", "b"], min(n_done, n_test))),
            n_repeats=0,
            n_repeats_agreed=0,
            n_checks=0,
            n_checks_passed=0,
            n_sided=n_sided,
            n_first=int(rng.binomial(n_sided, 0.5)),
            response_ms=int(rng.normal(4000.0, 600.0) * n_answers),
            r_hat=1.0 + abs(rng.normal(0.0, 0.02)),
            ess=float(rng.normal(1500.0, 300.0)),
            mean=rng.normal(size=len(study.domain.feature_names)),
        )
        store.put_standing(session.id, 2 * n_answers + 1, standing)
        progress.advance(task)


def _measure(browser: httpx.Client, loads: int, progress: Progress) -> dict[str, Any]:
    monitor = f"/desk/studies/{_STUDY}"
    places: dict[str, tuple[str, dict[str, str]]] = {
        "monitor": (monitor, {}),
        "update": (monitor, {LIVE: "1"}),
        "sorted": (f"{monitor}?sort=-accuracy", {}),
        "api": (f"/api/v1/studies/{_STUDY}/people", {}),
    }
    task = progress.add_task("loads", total=loads * len(places))
    result: dict[str, Any] = {}
    for name, (path, headers) in places.items():
        _load(browser, path, headers)
        times_ms = []
        for _ in range(loads):
            times_ms.append(_load(browser, path, headers))
            progress.advance(task)
        result[f"{name}_ms"] = {"p50": percentile(times_ms, 50), "p99": percentile(times_ms, 99)}
    result["monitor_bytes"] = len(browser.get(monitor).content)
    return result


def _load(browser: httpx.Client, path: str, headers: dict[str, str]) -> float:
    """Returns how long a page took, in ms."""
    begun = time.perf_counter()
    answer = browser.get(path, headers=headers)
    if answer.status_code != 200:
        raise BenchError(f"Expected the page {path}, got the status {answer.status_code}.")
    return 1000.0 * (time.perf_counter() - begun)
