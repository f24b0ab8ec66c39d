"""A person's own result is their last posterior's mean as shares, with the drive that is best for it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from app import wiring
from app.services import study as services
from app.services.result import FEWEST_OTHERS, Result, result_of
from app.services.runtime import Runtime
from app.services.walk import Answerer, walk
from app.settings import find_study
from study_core.comparison import Choice
from study_core.events import AnswerGiven, QueryPrepared
from study_core.streams import stream

STUDY = find_study("full-path")
N_PEOPLE = FEWEST_OTHERS + 1


def whoever_likes(weights: np.ndarray, seed: int) -> Answerer:
    """Answers as somebody who prefers what w prefers, with a little chance."""
    rng = np.random.default_rng(seed)

    def answer(prepared: QueryPrepared) -> AnswerGiven:
        query = prepared.proposed.query
        gain = float((query.features_a - query.features_b) @ weights) + rng.normal(0.0, 0.01)
        return AnswerGiven(prepared.query_index, Choice.A if gain > 0.0 else Choice.B, 1500, 3)

    return answer


def go_through(runtime: Runtime, seed: int) -> str:
    _, record = services.join(runtime, STUDY)
    walk(runtime, record.id, whoever_likes(np.abs(np.random.default_rng(seed).normal(size=4)), seed))
    return record.id


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Runtime]:
    with wiring.headless(f"sqlite:///{tmp_path_factory.mktemp('result') / 'study.db'}") as opened:
        yield opened


@pytest.fixture(scope="module")
def people(runtime: Runtime) -> list[str]:
    """Everybody who has completed the study."""
    return [go_through(runtime, seed) for seed in range(N_PEOPLE)]


def result(runtime: Runtime, session_id: str) -> Result:
    found = result_of(runtime, runtime.live(session_id))
    assert found is not None
    return found


def shares(weights: np.ndarray) -> np.ndarray:
    return weights / np.abs(weights).sum()


def test_the_own_shares_are_those_of_the_last_posterior(runtime: Runtime, people: list[str]) -> None:
    mean = runtime.store.posteriors(people[0])[-1].mean
    own = result(runtime, people[0]).own.shares
    assert list(own) == list(STUDY.domain.feature_labels)
    np.testing.assert_allclose(list(own.values()), shares(mean), rtol=1e-12)
    assert sum(map(abs, own.values())) == pytest.approx(1.0)


def test_the_own_drive_beats_any_drive_of_chance(runtime: Runtime, people: list[str]) -> None:
    found = result(runtime, people[1])
    mean = runtime.store.posteriors(people[1])[-1].mean
    domain = STUDY.domain
    drives = stream(5, "any").uniform(domain.control_lower, domain.control_upper, (3000, 10))
    rewards = domain.features(domain.rollout(drives)) @ mean
    own = domain.features(domain.rollout(found.own.drive[None]))[0] @ mean
    assert own > rewards.max()


def test_the_others_are_everybody_else_who_is_through(runtime: Runtime, people: list[str]) -> None:
    found = result(runtime, people[2])
    others = [shares(runtime.store.posteriors(one)[-1].mean) for one in people if one != people[2]]
    assert found.others is not None
    assert found.n_others == len(others) == FEWEST_OTHERS
    average = np.mean(others, axis=0)
    np.testing.assert_allclose(list(found.others.shares.values()), shares(average), rtol=1e-12)


def test_fewer_others_are_not_averaged(runtime: Runtime, people: list[str]) -> None:
    runtime.store.delete_session(people[-1])
    found = result(runtime, people[0])
    assert (found.others, found.n_others) == (None, FEWEST_OTHERS - 1)


def test_whoever_has_not_answered_has_no_result(runtime: Runtime) -> None:
    _, record = services.join(runtime, STUDY)
    assert result_of(runtime, runtime.live(record.id)) is None


def test_rehearsals_are_nobody(runtime: Runtime) -> None:
    before = set(runtime.store.last_means(STUDY.hash))
    _, record = services.join(runtime, STUDY, rehearsal="somebody who is not")
    walk(runtime, record.id, whoever_likes(np.ones(4), 9))
    assert set(runtime.store.last_means(STUDY.hash)) == before
