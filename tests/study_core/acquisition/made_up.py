"""Posteriors and banks that nobody inferred or climbed to, whose scores can be worked out one by one."""

import numpy as np

from study_core.acquisition.pairs import Situation
from study_core.bank import Bank
from study_core.choice import ResponseParameters
from study_core.domains.driving import DRIVING_V1
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.run import Posterior

NONE = Diagnostics(np.ones(4), np.ones(4), np.ones(4), 0.3, 4000)


def posterior_of(samples, rationality=100.0, lapse_rate=0.1, tie_threshold=0.0, log_densities=None):
    """A posterior with the given samples; each parameter is one number, or one for each sample."""
    n = len(samples)
    columns = (np.broadcast_to(value, n).astype(float) for value in (rationality, lapse_rate, tie_threshold))
    logs = np.zeros(n) if log_densities is None else np.array(log_densities)
    return Posterior(samples, ResponseParameters(*columns), logs, samples.mean(axis=0), NONE)


def varied_posterior(n, with_ties, seed=0):
    """Samples whose response parameters all differ."""
    rng = np.random.default_rng(seed)
    samples = np.abs(rng.normal(size=(n, 4)))
    samples /= np.linalg.norm(samples, axis=1, keepdims=True)
    ties = rng.uniform(0.2, 1.5, n) if with_ties else 0.0
    return posterior_of(samples, rng.uniform(5.0, 200.0, n), rng.uniform(0.0, 0.3, n), ties)


def bank_of(features, places):
    """A bank of drives with these features, that lie along a line at these places, in body lengths."""
    n = len(features)
    controls = np.linspace(-1.0, 1.0, 10 * n).reshape(n, 10)
    weights = np.abs(np.random.default_rng(n).normal(size=(n, 4)))
    paths = np.array(places, dtype=np.float32)[:, None, None]
    return Bank(DRIVING_V1.id, "ba" * 32, controls, np.array(features), weights, paths)


def situation_of(posterior, bank=None, min_difference=0.0):
    return Situation(DRIVING_V1, posterior, bank, 0.1, min_difference)


def rows_of(bank, ranked):
    """Which rows of the bank each ranked pair is made of, the lower first."""
    rows = {drive.tobytes(): row for row, drive in enumerate(bank.controls)}
    return [tuple(sorted(rows[drive.tobytes()] for drive in pair)) for pair in ranked.controls]
