"""How long the most informative pair takes to find, beside APReL's exhaustive search over a few fixed trajectories."""

from __future__ import annotations

import math
import time
from collections import defaultdict
from typing import Any

import numpy as np
from jaxtyping import Float
from rich.progress import Progress

from app.bench import aprel
from app.bench.answers import RESPONSE, prior_of, simulated_answers
from app.bench.peers.target import LAPSE_RATE, RATIONALITY
from app.bench.report import percentile
from app.settings import find_study
from study_core.acquisition import acquisition_named
from study_core.acquisition.information_gain import information_gains
from study_core.acquisition.pairs import Situation
from study_core.bank import open_bank
from study_core.posterior.run import Posterior, infer
from study_core.streams import stream
from study_core.study import Study

METHOD = "information-gain-realistic"
N_TRAJECTORIES = (40, 100)
_STUDY = "quickstart"
_N_SEARCHES = 5
_WAYS = {"aprel_looped": aprel.looped_best_pair, "aprel_vectorised": aprel.vectorised_best_pair}

Measures = dict[str, list[float]]


def compare(seed: int, progress: Progress, n_people: int, n_answers: int) -> dict[str, Any]:
    """Searches for the most informative pair after some answers, both ways.

    Both know the same posterior: APReL's way 100 samples of it and 40 or 100 drives of the bank, ours every sample that
    the study asks for and the whole bank.

    Args:
        seed: Of the simulated people.
        progress: Shows how far it is.
        n_people: How many, each with a posterior of their own.
        n_answers: What each has answered before.

    Returns:
        Medians: `milliseconds` of ours and of APReL's way, looped and vectorised, by its number of trajectories; the
        ratios of these; and `gain_bits`, how much the answer to the chosen pair is expected to tell.
    """
    study = find_study(_STUDY)
    milliseconds: Measures = defaultdict(list)
    gains: Measures = defaultdict(list)
    for number in progress.track(range(1, n_people + 1), description="most informative pairs"):
        answers = simulated_answers(study.domain, seed, number, n_answers)
        rng = stream(seed, "bench-information-gain", number)
        posterior = infer(rng, prior_of(study.domain), RESPONSE, answers.comparisons, study.sampler)
        _search_our_way(rng, study, posterior, milliseconds, gains)
        for n in N_TRAJECTORIES:
            _search_aprels_way(rng, study, posterior, n, milliseconds, gains)
    medians = {name: percentile(values, 50) for name, values in milliseconds.items()}
    return {
        "milliseconds": medians,
        "ratios": {
            name: round(value / medians["prefstudy"], 1)
            for name, value in medians.items()
            if name != "prefstudy"
        },
        "gain_bits": {name: percentile(values, 50) for name, values in gains.items()},
    }


def _search_our_way(
    rng: np.random.Generator, study: Study, posterior: Posterior, milliseconds: Measures, gains: Measures
) -> None:
    bank, section = open_bank(study.domain), study.file.acquisition
    situation = Situation(study.domain, posterior, bank, section.mu, section.min_difference)
    rank_pairs = acquisition_named(METHOD).rank_pairs
    rank_pairs(rng, situation, 1)  # compiles
    for _ in range(_N_SEARCHES):
        began = time.perf_counter()
        ranked = rank_pairs(rng, situation, 1)
        milliseconds["prefstudy"].append(1e3 * (time.perf_counter() - began))
        gains["prefstudy"].append(float(ranked.scores[0]) / math.log(2.0))


def _search_aprels_way(
    rng: np.random.Generator,
    study: Study,
    posterior: Posterior,
    n_trajectories: int,
    milliseconds: Measures,
    gains: Measures,
) -> None:
    features = rng.choice(open_bank(study.domain).features, n_trajectories, replace=False)
    samples = rng.choice(posterior.samples, min(aprel.N_SAMPLES, len(posterior.samples)), replace=False)
    for way, best_pair in _WAYS.items():
        began = time.perf_counter()
        first, second = best_pair(features, samples, RATIONALITY, LAPSE_RATE)
        milliseconds[f"{way}_{n_trajectories}"].append(1e3 * (time.perf_counter() - began))
        gains[f"{way}_{n_trajectories}"].append(_gain_bits(posterior, features[first] - features[second]))


def _gain_bits(posterior: Posterior, feature_diff: Float[np.ndarray, " n_features"]) -> float:
    """Returns what the answer to one pair is expected to tell, by all samples."""
    gains, _ = information_gains(posterior, feature_diff[None])
    return float(gains[0]) / math.log(2.0)
