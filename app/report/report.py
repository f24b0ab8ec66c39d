"""From findings to the page."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from app.new_file import open_new
from app.report import table
from app.report.findings import REWARDS, Findings
from app.report.illustrations import illustrations
from app.report.page import Report, Section, render
from app.report.words import read_words
from app.versions import versions_of
from study_core.domains.driving import DRIVING_V1
from study_core.domains.driving.safety import collides, stays_on_road
from study_core.evaluation.best_drives import diversity
from study_core.evaluation.intervals import mean_over_people

_PACKAGES = ("prefstudy", "numpy", "scipy", "numba", "torch", "matplotlib")


@contextmanager
def new_file(path: Path) -> Iterator[TextIO]:
    """Opens a new file before minutes of computing; removes it if nothing comes of them.

    Raises:
        NewFileError: It exists, or can't be made.
    """
    with open_new(path) as file:
        try:
            yield file
        except BaseException:
            path.unlink(missing_ok=True)
            raise


def write(findings: Findings, appendix: Sequence[Section] = ()) -> str:
    """Returns the report as one HTML page.

    Args:
        findings: What it is about.
        appendix: What comes last: how the study was run.
    """
    evaluation = table.as_json(
        findings.seed, findings.evaluated, findings.comparison, findings.accuracy, findings.curves
    )
    studies = sorted({study.name for study in findings.evaluated.studies.values()})
    return render(
        Report(
            title=f"What was learned from {len(findings.people)} people: {', '.join(studies)}",
            summary=_summary(findings, evaluation),
            people=[person.name for person in findings.people],
            sections=[_predictors(evaluation), *_hypotheses(findings)],
            illustrations=illustrations(findings),
            method=[_said("method"), *appendix],
            versions=_versions(findings),
        )
    )


def _summary(findings: Findings, evaluation: dict[str, Any]) -> list[str]:
    name = evaluation["recommended"]
    low, high = evaluation["interval"][name]
    said = [
        f"{name}, recommended from active answers alone, predicts {100 * evaluation['mean'][name]:.1f} % of the "
        f"common test answers (95 % interval over people {100 * low:.1f} to {100 * high:.1f}), with log loss "
        f"{evaluation['log_loss'][name]:.3f}; it expects {100 * evaluation['expected_accuracy'][name]:.1f} %."
    ]
    if findings.evaluated.left_out:
        said.append("Left out: " + " ".join(findings.evaluated.left_out))
    return said


def _predictors(evaluation: dict[str, Any]) -> Section:
    return Section(
        "Predictors", (), table.columns(), table.rows(evaluation), emphasised=evaluation["recommended"]
    )


def _hypotheses(findings: Findings) -> list[Section]:
    sections = []
    if findings.h1 is not None:
        h1 = findings.h1
        effect = "none" if h1.effect_size is None else f"{h1.effect_size:.2f}"
        sections.append(
            _said(
                "h1",
                n_better=h1.n_better,
                n_people=h1.n_people,
                gain=100.0 * h1.mean_gain,
                effect=effect,
                p_wilcoxon=_p(h1.p_wilcoxon),
                p_t=_p(h1.p_t),
            )
        )
    if len(findings.people) > 1:
        sections.append(_diversity(findings))
    return sections


def _said(name: str, **values: object) -> Section:
    """Returns a section in words, with values filled in."""
    words = read_words()[name]
    return Section(words["title"], [text.format(**values) for text in words["paragraphs"]])


def _diversity(findings: Findings) -> Section:
    domain, rows = findings.domain, []
    columns = ["reward and search", "mean difference", "from", "to"]
    is_driving = domain.id == DRIVING_V1.id
    columns += ["on the road", "without collision"] if is_driving else []
    for (reward, search), found in findings.drives.items():
        drives = np.stack(list(found.values()))
        mean = mean_over_people(
            findings.seed, _mean_difference_of_each(diversity(domain, drives), len(drives))
        )
        row: list[Any] = [f"{REWARDS[reward]}, {search}", mean.value, mean.low, mean.high]
        if is_driving:
            states = domain.rollout(drives)
            row += [f"{n.sum()} of {len(n)}" for n in (stays_on_road(states), ~collides(states))]
        rows.append(row)
    return replace(_said("h2"), columns=columns, rows=rows)


def _mean_difference_of_each(differences: np.ndarray, n_people: int) -> list[float]:
    """Returns each person's mean difference from the others."""
    matrix = np.zeros((n_people, n_people))
    matrix[np.triu_indices(n_people, 1)] = differences
    return [float(total) / (n_people - 1) for total in (matrix + matrix.T).sum(axis=1)]


def _versions(findings: Findings) -> dict[str, str]:
    digest = hashlib.sha256()
    for person in findings.people:
        for part in (person.training, person.test):
            for values in (part.pairs.states_a, part.pairs.states_b, part.signs):
                digest.update(np.ascontiguousarray(values).tobytes())
    return {
        **versions_of(_PACKAGES),
        "domain": findings.domain.id,
        "seed": str(findings.seed),
        **_study_hashes(findings),
        "answers (SHA-256)": digest.hexdigest(),
    }


def _study_hashes(findings: Findings) -> dict[str, str]:
    """Returns the hashes by study; people of one study may have had different numbers of queries."""
    hashes: dict[str, list[str]] = {}
    for key, study in sorted(findings.evaluated.studies.items()):
        hashes.setdefault(f"study {study.name}", []).append(key)
    return {name: " ".join(keys) for name, keys in hashes.items()}


def _p(value: float | None) -> str:
    if value is None:
        return "none"
    return f"{value:.3f}" if value >= 0.001 else "below 0.001"
