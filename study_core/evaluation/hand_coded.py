"""How well the hand-coded features alone predict the published study's test answers, by response model.

Only training answers are fitted; the test answers are looked at once, to be predicted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study_core.choice import ResponseModel
from study_core.comparison import ComparisonSet
from study_core.evaluation.metrics import accuracy
from study_core.posterior.prior import Prior, Support
from study_core.posterior.run import Posterior, infer
from study_core.predictors.hand_coded import CALIBRATED_RESPONSE, SETTINGS
from study_core.published import PublishedPerson
from study_core.streams import stream

MODELS: dict[str, tuple[Support, ResponseModel]] = {
    "beta 1": ("ball", ResponseModel("sigmoid", 1.0)),
    "beta 10": ("ball", ResponseModel("sigmoid", 10.0)),
    "beta 50": ("ball", ResponseModel("sigmoid", 50.0)),
    "beta 200": ("ball", ResponseModel("sigmoid", 200.0)),
    "beta 200, lapse 0.1, sphere": ("sphere", ResponseModel("sigmoid", 200.0, 0.1)),
    "by evidence, sphere": ("sphere", ResponseModel("sigmoid", "evidence", "evidence")),
    "inferred, sphere": ("sphere", CALIBRATED_RESPONSE),
}
"""What is compared: the paper's model at several rationalities, and models that learn each person's own."""


@dataclass(frozen=True)
class Prediction:
    """How well one person's test answers are predicted.

    Attributes:
        accuracy: Share of answers that the sign of the mean's reward difference predicts; a tie counts half.
        log_loss: Mean of -log P(answer), the probability averaged over the posterior.
        has_converged: Whether the posterior's draws meet the diagnostics.
    """

    accuracy: float
    log_loss: float
    has_converged: bool


def predict(seed: int, name: str, person: PublishedPerson) -> Prediction:
    """Fits one of `MODELS` to a person's training answers and predicts their test answers."""
    support, response = MODELS[name]
    prior = Prior(support, person.training.feature_diffs.shape[1])
    rng = stream(seed, "hand-coded", name, person.number)
    posterior = infer(rng, prior, response, person.training, SETTINGS)
    return Prediction(
        accuracy=accuracy(posterior.mean, person.test),
        log_loss=_log_loss(posterior, person.test),
        has_converged=posterior.diagnostics.has_converged,
    )


def stored_accuracy(person: PublishedPerson) -> float:
    """Returns the accuracy of the posterior mean that the study stored last, before the last active answer."""
    return accuracy(person.posterior_samples[-1].mean(axis=0), person.test)


def _log_loss(posterior: Posterior, answers: ComparisonSet) -> float:
    # By symmetry, what was preferred is called A.
    return float(-np.log(posterior.probability_of_a(answers.preferred_diffs)).mean())
