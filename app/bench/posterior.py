"""How fast the posterior is: effective draws per second beside other samplers, and an update beside APReL's.

Everything runs on one core. A sampler is timed from the answers to its draws, warm-up included and compiling left out.
Each draws as often as serves its rate: the more draws, the less the warm-up weighs. An update is timed as the product
runs it, with fewer draws and with the diagnostics that it computes of each. The effective sample size is the smallest
bulk ESS of the weights, by the same estimator for all.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from jaxtyping import Float
from rich.progress import Progress

from app.bench import aprel
from app.bench.answers import RESPONSE, Answers, prior_of, simulated_answers
from app.bench.peers import INSTALL, Peer, installed_peers
from app.bench.peers.target import LAPSE_RATE, RATIONALITY
from app.bench.report import make_folder, percentile, provenance
from app.settings import find_study
from study_core.comparison import ComparisonSet
from study_core.posterior.annealing import learn_proposal
from study_core.posterior.diagnostics import diagnose
from study_core.posterior.metropolis import run_chains
from study_core.posterior.prior import Prior
from study_core.posterior.run import infer
from study_core.posterior.target import Target
from study_core.streams import stream
from study_core.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

N_ANSWERS = 100
UPDATES_AT = (10, 100, 1000)
CURVE_AT = (10, 20, 50, 100, 200, 300, 400, 500, 600, 700, 800, 900, 1000)
_STUDY = "quickstart"
_LARGEST_Z = 4.0
# Ours beside the peers: as many chains and draws as the best of them.
_N_CHAINS, _N_WARMUP, _N_DRAWS = 64, 200, 4000
_OURS = "prefstudy"

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Run:
    """One run of one sampler.

    Attributes:
        seconds: From the answers to all draws.
        mean: Of w, shape `(n_features,)`.
        error: Monte Carlo standard error of the mean, shape `(n_features,)`.
        ess: Smallest bulk effective sample size of the weights.
        r_hat: Largest R-hat of the weights.
    """

    seconds: float
    mean: Float[np.ndarray, " n_features"]
    error: Float[np.ndarray, " n_features"]
    ess: float
    r_hat: float


Sampler = Callable[[int, Answers], Run]


def run(
    seed: int,
    progress: Progress,
    out: Path | None = None,
    n_people: int = 5,
    n_runs: int = 5,
    n_updates: int = 20,
) -> dict[str, Any]:
    """Measures our sampler, the peers that are installed, and APReL's way, in turns.

    Args:
        seed: Of the simulated people and of every sampler.
        progress: Shows how far it is.
        out: A new folder, where the cost of the k-th update is drawn.
        n_people: Simulated people, each with a posterior of their own.
        n_runs: Runs of each sampler on each posterior.
        n_updates: Updates of each person at each number of answers.

    Returns:
        `ess_per_second` by sampler, medians over all runs; `ratio_to_best_peer`; by how much an update takes APReL
        longer, looped and vectorised; `update_milliseconds`, `update_ess` and their ratio by number of answers; the
        `samplers` one by one; whether their means agree; and where it was measured.

    Raises:
        BenchError: The folder can't be made.
    """
    study = find_study(_STUDY)
    if out is not None:
        make_folder(out)
    with _one_core():
        peers, missing = installed_peers()
        if missing:
            note = f"Without {', '.join(missing)}. To compare with them: {INSTALL}"
            progress.console.print(note, markup=False, highlight=False, soft_wrap=True)
        people = [
            simulated_answers(study.domain, seed, number, max(CURVE_AT)) for number in range(1, n_people + 1)
        ]
        ours = Peer(_OURS, f"{_N_CHAINS} chains, {_N_WARMUP} a stage + {_N_DRAWS} steps", _draw_ours)
        racers = [ours, *peers]
        samplers = {racer.name: _sampler(racer) for racer in racers}
        runs = _race(samplers, [answers.first(N_ANSWERS) for answers in people], n_runs, seed, progress)
        plain = _time_aprel(people, seed, progress)
        updates = _time_updates(_update(study), people, n_updates, CURVE_AT if out else UPDATES_AT, progress)
    if out is not None:
        _draw_curve(updates).savefig(out / "update-cost.png")
    rates = {name: percentile([r.ess / r.seconds for r in of_all], 50) for name, of_all in runs.items()}
    update_ms = {k: percentile([1e3 * r.seconds for r in of_k], 50) for k, of_k in updates.items()}
    update_rates = {k: percentile([r.ess / r.seconds for r in of_k], 50) for k, of_k in updates.items()}
    return {
        "ess_per_second": rates,
        "ratio_to_best_peer": _ratio_to_best(rates),
        "ratio_to_aprel_looped": round(plain["looped"] / update_ms[N_ANSWERS], 1),
        "ratio_to_aprel_vectorised": round(plain["vectorised"] / update_ms[N_ANSWERS], 1),
        "update_milliseconds": {str(k): update_ms[k] for k in UPDATES_AT},
        "update_ess_per_second": {str(k): update_rates[k] for k in UPDATES_AT},
        "update_ess": {str(k): percentile([r.ess for r in updates[k]], 50) for k in UPDATES_AT},
        "aprel_milliseconds": plain,
        "samplers": {
            racer.name: {"settings": racer.settings, **_describe(runs[racer.name])} for racer in racers
        },
        "agreement": _agreement(runs, n_runs),
        **({"update_milliseconds_curve": {str(k): ms for k, ms in update_ms.items()}} if out else {}),
        "answers": N_ANSWERS,
        "repetitions": {"people": n_people, "runs": n_runs, "updates": n_updates},
        **provenance(seed, [peer.name for peer in peers]),
    }


@contextmanager
def _one_core() -> Iterator[None]:
    """Keeps this process, and every thread that it starts meanwhile, on one core where the system can."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def _draw_ours(
    seed: int, preferred_diffs: Float[np.ndarray, "n_answers n_features"]
) -> Float[np.ndarray, "n_chains n_draws n_features"]:
    """Draws as an update does, only longer."""
    rng = stream(seed, "bench-posterior-ours")
    comparisons = ComparisonSet(preferred_diffs, np.ones(len(preferred_diffs)))
    target = Target(Prior("sphere", preferred_diffs.shape[1]), RESPONSE, comparisons)
    points = run_chains(rng, target, learn_proposal(rng, target, _N_WARMUP, _N_CHAINS), _N_DRAWS).points
    return target.weights(points.reshape(-1, target.n_coordinates)).reshape(*points.shape[:2], -1)


