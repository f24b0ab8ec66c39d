"""Information gain over realistic drives: the pair of the bank whose answer would say most about the person.

    maximise over pairs of the bank    I(answer; w) = H(mean_w p(answer | w)) - mean_w H(p(answer | w))

The gain is that of Biyik et al. (2019), "Asking Easy Questions", eq. 4, in nats, over the posterior's samples, each
with its own rationality, lapse rate and tie threshold. Free to choose any controls, it shows people absurd drives
(Katz et al. 2021, Fig. 1); each drive of a bank is locally the best for some w.

An answer says little about two drives of which the samples agree that one is better. So the drives are sorted by what
they are worth to the mean sample, and pairs are drawn whose ranks lie at a log-uniform distance: most of them close
together, some at any distance. They are screened by a quick estimate on a few samples; the best of them that look
different are scored on all samples.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from study_core.acquisition import kernels
from study_core.acquisition.bank_pairs import bank_of, ranked_drives
from study_core.acquisition.information_gain import information_gains
from study_core.acquisition.pairs import Acquisition, RankedTrajectories, Situation
from study_core.bank import Bank
from study_core.distinctness import visible_difference
from study_core.posterior.run import Posterior

_N_SCREENED = 10_000
_N_SCREENING_SAMPLES = 64
_N_SCORED = 128


def rank_pairs(rng: np.random.Generator, situation: Situation, n_pairs: int) -> RankedTrajectories:
    """Returns the most informative pairs found; see `study_core.acquisition.pairs.RankFn`."""
    bank = bank_of(situation)
    pairs = _draw_open_pairs(rng, bank, situation.posterior)
    estimates = _estimated_gains(bank, pairs, situation.posterior)
    promising = pairs[np.argsort(-estimates, kind="stable")[:_N_SCORED]]
    distinct = _distinct(bank, promising, situation.min_difference)
    psis = bank.features[distinct[:, 0]] - bank.features[distinct[:, 1]]
    gains, _ = information_gains(situation.posterior, psis)
    best = np.argsort(-gains, kind="stable")[:n_pairs]
    return ranked_drives(bank, distinct[best], gains[best])


def _draw_open_pairs(
    rng: np.random.Generator, bank: Bank, posterior: Posterior
) -> Int[np.ndarray, "n_pairs 2"]:
    """Returns random pairs, no pair twice, most of which are worth about the same to the mean sample."""
    n_drives = len(bank.controls)
    if n_drives * (n_drives - 1) // 2 <= _N_SCREENED:
        return np.column_stack(np.triu_indices(n_drives, k=1))
    by_worth = np.argsort(bank.features @ posterior.samples.mean(axis=0), kind="stable")
    distances = np.exp(rng.uniform(0.0, np.log(n_drives), _N_SCREENED)).astype(np.int64)
    lower = rng.integers(n_drives, size=_N_SCREENED)
    is_inside = lower + distances < n_drives
    codes = np.unique(lower[is_inside] * n_drives + distances[is_inside])
    ranks, apart = np.divmod(codes, n_drives)
    return np.column_stack([by_worth[ranks], by_worth[ranks + apart]])


def _estimated_gains(
    bank: Bank, pairs: Int[np.ndarray, "n_pairs 2"], posterior: Posterior
) -> Float[np.ndarray, " n_pairs"]:
    """Returns the screening estimate of each pair's gain, on evenly spaced samples."""
    n_samples = len(posterior.samples)
    rows = np.linspace(0, n_samples - 1, min(n_samples, _N_SCREENING_SAMPLES)).round().astype(np.int64)
    parameters = posterior.parameters[rows]
    utilities_per_feature = np.ascontiguousarray(
        (posterior.samples[rows] * parameters.rationality[:, None]).T
    )
    estimates: Float[np.ndarray, " n_pairs"] = kernels.screen(
        bank.features, pairs, utilities_per_feature, parameters.lapse_rate, parameters.tie_threshold
    )
    return estimates


def _distinct(
    bank: Bank, pairs: Int[np.ndarray, "n_pairs 2"], min_difference: float
) -> Int[np.ndarray, "n_distinct 2"]:
    """Returns the pairs that look different enough; all of them if none does, since something has to be returned."""
    apart = visible_difference(bank.paths[pairs[:, 0]], bank.paths[pairs[:, 1]])
    distinct = pairs[apart >= min_difference]
    return distinct if len(distinct) else pairs


INFORMATION_GAIN_REALISTIC = Acquisition("information-gain-realistic-1", rank_pairs, needs_bank=True)
