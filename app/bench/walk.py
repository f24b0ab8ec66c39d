"""Sessions that are already under way: simulated people walked through the same services, without a server."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, as_completed

from rich.progress import Progress

import app.process  # noqa: F401  - before numpy, in a process of its own as well
from app import wiring
from app.services import study as services
from app.settings import find_study
from study_core.participants import draw_person
from study_core.streams import stream

_N_PROCESSES = 2
_RESPONSE_TIME_MS = 3000


def prepare_sessions(
    database: str, study_name: str, seed: int, answers: list[int], progress: Progress
) -> list[str]:
    """Fills a new database with sessions that hold so many answers each.

    Args:
        database: URL of the database.
        study_name: A study that ships.
        seed: Of the simulated people.
        answers: How many answers each session is to hold.
        progress: Shows how far it is.

    Returns:
        The secret token of each session, in the same order.
    """
    task = progress.add_task("sessions before the start", total=sum(answers))
    with wiring.headless(database) as runtime:
        runtime.open_study(find_study(study_name))
    # Forked processes would inherit locks that a thread may be holding just then.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(_N_PROCESSES, mp_context=context) as pool:
        longest_first = sorted(range(len(answers)), key=lambda number: -answers[number])
        walks = {
            pool.submit(walk_session, database, study_name, seed, number, answers[number]): number
            for number in longest_first
        }
        tokens = {}
        try:
            for walk in as_completed(walks):
                tokens[walks[walk]] = walk.result()
                progress.advance(task, answers[walks[walk]])
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [tokens[number] for number in range(len(answers))]


def walk_session(database: str, study_name: str, seed: int, number: int, n_answers: int) -> str:
    """Joins as a simulated person and gives so many answers; returns the session's token."""
    study = find_study(study_name)
    person = draw_person(seed, number, study.prior, study.response)
    rng = stream(seed, "bench-answers", number)
    with wiring.headless(database) as runtime:
        token, record = services.join(runtime, study, rehearsal=f"bench-{seed}-{number}")
        for _ in range(n_answers):
            prepared = runtime.live(record.id).state.prepared[-1]
            choice = person.choose(rng, prepared.proposed.query, prepared.side_shown_first)
            services.answer(runtime, record.id, prepared.query_index, choice.value, _RESPONSE_TIME_MS)
    return token
