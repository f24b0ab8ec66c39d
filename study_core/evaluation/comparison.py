"""All predictors on the same people: fitted to active answers, scored once on the common test answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.domain import Domain
from study_core.evaluation.people import Person
from study_core.evaluation.scores import Scores, score
from study_core.predictors.predictor import Fitted, Predictor, Training

# The share of a person's active answers, the earliest ones, that predictors are compared from when one is chosen: the
# paper's own split into training and validation.
TRAINING_SHARE = 0.7


@dataclass(frozen=True)
class Comparison:
    """What predictors came to.

    Attributes:
        recommended: Name of the predictor with the smallest `validation_log_loss`.
        validation_log_loss: By predictor: mean over people of the log loss on the last active answers, after fitting
            to the first. No test answer has any part in it.
        probabilities_of_a: By predictor, then person: what it predicts of each test query.
        scores: By predictor, then person: of these, on the test answers.
        fitted: The predictors, fitted to all active answers.
    """

    recommended: str
    validation_log_loss: dict[str, float]
    probabilities_of_a: dict[str, dict[str, Float[np.ndarray, " n_test"]]]
    scores: dict[str, dict[str, Scores]]
    fitted: dict[str, Fitted]


def compare(
    seed: int,
    domain: Domain,
    people: Sequence[Person],
    predictors: Sequence[Predictor],
    on_fitted: Callable[[], None] = lambda: None,
) -> Comparison:
    """Fits every predictor twice: to the first active answers, to choose one, and to all of them, to be scored.

    Args:
        seed: Names every random stream.
        domain: Whose trajectories are compared.
        people: With their test answers, which no predictor sees.
        predictors: What to compare; their names differ.
        on_fitted: Called after each of the `2 * len(predictors)` fits.

    Raises:
        TooFewAnswersError: Somebody has too few answers for one of the predictors.
    """
    training = {person.name: person.training for person in people}
    validated, fitted = {}, {}
    for predictor in predictors:
        validated[predictor.name] = validation_log_loss(seed, domain, training, predictor)
        on_fitted()
        fitted[predictor.name] = predictor.fit(seed, domain, training)
        on_fitted()
    probabilities = {name: _predictions(people, model) for name, model in fitted.items()}
    return Comparison(
        recommended=min(validated, key=lambda name: validated[name]),
        validation_log_loss=validated,
        probabilities_of_a=probabilities,
        scores={
            name: {person.name: score(of_people[person.name], person.test.signs) for person in people}
            for name, of_people in probabilities.items()
        },
        fitted=fitted,
    )


def validation_log_loss(
    seed: int, domain: Domain, training: Mapping[str, Training], predictor: Predictor
) -> float:
    """Returns the mean over people of the log loss on the last active answers, after fitting to the first."""
    split = {name: n_first(len(one)) for name, one in training.items()}
    fitted = predictor.fit(seed, domain, {name: _first(one, split[name]) for name, one in training.items()})
    losses = [
        score(
            fitted.people[name].probability_of_a(one.pairs[split[name] :]), one.signs[split[name] :]
        ).log_loss
        for name, one in training.items()
    ]
    return float(np.mean(losses))


def n_first(n_answers: int) -> int:
    """Returns how many of somebody's active answers come before those that decide between predictors."""
    return round(TRAINING_SHARE * n_answers)


def _first(training: Training, n: int) -> Training:
    """Returns the first answers, with the posterior that was stored after all of them.

    Only `hand-coded-stored` looks at it. It has then seen what it is scored on, which can only flatter it.
    """
    return Training(training.pairs[:n], training.signs[:n], training.stored_mean)


def _predictions(people: Sequence[Person], fitted: Fitted) -> dict[str, Float[np.ndarray, " n_test"]]:
    return {person.name: fitted.people[person.name].probability_of_a(person.test.pairs) for person in people}
