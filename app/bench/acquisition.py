"""How fast each acquisition method learns: all of them with the same simulated people, answerer and model alike."""

from __future__ import annotations

import json
import multiprocessing
import statistics
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress

from app.bench.curve import Curve, Curves, over_people
from app.bench.report import BenchError, figures, make_folder, provenance
from app.process import n_cores
from app.settings import find_study, with_method
from study_core import lbfgs
from study_core.acquisition import METHODS
from study_core.bank import Bank, open_bank
from study_core.comparison import ComparisonSet
from study_core.participants import alignment, draw_person
from study_core.queries import infer_posterior, propose_active_query
from study_core.streams import stream
from study_core.study import Study
from study_core.study_file import TrajectorySection
from study_core.trajectory import best_from_bank

N_PEOPLE, N_QUERIES = 100, 30
MEASURES = ("alignment", "regret", "held_out_accuracy")

STUDY, _PAPERS_STUDY = "quickstart", "katz2021"
_REPORTED_QUERY = 20
_LEVELS = (0.95, 0.98)
_N_HELD_OUT = 400


@dataclass(frozen=True)
class Task:
    """One session: a person taught by a method."""

    method: str
    number: int
    seed: int
    n_queries: int


@dataclass(frozen=True)
class Walk:
    """What one session came to.

    Attributes:
        task: Which session.
        measures: Of `MEASURES`, after 0, 1, ... answers, shape `(3, n_queries + 1)`.
        milliseconds: What it cost to choose each query, shape `(n_queries,)`.
        is_methods_own: Whether the method chose the pair, not the prior in its place, shape `(n_queries,)`.
    """

    task: Task
    measures: np.ndarray
    milliseconds: np.ndarray
    is_methods_own: np.ndarray


def run(
    seed: int,
    progress: Progress,
    n_people: int = N_PEOPLE,
    n_queries: int = N_QUERIES,
    out: Path | None = None,
    methods: tuple[str, ...] = tuple(METHODS),
) -> dict[str, Any]:
    """Lets every method teach itself about the same people.

    Weights are uniform on the prior's support, and people answer as the study's response model says. The heuristic
    runs as in the paper's study: its own sampler, search and rule for equal drives.

    Args:
        seed: Of the people: who they are and how they answer.
        progress: Shows how far it is.
        n_people: How many.
        n_queries: Active queries to each of them.
        out: A new folder for the picture and its numbers.
        methods: By their names in study files.

    Returns:
        `people`, `queries` and, by method, `alignment_at_20` with its interval, `queries_to_X`: the first query after
        which the mean alignment over people is X, the other measures after 20 queries, and what choosing cost. None
        where it was not reached.

    Raises:
        BenchError: Fewer than two people, or the folder can't be made.
    """
    if n_people < 2:
        raise BenchError(f"Expected at least 2 people, got {n_people}: one person's luck says nothing.")
    if out is not None:
        make_folder(out)
    open_bank(find_study(STUDY).domain)
    tasks = [
        Task(method, number, seed, n_queries) for number, method in product(range(1, n_people + 1), methods)
    ]
    walks = list(_walked(tasks, progress))
    curves = {method: _curves([walk for walk in walks if walk.task.method == method]) for method in methods}
    result = {
        "people": n_people,
        "queries": n_queries,
        "methods": {
            method: _summary(curves[method], [walk for walk in walks if walk.task.method == method])
            for method in methods
        },
        **provenance(seed),
    }
    if out is not None:
        _write(out, result, curves)
    return result


def study_for(method: str) -> Study:
    """Returns the study that a method is measured in: quickstart's, or the paper's way for the paper's method."""
    study = with_method(find_study(STUDY), method)
    changes: dict[str, Any] = {"trajectory": TrajectorySection(search="bank")}
    if method == "heuristic":
        papers = find_study(_PAPERS_STUDY).file
        changes = {name: getattr(papers, name) for name in ("acquisition", "trajectory", "sampler")}
    return replace(study, file=study.file.model_copy(update=changes))


