"""How good a drive the bank finds, and how fast, beside random starts: ten, as the paper takes, and a thousand."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from rich.progress import Progress

from app.bench.report import BenchError, provenance, spread
from study_core.bank import N_CLIMBS, Bank, build_bank
from study_core.domain import Domain, domain_named
from study_core.posterior.prior import Prior
from study_core.streams import stream
from study_core.trajectory import BestTrajectories, best_from_bank, best_trajectories

_DOMAIN = "driving-v1"
_PLAIN_STARTS = 10

# A reward may be zero or negative, so a share of it means nothing there: the tolerance is a share of how far apart the
# bank's best and worst drives are for the same w.
_TOLERANCE = 1e-3

_Way = Callable[[Float[np.ndarray, "n_weights n_features"]], BestTrajectories]


def run(
    seed: int, progress: Progress, n_weights: int = 200, n_reference_starts: int = 1000
) -> dict[str, Any]:
    """Looks for the best drive of random weights in three ways, one thread, kernels warm.

    Args:
        seed: Of the weights, uniform on the nonnegative sphere, and of all starts; the bank is built from its own.
        progress: Shows how far it is.
        n_weights: How many weight vectors.
        n_reference_starts: Random starts that the bank is compared with in quality.

    Returns:
        `share_at_least_as_good` as the best of the reference's starts, within a thousandth of the range of rewards;
        the same for ten starts; `ratio_to_10_starts`, the time of the bank's search over that of ten starts, for
        weights one by one (medians) and all at once; the bank's size and the seconds it takes to build.

    Raises:
        BenchError: Fewer than one weight vector, or fewer reference starts than ten.
    """
    if n_weights < 1 or n_reference_starts < _PLAIN_STARTS:
        raise BenchError(
            f"Expected at least 1 weight vector and {_PLAIN_STARTS} starts, got {n_weights} and {n_reference_starts}."
        )
    domain = domain_named(_DOMAIN)
    bank, build_seconds = _built(domain, progress)
    weights = Prior("sphere", len(domain.feature_names)).draw(stream(seed, "bench-weights"), n_weights)
    reference = _reference(domain, seed, weights, n_reference_starts, progress)
    starts = stream(seed, "bench-plain-starts")
    ways: dict[str, _Way] = {
        "bank": lambda some: best_from_bank(domain, bank, some),
        "10_starts": lambda some: best_trajectories(starts, domain, some, _PLAIN_STARTS),
    }
    one_by_one = _one_by_one(ways, weights, progress)
    at_once = {name: _timed(way, weights) for name, way in ways.items()}
    banked, plain = at_once["bank"][1], at_once["10_starts"][1]
    shortfalls = _shortfalls(bank, weights, reference, banked.rewards)
    plain_shortfalls = _shortfalls(bank, weights, reference, plain.rewards)
    return {
        "share_at_least_as_good": _share(shortfalls <= _TOLERANCE),
        "share_at_least_as_good_of_10_starts": _share(plain_shortfalls <= _TOLERANCE),
        "share_within_a_thousandth_of_the_reward": _share(
            reference - banked.rewards <= _TOLERANCE * np.abs(reference)
        ),
        "share_converged": _share(banked.has_converged),
        "ratio_to_10_starts": {
            "one_by_one": _ratio(np.median(one_by_one["bank"]), np.median(one_by_one["10_starts"])),
            "at_once": _ratio(at_once["bank"][0], at_once["10_starts"][0]),
        },
        "milliseconds": {name: spread(times) for name, times in one_by_one.items()},
        "largest_shortfall": {
            "bank": float(f"{shortfalls.max():.2g}"),
            "10_starts": float(f"{plain_shortfalls.max():.2g}"),
        },
        "weights": n_weights,
        "reference_starts": n_reference_starts,
        "bank": {
            "climbs": N_CLIMBS,
            "drives": len(bank.controls),
            "build_seconds": round(build_seconds, 2),
            "digest": bank.digest,
        },
        **provenance(seed),
    }


def _built(domain: Domain, progress: Progress) -> tuple[Bank, float]:
    """Builds the bank, whatever the cache holds, once its kernels are compiled."""
    build_bank(domain, 10)
    task = progress.add_task("bank", total=N_CLIMBS)
    began = time.perf_counter()
    bank = build_bank(domain, on_progress=lambda done, total: progress.update(task, completed=done))
    return bank, time.perf_counter() - began


def _one_by_one(
    ways: dict[str, _Way], weights: Float[np.ndarray, "n_weights n_features"], progress: Progress
) -> dict[str, list[float]]:
    """Returns the milliseconds that each way takes for each weight vector."""
    milliseconds: dict[str, list[float]] = {name: [] for name in ways}
    for way in ways.values():
        way(weights[:1])  # the first call compiles
    # In turns, so that whatever else the machine does falls on all.
    for row in progress.track(range(len(weights)), description="one by one"):
        for name, way in ways.items():
            milliseconds[name].append(_timed(way, weights[row : row + 1])[0])
    return milliseconds


def _reference(
    domain: Domain,
    seed: int,
    weights: Float[np.ndarray, "n_weights n_features"],
    n_starts: int,
    progress: Progress,
) -> Float[np.ndarray, " n_weights"]:
    """Returns the best reward of many random starts for each weight vector."""
    return np.concatenate(
        [
            best_trajectories(
                stream(seed, "bench-reference", row), domain, weights[row : row + 1], n_starts
            ).rewards
            for row in progress.track(range(len(weights)), description=f"{n_starts} starts each")
        ]
    )


def _shortfalls(
    bank: Bank,
    weights: Float[np.ndarray, "n_weights n_features"],
    reference: Float[np.ndarray, " n_weights"],
    rewards: Float[np.ndarray, " n_weights"],
) -> Float[np.ndarray, " n_weights"]:
    """Returns what each reward lacks, as a share of the range of rewards over the bank's drives."""
    over_the_bank = weights @ bank.features.T
    shortfalls: Float[np.ndarray, " n_weights"] = (reference - rewards) / np.ptp(over_the_bank, axis=1)
    return shortfalls


def _timed(way: _Way, weights: Float[np.ndarray, "n_weights n_features"]) -> tuple[float, BestTrajectories]:
    began = time.perf_counter()
    value = way(weights)
    return 1e3 * (time.perf_counter() - began), value


def _ratio(ours: float | np.floating[Any], theirs: float | np.floating[Any]) -> float:
    return round(float(ours / theirs), 3)


def _share(flags: Bool[np.ndarray, " n_weights"]) -> float:
    return round(float(flags.mean()), 4)
