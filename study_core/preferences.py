"""Answered queries as predictors see them: the states of both drives, and which was preferred."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from study_core.comparison import Choice, Query
from study_core.domain import Domain
from study_core.events import AnswerGiven, AnswerTakenBack, Event, QueryPrepared
from study_core.plan import Phase
from study_core.predictors.predictor import Pairs


def preferences(
    domain: Domain, events: Iterable[Event], phase: Phase
) -> tuple[Pairs, Float[np.ndarray, " n"]]:
    """Returns the pairs of which one was preferred, in the order they were asked, and what was preferred.

    Args:
        domain: Whose trajectories were compared.
        events: A log, or its part that has the answers wanted.
        phase: Answers to other queries are left out, and so are those that prefer neither.

    Returns:
        The n pairs, and +1 where A was preferred, -1 where B was.
    """
    preferred = [(query, choice.sign) for query, choice in _answered(events, phase) if choice.sign != 0.0]
    n_controls = len(domain.control_lower)
    controls_a, controls_b = (
        np.array([getattr(query, side) for query, _ in preferred]).reshape(-1, n_controls)
        for side in ("controls_a", "controls_b")
    )
    signs = np.array([sign for _, sign in preferred], dtype=np.float64)
    return Pairs(domain.rollout(controls_a), domain.rollout(controls_b)), signs


def _answered(events: Iterable[Event], phase: Phase) -> list[tuple[Query, Choice]]:
    """Returns the queries of a phase with the answers that were not taken back."""
    queries: dict[int, Query] = {}
    choices: dict[int, Choice] = {}
    for event in events:
        if isinstance(event, QueryPrepared) and event.phase is phase:
            queries[event.query_index] = event.proposed.query
        elif isinstance(event, AnswerGiven):
            choices[event.query_index] = event.choice
        elif isinstance(event, AnswerTakenBack):
            choices.pop(event.query_index, None)
    return [(queries[index], choices[index]) for index in sorted(queries) if index in choices]