def walk(task: Task) -> Walk:
    """Runs one session; a pure function of the task, so anyone may run it."""
    study = study_for(task.method)
    person = draw_person(task.seed, task.number, study.prior, study.response)
    rng = stream(task.seed, "bench-answers", task.number)
    participant = f"bench-{task.seed}-{task.number}"
    comparisons = ComparisonSet.empty(study.prior.n_features)
    means, milliseconds, is_own = [], [], []
    for index in range(task.n_queries):
        posterior = infer_posterior(study, participant, index, comparisons)
        means.append(posterior.mean)
        began = time.perf_counter()
        proposed = propose_active_query(study, participant, index, posterior)
        milliseconds.append(1e3 * (time.perf_counter() - began))
        is_own.append(proposed.provenance.method == task.method)
        comparisons = comparisons.append(proposed.query, person.choose(rng, proposed.query))
    means.append(infer_posterior(study, participant, task.n_queries, comparisons).mean)
    measures = _measured(study, task.seed, np.array(means), person.weights)
    return Walk(task, measures, np.array(milliseconds), np.array(is_own))


def _measured(study: Study, seed: int, means: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Returns the three measures of each posterior mean."""
    bank = open_bank(study.domain)
    psis = _held_out(seed)
    agrees = np.sign(psis @ means.T) == np.sign(psis @ truth)[:, None]
    return np.array(
        [[alignment(mean, truth) for mean in means], _regrets(study, bank, means, truth), agrees.mean(axis=0)]
    )


def _regrets(study: Study, bank: Bank, means: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Returns how much less reward the best drive for each mean has, under the truth, than the best drive of all."""
    best = best_from_bank(study.domain, bank, np.vstack([truth, means]))
    rewards = study.domain.features(study.domain.rollout(best.controls)) @ truth
    return np.asarray(rewards.max() - rewards[1:])


@cache
def _held_out(seed: int) -> np.ndarray:
    """Returns psi of pairs of local optima that are in no bank and no test set."""
    study = find_study(STUDY)
    domain, rng = study.domain, stream(seed, "bench-held-out")
    weights = study.prior.draw(rng, 2 * _N_HELD_OUT)
    starts = rng.uniform(
        domain.control_lower, domain.control_upper, (len(weights), len(domain.control_lower))
    )
    controls, _, _, _ = lbfgs.maximise(domain, starts, weights)
    features = domain.features(domain.rollout(controls))
    return np.asarray(features[0::2] - features[1::2])


def _walked(tasks: list[Task], progress: Progress) -> Iterator[Walk]:
    """Gives each session's outcome, run on all cores, in the order of the tasks."""
    shown = progress.add_task("sessions", total=len(tasks))
    with ProcessPoolExecutor(n_cores(), multiprocessing.get_context("spawn")) as executor:
        futures = [executor.submit(walk, task) for task in tasks]
        for _ in as_completed(futures):
            progress.advance(shown)
        yield from (future.result() for future in futures)


def _curves(walks: list[Walk]) -> dict[str, Curve]:
    """Returns each measure's curve."""
    return {
        name: over_people(np.stack([walk.measures[m] for walk in walks])) for m, name in enumerate(MEASURES)
    }


def _summary(curves: dict[str, Curve], walks: list[Walk]) -> dict[str, Any]:
    aligned = curves["alignment"].mean
    result: dict[str, Any] = {f"queries_to_{level}": _first(aligned >= level) for level in _LEVELS}
    for name, curve in curves.items():
        is_there = len(aligned) > _REPORTED_QUERY
        value, low, high = (
            figures(values[_REPORTED_QUERY]) if is_there else None
            for values in (curve.mean, curve.low, curve.high)
        )
        result |= {f"{name}_at_20": value, f"{name}_at_20_interval": [low, high]}
    result["choosing_milliseconds"] = figures(
        statistics.median(np.concatenate([walk.milliseconds for walk in walks]).tolist())
    )
    result["share_from_prior"] = figures(1.0 - np.concatenate([walk.is_methods_own for walk in walks]).mean())
    return result


def _first(is_reached: np.ndarray) -> int | None:
    """Returns the first number of answers after which it is, or None."""
    return int(is_reached.argmax()) if is_reached.any() else None


def _write(folder: Path, result: dict[str, Any], curves: Curves) -> None:
    """Writes the picture, and the numbers that it shows."""
    from app.bench.acquisition_figure import draw  # matplotlib takes a second to import

    draw(curves).savefig(folder / "acquisition.png")
    plain = {
        method: {
            name: {"mean": curve.mean.tolist(), "low": curve.low.tolist(), "high": curve.high.tolist()}
            for name, curve in by_measure.items()
        }
        for method, by_measure in curves.items()
    }
    (folder / "acquisition.json").write_text(json.dumps({**result, "curves": plain}, indent=2) + "\n")
