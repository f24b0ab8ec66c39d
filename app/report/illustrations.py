"""Every figure of the report with the numbers behind it; its words are in `static/report/words.toml`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from app.report.findings import LEARN_ALONE, REWARDS, Findings, networks_of
from app.report.page import Illustration
from app.report.words import read_words
from study_core.domains.driving import DRIVING_V1
from study_core.evaluation.best_drives import diversity
from study_core.evaluation.figures import (
    accuracies,
    calibration,
    heat_maps,
    learned_feature,
    learning,
    optimal_drives,
    queries,
    weights,
)
from study_core.evaluation.intervals import Mean, mean_over_people
from study_core.evaluation.learned import learned_feature as feature_of
from study_core.evaluation.learning_curve import Curve
from study_core.evaluation.scores import Scores
from study_core.evaluation.scores import calibration as calibration_bins
from study_core.predictors.personal_network import NetworkModel
from study_core.published_session import STUDY_NAME as PUBLISHED_STUDY

_N_BINS = 8
# Where the paper holds the inputs that don't vary.
_HELD = {"x": 0.0, "distance": 0.5, "heading": 0.5 * np.pi, "speed": 0.8, "time_gap": 0.0}


def illustrations(findings: Findings) -> list[Illustration]:
    """Returns every figure that the findings have data for, in the order of the paper and then ours."""
    drawn = [_accuracies, _calibration, _learning, _weights]
    if findings.domain.id == DRIVING_V1.id:
        drawn = [
            _queries,
            _accuracies,
            _one_feature,
            _heat_maps,
            _wide_heat_maps,
            _all_features,
            _drives,
            *drawn[1:],
        ]
    return [one for one in (draw(findings) for draw in drawn) if one is not None]


def _illustration(
    findings: Findings, name: str, figure: Figure, columns: Sequence[str], rows: Sequence[Sequence[Any]]
) -> Illustration:
    """Returns a figure with its words; what the paper's own shows is said beside the people of the paper alone."""
    said = {key: text.format(first=findings.people[0].name) for key, text in read_words()[name].items()}
    names = {study.name for study in findings.evaluated.studies.values()}
    paper = said["paper"] if names == {PUBLISHED_STUDY} else ""
    return Illustration(name, said["title"], said["caption"], paper, figure, columns, rows)


def _queries(findings: Findings) -> Illustration:
    return _illustration(
        findings,
        "queries",
        figure=queries.draw(findings.domain, findings.queries),
        columns=("method", *(f"{side}: {name}" for side in "AB" for name in findings.domain.feature_names)),
        rows=[
            (method, *map(float, query.features_a), *map(float, query.features_b))
            for method, query in findings.queries.items()
        ],
    )


def _accuracies(findings: Findings) -> Illustration:
    accuracy = findings.accuracy
    means = {name: mean_over_people(findings.seed, list(of.values())) for name, of in accuracy.items()}
    return _illustration(
        findings,
        "accuracies",
        figure=accuracies.draw(accuracy, findings.trials, means),
        columns=("person", *accuracy),
        rows=[(person.name, *(of[person.name] for of in accuracy.values())) for person in findings.people],
    )


def _one_feature(findings: Findings) -> Illustration:
    name = findings.people[0].name
    values = _against_heading(networks_of(findings.comparison)[name])
    return _illustration(
        findings,
        "one-feature",
        figure=learned_feature.draw_one(values),
        columns=("heading, degrees", "learned feature", "sin(heading)"),
        rows=[
            (float(heading), float(value), float(np.sin(np.radians(heading))))
            for heading, value in zip(learned_feature.HEADINGS_DEG[::15], values[::15], strict=True)
        ],
    )


def _heat_maps(findings: Findings) -> Illustration:
    return _maps(findings, "heat-maps", networks_of(findings.comparison)[findings.people[0].name])


def _wide_heat_maps(findings: Findings) -> Illustration:
    return _maps(findings, "wide-heat-maps", findings.wide_network)


def _maps(findings: Findings, name: str, model: NetworkModel) -> Illustration:
    domain, feature = findings.domain, feature_of(model)
    columns = [domain.network_input_names.index(one) for one in model.config.inputs]

    def seen(inputs: np.ndarray) -> np.ndarray:
        return feature(inputs[:, columns])

    maps = np.stack([heat_maps.over_the_road(domain, seen, moment) for moment in heat_maps.MOMENTS])
    return _illustration(
        findings,
        name,
        figure=heat_maps.draw(domain, maps),
        columns=("moment, s", "lowest", "mean", "highest"),
        rows=[
            (0.1 * (moment + 1), float(values.min()), float(values.mean()), float(values.max()))
            for moment, values in zip(heat_maps.MOMENTS, maps, strict=True)
        ],
    )


