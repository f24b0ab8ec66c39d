"""What the database says about the answers that people were told are saved."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from dataclasses import dataclass

from app.bench.browser import Diary, SentAnswer
from app.continuation import scenes
from app.services.tokens import hash_token
from app.stage.clip import N_FLAGS, build_clip
from app.stage.framing import Layout
from app.store import Store, open_store
from study_core import session_codec
from study_core.comparison import Choice
from study_core.domain import Domain
from study_core.events import AnswerGiven, QueryPrepared
from study_core.plan import position_of
from study_core.study import parse_study


@dataclass(frozen=True)
class Audit:
    """What was found.

    Attributes:
        waits_ms: From sending an answer to the last byte of the next query's own clip, for each that has one.
        n_clips_missing: Answers whose next query was prepared, but whose clip never came.
        n_lost: Acknowledged answers that the log doesn't hold, or holds with another choice.
        n_doubled: Entries of the log beyond the first for one acknowledged answer.
    """

    waits_ms: list[float]
    n_clips_missing: int
    n_lost: int
    n_doubled: int


def audit(database: str, diary: Diary) -> Audit:
    """Compares what people saw with what is stored."""
    by_token: dict[str, list[SentAnswer]] = defaultdict(list)
    for answer in diary.answers:
        by_token[answer.token].append(answer)
    arrivals: dict[tuple[str, str], list[float]] = defaultdict(list)
    for clip in diary.clips:
        arrivals[clip.token, clip.digest].append(clip.at)
    audits = []
    with open_store(database) as store:
        for token, answers in by_token.items():
            audits.append(_audit_one(_Log(store, token), answers, arrivals))
    return Audit(
        [wait for each in audits for wait in each.waits_ms],
        sum(each.n_clips_missing for each in audits),
        sum(each.n_lost for each in audits),
        sum(each.n_doubled for each in audits),
    )


class _Log:
    """One session's log, by query index; choices are as the browser sent them."""

    def __init__(self, store: Store, token: str) -> None:
        self.choices: dict[int, list[str]] = defaultdict(list)
        self.clips: dict[int, set[str]] = {}
        sides: dict[int, Choice | None] = {}
        session = store.session_by_token(hash_token(token))
        if session is None:
            return
        study = parse_study(store.study_text(session.study_hash))
        for record in store.events(session.id):
            event = session_codec.from_json(record.kind, record.payload)
            if isinstance(event, AnswerGiven):
                position = position_of(sides[event.query_index], event.choice)
                self.choices[event.query_index].append(position or event.choice)
            elif isinstance(event, QueryPrepared):
                sides[event.query_index] = event.first_shown
                self.clips[event.query_index] = _digests(study.domain, event)


def _digests(domain: Domain, prepared: QueryPrepared) -> set[str]:
    """Returns the SHA-256 of every clip that shows a query from its beginning: they differ in their flags alone."""
    first, second = scenes(domain, prepared.proposed.query, prepared.side_shown_first)
    return {
        hashlib.sha256(
            build_clip(first, second, Layout.WIDE, mark=prepared.query_index, flag=flag)
        ).hexdigest()
        for flag in range(N_FLAGS)
    }


def _audit_one(log: _Log, answers: list[SentAnswer], arrivals: dict[tuple[str, str], list[float]]) -> Audit:
    waits_ms, n_missing, n_lost, n_doubled = [], 0, 0, 0
    for answer in answers:
        stored = log.choices[answer.query_index]
        n_lost += answer.choice not in stored
        n_doubled += max(0, len(stored) - 1)
        next_clip = log.clips.get(answer.query_index + 1)
        if next_clip is None:
            continue
        came = [at for digest in next_clip for at in arrivals[answer.token, digest]]
        shown_at = [at for at in came if at > answer.sent_at]
        if shown_at:
            waits_ms.append(1e3 * (min(shown_at) - answer.sent_at))
        else:
            n_missing += 1
    return Audit(waits_ms, n_missing, n_lost, n_doubled)
