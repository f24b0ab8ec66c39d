import hashlib

import pytest

from app.bench.browser import Diary, SentAnswer, ShownClip
from app.bench.ledger import audit
from app.bench.walk import walk_session
from app.services.tokens import hash_token
from app.stage.clip import build_clip
from app.stage.framing import Layout
from app.store import open_store
from study_core import session_codec
from study_core.comparison import Choice
from study_core.domains.driving.domain import DRIVING_V1
from study_core.events import AnswerGiven, QueryPrepared

N_ANSWERS = 2


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """A session with two answers: its database, its token, the answers and the clips."""
    database = f"sqlite:///{tmp_path_factory.mktemp('walked') / 'study.db'}"
    token = walk_session(database, "quickstart", seed=1, number=1, n_answers=N_ANSWERS)
    with open_store(database) as store:
        session = store.session_by_token(hash_token(token))
        events = [session_codec.from_json(each.kind, each.payload) for each in store.events(session.id)]
    queries = [event for event in events if isinstance(event, QueryPrepared)]
    chosen = [event.choice for event in events if isinstance(event, AnswerGiven)]
    # What the browser sent: where the chosen drive stood.
    positions = [
        "first" if choice is query.first_shown else "second"
        for choice, query in zip(chosen, queries, strict=False)
    ]
    return database, token, positions, [arrived(query) for query in queries]


def arrived(query):
    """The digest of a query's clip as a stage sends it, with some flag."""
    a, b = (DRIVING_V1.scene(getattr(query.proposed.query, side)) for side in ("controls_a", "controls_b"))
    first, second = (a, b) if query.first_shown is Choice.A else (b, a)
    clip = build_clip(first, second, Layout.WIDE, mark=query.query_index, flag=1 + query.query_index)
    return hashlib.sha256(clip).hexdigest()


def sent(token, query_index, choice):
    return SentAnswer(token, query_index, choice, float(query_index), query_index + 0.1, "question")


def test_a_walked_session_holds_the_answers_and_the_query_after_them(walked):
    _, _, choices, clips = walked
    assert len(choices) == N_ANSWERS
    assert len(clips) == N_ANSWERS + 1


def test_the_wait_is_from_the_answer_to_the_next_query_s_own_clip(walked):
    database, token, choices, clips = walked
    answers = [sent(token, index, choice) for index, choice in enumerate(choices)]
    shown = [
        ShownClip(token, clips[1], 0.02),
        ShownClip(token, "another clip", 1.01),
        ShownClip(token, clips[2], 1.03),
        ShownClip(token, clips[2], 1.5),
    ]
    found = audit(database, Diary(answers, shown))
    assert found.waits_ms == pytest.approx([20.0, 30.0])
    assert (found.n_clips_missing, found.n_lost, found.n_doubled) == (0, 0, 0)


def test_a_clip_that_came_to_somebody_else_is_missing(walked):
    database, token, choices, clips = walked
    shown = [ShownClip("another token", clips[1], 0.02)]
    assert audit(database, Diary([sent(token, 0, choices[0])], shown)).n_clips_missing == 1


def test_an_acknowledged_answer_that_is_not_stored_is_lost(walked):
    database, token, choices, _ = walked
    other = "second" if choices[0] == "first" else "first"
    assert audit(database, Diary([sent(token, 0, other)])).n_lost == 1
    assert audit(database, Diary([sent(token, N_ANSWERS, "a")])).n_lost == 1
    assert audit(database, Diary([sent("unknown", 0, "a")])).n_lost == 1