def _all_features(findings: Findings) -> Illustration:
    networks = networks_of(findings.comparison)
    by_heading = {name: _against_heading(model) for name, model in networks.items()}
    by_speed = {
        name: learned_feature.against_speed(feature_of(model), _held(model))
        for name, model in networks.items()
    }
    straight = int(np.argmin(np.abs(learned_feature.HEADINGS_DEG - 90.0)))
    back = int(np.argmin(np.abs(learned_feature.HEADINGS_DEG - 270.0)))
    return _illustration(
        findings,
        "all-features",
        figure=learned_feature.draw_all(by_heading, by_speed),
        columns=("person", "straight ahead", "straight back", "at speed 1", "at speed 0", "at speed -1"),
        rows=[
            (name, *(float(v) for v in (values[straight], values[back], *by_speed[name][[-1, 50, 0]])))
            for name, values in by_heading.items()
        ],
    )


def _drives(findings: Findings) -> Illustration:
    drives = {f"{REWARDS[reward]}, {search}": found for (reward, search), found in findings.drives.items()}
    apart = {way: diversity(findings.domain, np.stack(list(found.values()))) for way, found in drives.items()}
    return _illustration(
        findings,
        "drives",
        figure=optimal_drives.draw(findings.domain, drives),
        columns=("reward and search", "mean difference", "smallest", "largest"),
        rows=[
            (way, float(values.mean()), float(values.min()), float(values.max()))
            for way, values in apart.items()
            if len(values)
        ],
    )


def _calibration(findings: Findings) -> Illustration:
    signs = np.concatenate([person.test.signs for person in findings.people])
    bins = {
        name: calibration_bins(np.concatenate(list(of.values())), signs, _N_BINS)
        for name, of in findings.comparison.probabilities_of_a.items()
    }
    return _illustration(
        findings,
        "calibration",
        figure=calibration.draw(bins),
        columns=("predictor", "confidence", "share right", "predictions"),
        rows=[(name, one.confidence, one.accuracy, one.n) for name, of in bins.items() for one in of],
    )


def _learning(findings: Findings) -> Illustration | None:
    if not findings.curves:
        return None
    accuracy = {
        name: _means(findings.seed, of, lambda one: one.accuracy) for name, of in findings.curves.items()
    }
    log_loss = {
        name: _means(findings.seed, of, lambda one: one.log_loss) for name, of in findings.curves.items()
    }
    majority = float(np.mean(list(findings.majority.values()))) if findings.majority else None
    return _illustration(
        findings,
        "learning",
        figure=learning.draw(accuracy, log_loss, LEARN_ALONE, majority),
        columns=(
            "predictor",
            "knows others",
            "own answers",
            "accuracy",
            "from",
            "to",
            "log loss",
            "from",
            "to",
        ),
        rows=[
            (
                name,
                "no" if name in LEARN_ALONE else "yes",
                n,
                *_cells(accuracy[name][n]),
                *_cells(log_loss[name][n]),
            )
            for name in accuracy
            for n in accuracy[name]
        ],
    )


def _weights(findings: Findings) -> Illustration | None:
    samples = findings.evaluated.posterior_samples
    if not samples:
        return None
    names = findings.domain.feature_names
    ordered = {person.name: samples[person.name] for person in findings.people if person.name in samples}
    return _illustration(
        findings,
        "weights",
        figure=weights.draw(names, ordered),
        columns=("person", *names),
        rows=[(name, *map(float, of.mean(axis=0))) for name, of in ordered.items()],
    )


def _against_heading(model: NetworkModel) -> np.ndarray:
    return learned_feature.against_heading(feature_of(model), _held(model))


def _held(model: NetworkModel) -> learned_feature.Held:
    inputs = model.config.inputs
    return learned_feature.Held(inputs, tuple(_HELD[name] for name in inputs))


def _means(seed: int, curve: Curve, measure: Callable[[Scores], float]) -> dict[int, Mean]:
    return {n: mean_over_people(seed, [measure(one) for one in of.values()]) for n, of in curve.items()}


def _cells(mean: Mean) -> tuple[float, float, float]:
    return mean.value, mean.low, mean.high
