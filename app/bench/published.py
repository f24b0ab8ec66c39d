"""How well each response model predicts the published study's test answers from the training answers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from app.bench.report import provenance
from study_core.evaluation.hand_coded import MODELS, predict, stored_accuracy
from study_core.evaluation.intervals import bootstrap_interval
from study_core.published import read_study
from study_core.streams import stream


def run(seed: int, directory: Path, progress: Progress) -> dict[str, Any]:
    """Measures every model on everyone whose files are there.

    Args:
        seed: Of the posteriors and the resampling.
        directory: The published study's JLD2 files.
        progress: Shows how far it is.

    Returns:
        By model: mean test accuracy over people with its 95 % interval (people resampled), mean log loss, and how
        many posteriors converged; the same accuracy of the posterior that the study stored; and how much more is
        predicted than by that, person by person.

    Raises:
        PublishedDataError: The data can't be read.
    """
    people = list(read_study(directory).values())
    stored = [stored_accuracy(person) for person in people]
    models: dict[str, Any] = {"stored posterior": {"test_accuracy": _mean(seed, stored)}}
    task = progress.add_task("people x models", total=len(people) * len(MODELS))
    for name in MODELS:
        predictions = []
        for person in people:
            predictions.append(predict(seed, name, person))
            progress.advance(task)
        accuracies = [prediction.accuracy for prediction in predictions]
        models[name] = {
            "test_accuracy": _mean(seed, accuracies),
            "gain_over_stored": _mean(seed, np.subtract(accuracies, stored).tolist()),
            "log_loss": _mean(seed, [prediction.log_loss for prediction in predictions]),
            "converged": sum(prediction.has_converged for prediction in predictions),
        }
    return {"people": [person.number for person in people], "models": models, **provenance(seed)}


def _mean(seed: int, values: Sequence[float]) -> dict[str, Any]:
    """Returns the mean over people and its interval; the same resampled people for every model."""
    low, high = bootstrap_interval(stream(seed, "bootstrap"), np.array(values))
    return {"mean": round(float(np.mean(values)), 4), "interval": [round(low, 4), round(high, 4)]}
