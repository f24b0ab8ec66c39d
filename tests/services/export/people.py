"""A few people with a bit of everything, for exports."""

from __future__ import annotations

from app import wiring
from app.services import path
from app.services import study as services
from app.services.rehearsal import rehearse
from app.services.rehearsed_person import Crowd
from app.services.walk import walk
from app.settings import find_study
from app.store import ExternalPerson, ModelRecord, NewEvent, Review, Source, Verdict, open_store
from study_core.events import AnswerGiven, QueryPrepared
from study_core.study import parse_study

QUICKSTART = find_study("quickstart")
FULL_PATH = find_study("full-path")
INFERRED = parse_study(
    QUICKSTART.text.replace("rationality = 200.0", 'rationality = "inferred"').replace(
        'name = "quickstart"', 'name = "inferred"'
    )
)
MEASURES = {
    "replays": 2,
    "viewport": [1280, 720],
    "frame_ms": 16.7,
    "means": "key",
    "pauses": {"odd": 1},
    "zoom": 2,
}
PROLIFIC = ExternalPerson("quickstart", "5f1a-prolific-pid", {"STUDY_ID": "study-at-prolific"})


def changeable(query: QueryPrepared) -> AnswerGiven:
    """Always the first position: who does so never agrees with themselves when sides are swapped."""
    assert query.first_shown is not None
    return AnswerGiven(query.query_index, query.first_shown, 700, 4)


def let_everybody_in(url: str) -> None:
    """Two rehearsed people; a real one who left after two answers; one who is sent by Prolific and stops; one in German
    who takes an answer back; one who declines; one of another study. Two of them have models, one is excluded."""
    with wiring.headless(url) as runtime:
        for number in (1, 2):
            rehearse(runtime, QUICKSTART, Crowd(5, 2), number, lambda: None)
        _, left = services.join(runtime, QUICKSTART)
        services.answer(runtime, left.id, 0, "a", 1234)
        services.answer(runtime, left.id, 1, "b", 2345)
        _, german = services.join(runtime, FULL_PATH, rehearsal="changes their mind")
        path.take_step(runtime, german.id, 0, {"accept": ["yes"]})
        path.choose_language(runtime, german.id, "de")
        path.take_step(runtime, german.id, 1, {"sees-animations": ["yes"]})
        path.take_step(runtime, german.id, 2, {})
        services.answer(runtime, german.id, 0, "a", 900, MEASURES, confidence=2)
        path.take_back(runtime, german.id, 0)
        walk(runtime, german.id, changeable)
        _, declined = services.join(runtime, FULL_PATH, rehearsal="declines")
        path.take_step(runtime, declined.id, 0, {"accept": ["no"]})
        _, inferring = services.join(runtime, INFERRED)
        services.answer(runtime, inferring.id, 0, "a", 1234)
    with open_store(url) as store:
        sent = store.create_session(QUICKSTART.hash, "token", Source.JOINED, None, PROLIFIC)
        begun = NewEvent("session_begun", {"participant": 99})
        stopped = NewEvent("session_ended", {"ending": "stopped"})
        store.append(sent.id, 0, [begun, stopped], ending="stopped")
        own = ModelRecord("a-predictor", "k1", b"\x08" + b"\0" * 20, {"sessions": [left.id], "n_answers": 2})
        store.put_personal_model(left.id, own)
        shared = ModelRecord("of-all", "k2", b'{"mean": [1.5]}', {"sessions": [left.id, sent.id]})
        store.put_shared_model("quickstart", shared, [left.id, sent.id])
        store.desk.put_review(
            left.id, Review(Verdict.EXCLUDED, "Left (5f1a-prolific-pid told so)."), "somebody"
        )
