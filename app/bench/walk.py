"""Sessions that are already under way: simulated people walked through the same services, without a server."""

from __future__ import annotations

import app.process  # noqa: F401  # isort: skip - before numpy

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass

from app import wiring
from app.bench.person import Person
from app.bench.report import BenchError, Progress
from app.services import study as services
from app.services.runtime import Runtime
from app.settings import find_study
from study_core.comparison import Query

_N_PROCESSES = 2
_RESPONSE_TIME_MS = 3000
_LONGEST_WAIT_S = 60.0


@dataclass(frozen=True)
class Walk:
    """A session to be walked up to somewhere.

    Attributes:
        token: The person's secret.
        session_id: The session.
        number: Which simulated person.
        n_answers: How many answers it is to hold.
    """

    token: str
    session_id: str
    number: int
    n_answers: int


def prepare_sessions(
    database: str, study_name: str, seed: int, answers: list[int], progress: Progress
) -> list[str]:
    """Fills a new database with sessions that hold so many answers each.

    Args:
        database: URL of the database.
        study_name: A study that ships.
        seed: Of the simulated people.
        answers: How many answers each session is to hold.
        progress: Told how far it is.

    Returns:
        The secret token of each session, in the same order.
    """
    walks = _join_everyone(database, study_name, answers)
    # Workers that are forked would inherit locks of the threads that joining has started.
    context = multiprocessing.get_context("spawn")
    done, total = 0, sum(answers)
    progress("answers before the start", done, total)
    with ProcessPoolExecutor(_N_PROCESSES, mp_context=context) as pool:
        longest_first = sorted(walks, key=lambda walk: -walk.n_answers)
        futures = {
            pool.submit(walk_session, database, study_name, seed, walk): walk for walk in longest_first
        }
        try:
            for future in as_completed(futures):
                future.result()
                done += futures[future].n_answers
                progress("answers before the start", done, total)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [walk.token for walk in walks]


def walk_session(database: str, study_name: str, seed: int, walk: Walk) -> None:
    """Answers a session's queries until it holds as many answers as it should."""
    person = Person(find_study(study_name), seed, walk.number)
    with wiring.headless(database) as runtime:
        for index in range(walk.n_answers):
            query = _await_query(runtime, walk.session_id)
            choice = person.choose(query)
            services.answer(runtime, walk.session_id, index, choice, _RESPONSE_TIME_MS)
        _await_query(runtime, walk.session_id)


def _join_everyone(database: str, study_name: str, answers: list[int]) -> list[Walk]:
    """Creates the sessions one after the other, so that their numbers, which seed them, are always the same."""
    study = find_study(study_name)
    walks = []
    with wiring.headless(database) as runtime:
        for number, n_answers in enumerate(answers, start=1):
            token, record = services.join(runtime, study, is_rehearsed=True)
            walks.append(Walk(token, record.id, number, n_answers))
    return walks


def _await_query(runtime: Runtime, session_id: str) -> Query:
    """Returns the query on the stage; the first one is computed in the background."""
    give_up_at = time.monotonic() + _LONGEST_WAIT_S
    while time.monotonic() < give_up_at:
        found = services.current_query(runtime, session_id)
        if found is not None:
            return found[2]
        services.screen(runtime, session_id)
        time.sleep(0.005)
    raise BenchError(f"Expected a query within {_LONGEST_WAIT_S:.0f} s, got none. See the messages above.")
