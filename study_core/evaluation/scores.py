"""How good predicted probabilities are: accuracy, log loss, calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.errors import TooFewAnswersError

# A prediction of 0 or 1 that fails is a certain loss; no predictor here claims more than this.
_MOST_CERTAIN = 1.0 - 1e-12


@dataclass(frozen=True)
class Scores:
    """How well one person's answers were predicted.

    Attributes:
        accuracy: Share of answers whose preferred trajectory was the likelier one; a tie counts half.
        log_loss: Mean of -log P(answer), in nats; 0.693 is a coin's.
        expected_accuracy: Mean probability of the likelier one: the accuracy that the predictor itself expects.
    """

    accuracy: float
    log_loss: float
    expected_accuracy: float


def preferred_probabilities(
    probabilities_of_a: Float[np.ndarray, " n"], signs: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Returns the probability that was given to each answer that came."""
    return np.where(signs > 0.0, probabilities_of_a, 1.0 - probabilities_of_a)


def score(probabilities_of_a: Float[np.ndarray, " n"], signs: Float[np.ndarray, " n"]) -> Scores:
    """Returns the scores of predictions.

    Args:
        probabilities_of_a: Predicted probability that A is preferred.
        signs: +1 where A was preferred, -1 where B was.

    Raises:
        TooFewAnswersError: There is nothing to score.
        ValueError: A prediction is not a probability.
    """
    if len(signs) == 0:
        raise TooFewAnswersError("Expected at least one answer to score, got none. Leave this person out.")
    if not ((probabilities_of_a >= 0.0) & (probabilities_of_a <= 1.0)).all():
        raise ValueError("Expected probabilities from 0 to 1. The predictor has failed.")
    likely = preferred_probabilities(probabilities_of_a, signs)
    certain = np.clip(likely, 1.0 - _MOST_CERTAIN, _MOST_CERTAIN)
    return Scores(
        accuracy=float(np.mean(0.5 * (1.0 + np.sign(likely - 0.5)))),
        log_loss=float(-np.log(certain).mean()),
        expected_accuracy=float(np.maximum(probabilities_of_a, 1.0 - probabilities_of_a).mean()),
    )


@dataclass(frozen=True)
class CalibrationBin:
    """Predictions of about the same confidence.

    Attributes:
        confidence: Mean probability of the likelier trajectory.
        accuracy: Share of them that was right.
        n: How many.
    """

    confidence: float
    accuracy: float
    n: int


def calibration(
    probabilities_of_a: Float[np.ndarray, " n"], signs: Float[np.ndarray, " n"], n_bins: int
) -> list[CalibrationBin]:
    """Returns predictions sorted by confidence, in bins of about equal size."""
    confidence = np.maximum(probabilities_of_a, 1.0 - probabilities_of_a)
    is_right = 0.5 * (1.0 + np.sign(preferred_probabilities(probabilities_of_a, signs) - 0.5))
    bins = np.array_split(np.argsort(confidence, kind="stable"), min(n_bins, len(signs)))
    return [
        CalibrationBin(float(confidence[rows].mean()), float(is_right[rows].mean()), len(rows))
        for rows in bins
    ]
