"""What an evaluation prints: by predictor and person, for programs (`--json`) and for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from app.report.findings import LEARN_ALONE, test_h1
from app.services.evaluation import Evaluated
from study_core.evaluation.comparison import Comparison
from study_core.evaluation.intervals import mean_over_people
from study_core.evaluation.learning_curve import N_ANSWERS, Curve

_PLACES = 4


def as_json(
    seed: int,
    evaluated: Evaluated,
    comparison: Comparison,
    accuracy: Mapping[str, Mapping[str, float]],
    curves: Mapping[str, Curve],
) -> dict[str, Any]:
    """Returns all scores.

    Args:
        seed: Of the resampling.
        evaluated: The people.
        comparison: All predictors.
        accuracy: By predictor and person; see `findings.accuracies`.
        curves: Scores for somebody new; see `findings.new_person_curves`. Empty if they weren't asked for.

    Returns:
        `recommended`, chosen by `validation_log_loss`, which no test answer has a part in; `people`: accuracy by
        person and predictor; by predictor, means over people: `mean` (of the accuracy) and its 95 % `interval`,
        `log_loss`, and `expected_accuracy`, what the predictor itself expects; `h1`; `new_person`: mean accuracy for
        somebody new, by predictor and number of own answers; who was `left_out`, and why.
    """
    scores, names = comparison.scores, [person.name for person in evaluated.people]
    means = {name: mean_over_people(seed, list(of.values())) for name, of in accuracy.items()}
    h1 = test_h1(accuracy)
    return {
        "recommended": comparison.recommended,
        "people": {person: {name: _rounded(of[person]) for name, of in accuracy.items()} for person in names},
        "mean": {name: _rounded(mean.value) for name, mean in means.items()},
        "interval": {name: [_rounded(mean.low), _rounded(mean.high)] for name, mean in means.items()},
        "log_loss": {name: _mean([one.log_loss for one in of.values()]) for name, of in scores.items()},
        "expected_accuracy": {
            name: _mean([one.expected_accuracy for one in of.values()]) for name, of in scores.items()
        },
        "validation_log_loss": {
            name: _rounded(loss) for name, loss in comparison.validation_log_loss.items()
        },
        "h1": None if h1 is None else asdict(h1),
        "new_person": {
            name: {str(n): _mean([one.accuracy for one in of.values()]) for n, of in curve.items()}
            for name, curve in curves.items()
        },
        "left_out": evaluated.left_out,
        "seed": seed,
    }


def columns() -> tuple[str, ...]:
    """Returns what `rows` hold."""
    return ("predictor", "accuracy", "from", "to", "expected", "log loss", "log loss on validation")


def rows(evaluation: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Returns the means over people of each predictor, from what `as_json` returned."""
    return [
        (
            name,
            mean,
            *evaluation["interval"][name],
            evaluation["expected_accuracy"][name],
            evaluation["log_loss"][name],
            evaluation["validation_log_loss"][name],
        )
        for name, mean in evaluation["mean"].items()
    ]


def new_person_columns() -> tuple[str, ...]:
    """Returns what `new_person_rows` hold."""
    return ("predictor", "knows others", *map(str, N_ANSWERS))


def new_person_rows(evaluation: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Returns the mean accuracy for somebody new after each number of own answers, from what `as_json` returned."""
    return [
        (name, "no" if name in LEARN_ALONE else "yes", *by_number.values())
        for name, by_number in evaluation["new_person"].items()
    ]


def _mean(values: list[float]) -> float:
    return _rounded(float(np.mean(values)))


def _rounded(value: float) -> float:
    return round(value, _PLACES)
