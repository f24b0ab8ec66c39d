"""People are spread over conditions so that as many complete each, whoever leaves on the way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from app import wiring
from app.services import path
from app.services import study as services
from app.services.joining import Door, Visit
from app.services.links import Invitation
from app.services.rehearsed_person import Crowd, RehearsedPerson
from app.services.runtime import Runtime
from app.services.tokens import hash_token, new_token
from app.services.walk import walk
from app.settings import find_study
from app.store import Review, Verdict
from study_core.path import Ending
from study_core.study import Study, parse_study

ARMS = ("gain", "random", "realistic")
STUDY = parse_study(
    find_study("quickstart")
    .text.replace("active_queries = 8 ", "active_queries = 1 ")
    .replace("test_queries = 4 ", "test_queries = 0 ")
    + "\n".join(
        f'[[condition]]\nname = "{name}"\nacquisition.method = "{method}"\n'
        for name, method in zip(
            ARMS, ("information-gain", "random", "information-gain-realistic"), strict=True
        )
    )
)
ANYBODY = Invitation(None, is_signed=False)


@pytest.fixture
def runtime(database_url: str) -> Iterator[Runtime]:
    with wiring.headless(database_url) as opened:
        yield opened


def join(runtime: Runtime, door: Door) -> str:
    token = new_token()
    assert door.join(Visit(ANYBODY, None), token).token == token
    session = runtime.store.session_by_token(hash_token(token))
    assert session is not None
    return session.id


def complete(runtime: Runtime, session_id: str, number: int) -> None:
    person = RehearsedPerson(Crowd(1, 400), runtime.live(session_id).study, number)
    walk(runtime, session_id, person.answer, fill=person.fill)


def completed(runtime: Runtime) -> Counter[str | None]:
    return Counter(
        line.condition
        for line in runtime.store.person_lines(STUDY.name)
        if line.ending == "completed" and line.review.verdict is None
    )


@pytest.mark.slow
def test_of_400_people_of_whom_a_third_leave_as_many_complete_each_condition(runtime: Runtime) -> None:
    door, rng = Door(runtime, STUDY), np.random.default_rng(1)
    under_way: list[str] = []
    for number in range(1, 401):
        under_way.append(join(runtime, door))
        # About eight people are there at the same time, and any of them may be next to finish or to leave.
        while len(under_way) > 8 or (number == 400 and under_way):
            one = under_way.pop(int(rng.integers(len(under_way))))
            if rng.random() < 1 / 3:
                path.end(runtime, one, Ending.STOPPED)
            else:
                complete(runtime, one, number)
    counts = completed(runtime)
    assert 230 < sum(counts.values()) < 300
    assert max(counts.values()) - min(counts.values()) <= 2


def test_who_comes_to_which_condition_is_not_an_order_that_can_be_foreseen(runtime: Runtime) -> None:
    door = Door(runtime, STUDY)
    conditions = [runtime.live(join(runtime, door)).study.condition for _ in range(30)]
    blocks = [tuple(conditions[i : i + 3]) for i in range(0, 30, 3)]
    assert all(sorted(block) == sorted(ARMS) for block in blocks)
    assert len(set(blocks)) > 2


def test_whoever_is_rejected_or_excluded_frees_their_place(runtime: Runtime) -> None:
    door = Door(runtime, STUDY)
    first, second, third = (join(runtime, door) for _ in range(3))
    for number, one in enumerate((first, second, third)):
        complete(runtime, one, number + 1)
    runtime.store.desk.put_review(second, Review(Verdict.EXCLUDED, "asleep"), "ann")
    missing = runtime.live(second).study.condition
    assert runtime.live(join(runtime, door)).study.condition == missing


def test_a_page_never_says_in_which_condition_somebody_is(runtime: Runtime) -> None:
    session_id = join(runtime, Door(runtime, STUDY))
    screen = services.screen(runtime, session_id)
    assert not any(name in repr(screen) for name in ARMS)


def test_a_session_keeps_its_condition_over_a_restart(runtime: Runtime) -> None:
    session_id = join(runtime, Door(runtime, STUDY))
    before: Study = runtime.live(session_id).study
    runtime.forget(session_id)
    after: Study = runtime.live(session_id).study
    assert (after.condition, after.hash, after.version) == (before.condition, before.hash, STUDY.version)
    assert after.file.acquisition.method == before.file.acquisition.method
