"""One continuation, as the engine runs it: posterior, pair, two trajectories, clips. Pure, importable by name."""

from __future__ import annotations

import hashlib
import logging
import time
from collections.abc import Iterator
from importlib.metadata import version

from app.machine import machine
from app.services.continuation import Continuation, FeatureRequest, Request
from app.stage.clip import build_clip
from app.stage.framing import Layout
from study_core.comparison import Choice, ComparisonSet, Query
from study_core.domain import Domain
from study_core.errors import NetworkError
from study_core.events import FeatureLearned, QueryPrepared
from study_core.online.learn import learn_feature
from study_core.plan import Phase, Slot, plan_of
from study_core.posterior.run import Posterior
from study_core.queries import (
    ProposedQuery,
    infer_posterior,
    propose_active_query,
    propose_common_query,
    propose_test_set,
)
from study_core.scene import Scene
from study_core.study import Study, parse_study

CODE_VERSION = version("prefstudy")

log = logging.getLogger(__name__)


def continue_session(request: Request) -> Continuation:
    """Returns the next query of a session, ready to be shown."""
    started = time.perf_counter()
    study = parse_study(request.study_text).knowing(request.knowledge)
    posterior = None
    if request.needs_posterior:
        known = request.knowledge.add_to(study.domain, request.comparisons, request.compared)
        posterior = infer_posterior(study, request.participant, request.query_index, known)
    slot = plan_of(study, request.participant).slots[request.query_index]
    proposed = request.given_query or _propose(study, request, slot, posterior)
    clips = clip_digests(study.domain, proposed.query, slot.first_shown)
    compute_ms = 1000.0 * (time.perf_counter() - started)
    prepared = QueryPrepared(
        request.query_index,
        slot.phase,
        proposed,
        clips,
        CODE_VERSION,
        compute_ms,
        slot.first_shown,
        slot.repeat_of,
        slot.instructed,
        machine(),
    )
    return Continuation(prepared, posterior, request.learned)


def learn(request: FeatureRequest) -> FeatureLearned:
    """Returns what a session's answers have taught beyond the hand-coded features."""
    study = parse_study(request.study_text)
    feature = None
    try:
        feature = learn_feature(study, request.participant, request.n_queries, request.compared)
    except NetworkError:
        log.warning("%s: the training of a feature diverged; the session goes on without it", request.key)
    return FeatureLearned(request.query_index, request.n_queries, feature, CODE_VERSION, machine())


def _propose(study: Study, request: Request, slot: Slot, posterior: Posterior | None) -> ProposedQuery:
    if slot.phase is not Phase.ACTIVE:
        return propose_common_query(study, slot.phase.value, slot.number)
    assert posterior is not None, "an active query is chosen from a posterior"
    return propose_active_query(study, request.participant, request.query_index, posterior)


def test_set(study_text: str) -> tuple[ProposedQuery, ...]:
    """Returns the common test set of a study."""
    return propose_test_set(parse_study(study_text))


def clip_digests(domain: Domain, query: Query, first_shown: Choice) -> dict[str, str]:
    """Returns the SHA-256 of the clip that shows a query, in each layout."""
    clips = build_clips(domain, query, first_shown)
    return {
        layout.value: hashlib.sha256(clip).hexdigest() for layout, clip in zip(Layout, clips, strict=True)
    }


def build_clips(domain: Domain, query: Query, first_shown: Choice) -> Iterator[bytes]:
    """Gives the clip that shows a query, in each layout."""
    first, second = scenes(domain, query, first_shown)
    return (build_clip(first, second, layout) for layout in Layout)


def scenes(domain: Domain, query: Query, first_shown: Choice) -> tuple[Scene, Scene]:
    """Returns what stands in the first position on the screen, and in the second."""
    a, b = domain.scene(query.controls_a), domain.scene(query.controls_b)
    return (a, b) if first_shown is Choice.A else (b, a)


def warm_up(study_text: str) -> None:
    """Compiles every kernel that a session of the study uses, before the first person arrives."""
    for study in parse_study(study_text).arms:
        empty = ComparisonSet.empty(len(study.domain.feature_names))
        index = plan_of(study, 0).index_of_active(0)
        first = continue_session(Request(study.text, 0, index, empty, True, None))
        once = empty.append(first.prepared.proposed.query, Choice.A)
        continue_session(Request(study.text, 0, index, once, True, None))