def _update(study: Study) -> Sampler:
    """Returns the product's own update."""
    prior = prior_of(study.domain)

    def sample(seed: int, answers: Answers) -> Run:
        rng = stream(seed, "bench-posterior-update")
        comparisons = answers.comparisons
        seconds, posterior = _timed(lambda: infer(rng, prior, RESPONSE, comparisons, study.sampler))
        ess = posterior.diagnostics.ess_bulk
        error = posterior.samples.std(axis=0) / np.sqrt(ess)
        return Run(seconds, posterior.mean, error, float(ess.min()), float(posterior.diagnostics.r_hat.max()))

    return sample


def _sampler(peer: Peer) -> Sampler:
    def sample(seed: int, answers: Answers) -> Run:
        preferred_diffs = answers.comparisons.preferred_diffs
        seconds, draws = _timed(lambda: peer.draw(seed, preferred_diffs))
        found = diagnose(np.ascontiguousarray(draws), acceptance=float("nan"))
        error = draws.std(axis=(0, 1)) / np.sqrt(found.ess_bulk)
        return Run(
            seconds, draws.mean(axis=(0, 1)), error, float(found.ess_bulk.min()), float(found.r_hat.max())
        )

    return sample


def _race(
    samplers: dict[str, Sampler], people: list[Answers], n_runs: int, seed: int, progress: Progress
) -> dict[str, list[Run]]:
    """Returns each sampler's runs, person by person; in turns, so that whatever else goes on falls on all."""
    task = progress.add_task("samplers", total=len(samplers) * (1 + len(people) * n_runs))
    for sample in samplers.values():
        sample(seed, people[0])  # compiles
        progress.advance(task)
    runs: dict[str, list[Run]] = {name: [] for name in samplers}
    for answers in people:
        for number in range(n_runs):
            for name, sample in samplers.items():
                runs[name].append(sample(seed + number, answers))
                progress.advance(task)
    return runs


