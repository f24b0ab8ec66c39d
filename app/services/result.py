"""A person's own result: what matters to them, as last inferred, and the drive that their model likes best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.services.runtime import LiveSession, Runtime
from study_core.queries import best_trajectories
from study_core.streams import stream
from study_core.study import Study

FEWEST_OTHERS = 5
"""An average of fewer people would tell too much of each."""


@dataclass(frozen=True, eq=False)
class Taste:
    """What matters to somebody.

    Attributes:
        shares: What each feature matters, by its label; the sizes add up to 1, and below 0 its opposite is liked.
        drive: Controls of the trajectory that is best for these weights, shape `(n_controls,)`.
    """

    shares: dict[str, float]
    drive: Float[np.ndarray, " n_controls"]


@dataclass(frozen=True, eq=False)
class Result:
    """A person's own result.

    Attributes:
        own: What matters to the person.
        others: What matters to the others on average; None while they are fewer than `FEWEST_OTHERS`.
        n_others: How many others have completed the study.
    """

    own: Taste
    others: Taste | None
    n_others: int


def result_of(runtime: Runtime, live: LiveSession) -> Result | None:
    """Returns a session's result, or None if nothing has been inferred in it.

    Args:
        runtime: The services' resources.
        live: The session.
    """
    state, base = live.state, live.study
    weights = runtime.store.last_mean(live.record.id)
    if weights is None or not np.any(weights):
        return None
    own = _taste(base.knowing(state.knowledge), weights)
    means = runtime.store.last_means(base.hash)
    means.pop(live.record.id, None)
    others = None if len(means) < FEWEST_OTHERS else _taste(base, _average(base, list(means.values())))
    return Result(own, others, len(means))


def _average(study: Study, weights: list[np.ndarray]) -> Float[np.ndarray, " n_features"]:
    """Returns the mean of people's shares; what each has learned besides is their own, and left out."""
    n_features = len(study.domain.feature_names)
    shares: np.ndarray = np.mean([_shares(one[:n_features]) for one in weights], axis=0)
    return shares


def _taste(study: Study, weights: Float[np.ndarray, " n_features"]) -> Taste:
    rng = stream(study.seed, "result")
    best = best_trajectories(study, rng, weights[None, :])
    labels = study.rewards.domain.feature_labels
    return Taste(dict(zip(labels, _shares(weights).tolist(), strict=True)), best.controls[0])


def _shares(weights: Float[np.ndarray, " n_features"]) -> Float[np.ndarray, " n_features"]:
    size = np.abs(weights).sum()
    return weights / size if size > 0.0 else weights
