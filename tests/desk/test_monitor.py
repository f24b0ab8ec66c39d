"""What the monitor says of a study is what its people's logs say."""

from __future__ import annotations

from dataclasses import replace

import pytest
from scipy.stats import binom

from app.services import path
from app.services.health import Health
from app.services.monitor import Overview, has_side_bias, overview, person_of
from app.services.summary import test_accuracy as accuracy_from_the_log
from app.store import Review, Role, Source, Standing, Verdict
from study_core.comparison import Choice
from study_core.path import Ending
from tests.desk.conftest import Opener
from tests.desk.laboratory import Laboratory

JOINED = (Source.JOINED,)
STANDING = Standing(0, 12, "", 0, 0, 0, 0, 12, 6, 18_000)


def test_held_out_accuracy_is_what_each_log_says(opened: Opener) -> None:
    with opened() as lab:
        people = [lab.completed(choice) for choice in (Choice.A, Choice.B)]
        lab.under_way()
        found = {person.line.session.id: person for person in _overview(lab).people}
        for session_id in people:
            live = lab.runtime.live(session_id)
            mean = lab.store.posteriors(session_id)[-1].mean
            assert found[session_id].accuracy == accuracy_from_the_log(live.study, live.state, mean)
            assert found[session_id].n_test == live.study.protocol.test_queries
        assert sum(person.accuracy is None for person in found.values()) == 1
        assert 0.0 < sum(person.accuracy or 0.0 for person in found.values()) < 2.0, (
            "A and B can't both be right"
        )


def test_everybody_is_where_their_path_says(opened: Opener) -> None:
    with opened(study="full-path") as lab:
        somebody = lab.under_way()
        assert person_of(lab.runtime, somebody).where == "Consent"
        assert person_of(lab.runtime, lab.participant()).where == "Welcome page"
        path.take_step(lab.runtime, somebody, 0, {path.ACCEPT: ["yes"]})
        assert person_of(lab.runtime, somebody).where == "Questionnaire: screening"
        path.end(lab.runtime, somebody, Ending.TIMED_OUT)
        assert person_of(lab.runtime, somebody).where == "Timed out"


def test_somebody_who_is_rejected_counts_no_more(opened: Opener) -> None:
    with opened() as lab:
        session_id = lab.completed()
        assert _overview(lab).summary.n_completed == 1
        lab.store.desk.put_review(session_id, Review(Verdict.REJECTED, "a bot"), "olga")
        assert _overview(lab).summary.n_completed == 0
        assert _overview(lab).arms[0].n_completed == 0


@pytest.mark.parametrize("n", [10, 16, 40, 175])
def test_a_side_bias_is_what_chance_hardly_ever_gives(n: int) -> None:
    flagged = [k for k in range(n + 1) if has_side_bias(k, n)]
    assert flagged, "nobody could ever be flagged"
    by_chance = sum(float(binom.pmf(k, n, 0.5)) for k in flagged)
    assert by_chance < 0.008
    least = max(k for k in range(n + 1) if not has_side_bias(k, n))
    assert float(binom.sf(least, n, 0.5)) < 0.004


def test_nobody_is_called_one_sided_after_a_few_answers() -> None:
    assert not any(has_side_bias(n, n) for n in range(10))


def test_signs_of_trouble_name_their_people_and_the_server_speaks_for_itself(
    opened: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    with opened() as lab:
        person = lab.under_way()
        (number,) = {lab.store.session(person).ordinal}
        lab.store.put_standing(person, 99, replace(STANDING, n_checks=2, n_checks_passed=1))
        (failed,) = [each for each in _overview(lab).troubles if "failed a check" in each.text]
        assert failed.numbers == (number,)
        lab.runtime.health.waited(0.5)
        assert not [trouble for trouble in _overview(lab).troubles if "waited" in trouble.text]
        lab.runtime.health.waited(7.0)
        lab.runtime.health.failed()
        monkeypatch.setattr("shutil.disk_usage", lambda _: _Disk())
        monkeypatch.setattr(lab.runtime.engine, "troubles", lambda: ["2 processes died."], raising=False)
        said = " ".join(trouble.text for trouble in _overview(lab).troubles)
        assert "1 time in the last ten minutes, somebody waited more than 2 s" in said
        assert "longest wait was 7 s" in said
        assert "couldn’t be computed, 1 time" in said
        assert "2 processes died." in said
        assert "Only 1.0 GB" in said
        with lab.browser(Role.VIEWER) as visitor:
            assert "2 processes died." in visitor.get("/desk/studies/quickstart").text


class _Disk:
    free = 1024**3


def test_what_was_long_ago_is_no_news() -> None:
    now = 0.0
    health = Health(lambda: now)
    health.waited(9.0)
    health.failed()
    now = 599.0
    assert health.lately().waits_s == (9.0,)
    now = 601.0
    assert health.lately().waits_s == ()
    assert health.lately().n_failures == 0


def _overview(lab: Laboratory) -> Overview:
    return overview(lab.runtime, lab.parts.study, lab.parts.study.name, JOINED)