def _time_aprel(people: list[Answers], seed: int, progress: Progress) -> dict[str, float]:
    """Returns the milliseconds of APReL's belief update, looped and vectorised."""
    ways = {"looped": aprel.looped_log_likelihood, "vectorised": aprel.vectorised_log_likelihood}
    times: dict[str, list[float]] = {way: [] for way in ways}
    for number, answers in enumerate(progress.track(people, description="APReL's way")):
        slates = answers.first(N_ANSWERS).slates
        for way, likelihood_of in ways.items():
            rng = stream(seed, "bench-aprel", number)
            likelihood = likelihood_of(slates, RATIONALITY, LAPSE_RATE)
            began = time.perf_counter()
            aprel.sample_belief(rng, slates.shape[2], likelihood)
            times[way].append(1e3 * (time.perf_counter() - began))
    return {way: percentile(values, 50) for way, values in times.items()}


def _time_updates(
    sample: Sampler, people: list[Answers], n_updates: int, at: tuple[int, ...], progress: Progress
) -> dict[int, list[Run]]:
    """Returns our runs after each of the numbers of answers."""
    runs: dict[int, list[Run]] = {k: [] for k in at}
    for number in progress.track(range(n_updates), description="updates"):
        for k in at:
            runs[k] += [sample(number, answers.first(k)) for answers in people]
    return runs


def _ratio_to_best(rates: dict[str, float]) -> float | None:
    peers = [rate for name, rate in rates.items() if name != _OURS]
    return round(rates[_OURS] / max(peers), 2) if peers else None


def _describe(runs: list[Run]) -> dict[str, float]:
    return {
        "milliseconds": percentile([1e3 * r.seconds for r in runs], 50),
        "ess": percentile([r.ess for r in runs], 50),
        "smallest_ess": percentile([r.ess for r in runs], 0),
        "largest_r_hat": percentile([r.r_hat for r in runs], 100),
    }


def _agreement(runs: dict[str, list[Run]], n_runs: int) -> dict[str, Any]:
    """Tells whether all samplers draw from one target: otherwise comparing their speed means nothing."""
    largest = {
        name: max(
            float(_z_of_means(ours, other).max())
            for ours, other in zip(runs[_OURS][::n_runs], of_all[::n_runs], strict=True)
        )
        for name, of_all in runs.items()
        if name != _OURS
    }
    return {
        "largest_z_of_means": {name: round(z, 2) for name, z in largest.items()},
        "means_agree": all(z <= _LARGEST_Z for z in largest.values()),
    }


def _z_of_means(ours: Run, other: Run) -> Float[np.ndarray, " n_features"]:
    """Returns how many Monte Carlo standard errors lie between the two means of each weight."""
    return np.asarray(np.abs(ours.mean - other.mean) / np.hypot(ours.error, other.error))


def _draw_curve(updates: dict[int, list[Run]]) -> Figure:
    from app.bench.posterior_figure import draw  # matplotlib takes a second to import

    return draw({k: [1e3 * r.seconds for r in of_k] for k, of_k in updates.items()})


def _timed(compute: Callable[[], _Value]) -> tuple[float, _Value]:
    began = time.perf_counter()
    value = compute()
    return time.perf_counter() - began, value
