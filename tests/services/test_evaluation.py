"""Who is evaluated, and what is said of those who aren't."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app import wiring
from app.services import study as services
from app.services.evaluation import NobodyToEvaluateError, people_to_evaluate
from app.services.published import import_person, read_people
from app.services.rehearsal import rehearse
from app.services.rehearsed_person import Crowd
from app.services.walk import walk
from app.settings import find_study
from app.store import Review, Store, Verdict
from study_core.comparison import Choice
from study_core.events import AnswerGiven
from study_core.study import parse_study
from tests.support.published import write_person

QUICKSTART = find_study("quickstart")


def import_people(store: Store, folder: Path, **n_active: int) -> dict[str, dict[str, np.ndarray]]:
    """Imports people of these numbers of active answers; returns what was written, by name."""
    written = {}
    for number, n in n_active.items():
        name = number.removeprefix("person_")
        written[name] = write_person(folder, int(name), n_active=n, n_test=5)
    for person in read_people(folder, lambda done, total: None):
        import_person(store, person)
    return written


def test_people_come_by_number_with_their_own_answers(store: Store, tmp_path: Path) -> None:
    written = import_people(store, tmp_path, person_12=17, person_3=14)
    found = people_to_evaluate(store)
    assert [person.name for person in found.people] == ["3", "12"]
    for person in found.people:
        content = written[person.name]
        np.testing.assert_allclose(person.training.pairs.states_a, content["active_states"][:, 0], atol=1e-9)
        np.testing.assert_allclose(person.test.pairs.states_b, content["test_states"][:, 1], atol=1e-9)
        np.testing.assert_array_equal(person.training.signs, content["active_signs"])
        np.testing.assert_array_equal(person.test.signs, content["test_signs"])
        np.testing.assert_allclose(found.posterior_samples[person.name], content["samples"][-1])
        np.testing.assert_allclose(person.training.stored_mean, content["samples"][-1].mean(axis=0))
    assert found.left_out == []


def test_somebody_with_too_few_answers_is_left_out_and_named(store: Store, tmp_path: Path) -> None:
    import_people(store, tmp_path, person_1=15, person_2=9)
    found = people_to_evaluate(store)
    assert [person.name for person in found.people] == ["1"]
    assert found.left_out == ["Person 2 has 9 active answers that prefer a side; 14 are needed."]


def test_an_empty_store_says_what_to_do(store: Store) -> None:
    with pytest.raises(NobodyToEvaluateError, match="Import or finish some sessions first"):
        people_to_evaluate(store)


def test_if_nobody_has_answered_enough_everybody_is_named(store: Store, tmp_path: Path) -> None:
    import_people(store, tmp_path, person_1=4, person_2=5)
    with pytest.raises(NobodyToEvaluateError, match=r"Person 1 has 4 .* Person 2 has 5 "):
        people_to_evaluate(store)


def test_rehearsed_people_and_those_who_are_still_at_it_are_not_evaluated(
    store: Store, database_url: str, tmp_path: Path
) -> None:
    import_people(store, tmp_path, person_1=15)
    with wiring.headless(database_url) as runtime:
        rehearse(runtime, QUICKSTART, Crowd(1, 1), 1, lambda: None)
        services.join(runtime, QUICKSTART)
    assert [person.name for person in people_to_evaluate(store).people] == ["1"]
    with pytest.raises(NobodyToEvaluateError):
        people_to_evaluate(store, "quickstart")


def test_people_of_two_studies_are_not_averaged(store: Store, database_url: str, tmp_path: Path) -> None:
    import_people(store, tmp_path, person_1=15)
    with wiring.headless(database_url) as runtime:
        _, record = services.join(runtime, QUICKSTART)
        walk(
            runtime,
            record.id,
            lambda asked: AnswerGiven(asked.query_index, list(Choice)[asked.query_index % 2], 900),
        )
    with pytest.raises(
        NobodyToEvaluateError, match=r"got katz2021-published and quickstart. Name one --study"
    ):
        people_to_evaluate(store)
    assert [person.name for person in people_to_evaluate(store, "katz2021-published").people] == ["1"]


def test_a_study_that_nobody_has_begun_is_named(store: Store, tmp_path: Path) -> None:
    import_people(store, tmp_path, person_1=15)
    with pytest.raises(NobodyToEvaluateError, match="Nobody here has begun a study named 'nosuch'"):
        people_to_evaluate(store, "nosuch")


def test_rehearsed_people_are_said_not_to_count(store: Store, database_url: str) -> None:
    with wiring.headless(database_url) as runtime:
        rehearse(runtime, QUICKSTART, Crowd(1, 1), 1, lambda: None)
    with pytest.raises(NobodyToEvaluateError, match="rehearsed people count only with"):
        people_to_evaluate(store)


def test_rehearsed_people_can_try_the_evaluation_out_on_their_own(store: Store, database_url: str) -> None:
    longer = parse_study(QUICKSTART.text.replace("active_queries = 8 ", "active_queries = 18 "))
    with wiring.headless(database_url) as runtime:
        for number in (1, 2):
            rehearse(runtime, longer, Crowd(3, 2), number, lambda: None)
    found = people_to_evaluate(store, "quickstart", are_rehearsed=True)
    assert [person.name for person in found.people] == ["rehearsal-3-1", "rehearsal-3-2"]


def test_whoever_was_excluded_is_left_out_with_the_reason(store: Store, tmp_path: Path) -> None:
    import_people(store, tmp_path, person_1=15, person_2=16)
    second = store.sessions()[1]
    store.desk.put_review(second.id, Review(Verdict.EXCLUDED, "fell asleep"), "ann")
    found = people_to_evaluate(store)
    assert [person.name for person in found.people] == ["1"]
    assert found.left_out == ["Person 2 was excluded: fell asleep."]
