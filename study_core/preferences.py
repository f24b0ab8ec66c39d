"""Answered queries as predictors see them: the states of both drives, and which was preferred."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from study_core.domain import Domain
from study_core.predictors.predictor import Pairs
from study_core.session import AnswerGiven, QueryPrepared


def preferences(
    domain: Domain, prepared: Iterable[QueryPrepared], answers: Iterable[AnswerGiven]
) -> tuple[Pairs, Float[np.ndarray, " n"]]:
    """Returns the pairs of which one was preferred, in the order they were asked, and what was preferred.

    Args:
        domain: Whose trajectories were compared.
        prepared: Queries.
        answers: To the first of them, in their order; those that prefer neither are left out.

    Returns:
        The n pairs, and +1 where A was preferred, -1 where B was.
    """
    preferred = [
        (query.proposed.query, given.choice.sign)
        # The last query may still wait for its answer.
        for query, given in zip(prepared, answers, strict=False)
        if given.choice.sign != 0.0
    ]
    n_controls = len(domain.control_lower)
    controls_a, controls_b = (
        np.array([getattr(query, side) for query, _ in preferred]).reshape(-1, n_controls)
        for side in ("controls_a", "controls_b")
    )
    signs = np.array([sign for _, sign in preferred], dtype=np.float64)
    return Pairs(domain.rollout(controls_a), domain.rollout(controls_b)), signs
