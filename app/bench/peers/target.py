"""The target that every sampler of `prefstudy bench posterior` draws from, written without the product's own code.

    p(w | answers)  proportional to  prod_i [ lapse / 2 + (1 - lapse) sigmoid(beta w . psi_i) ],  w >= 0, |w| = 1

with psi = Phi(preferred) - Phi(other).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

RATIONALITY = 200.0
LAPSE_RATE = 0.1

# Candidates from the prior among which the chains' starts are drawn by their likelihood.
_N_CANDIDATES = 2048


def log_likelihood(
    weights: Float[np.ndarray, "n n_features"], preferred_diffs: Float[np.ndarray, "n_answers n_features"]
) -> Float[np.ndarray, " n"]:
    """Returns log p(answers | w) of each row of weights."""
    utilities = RATIONALITY * (weights @ preferred_diffs.T)
    # Far beyond, exp would overflow, and the lapse rate decides anyway.
    likely = 0.5 * LAPSE_RATE + (1.0 - LAPSE_RATE) / (1.0 + np.exp(-np.maximum(utilities, -500.0)))
    return np.asarray(np.log(likely).sum(axis=1))


def draw_starts(
    rng: np.random.Generator, preferred_diffs: Float[np.ndarray, "n_answers n_features"], n_chains: int
) -> Float[np.ndarray, "n_chains n_features"]:
    """Returns different starts, drawn from the prior in proportion to their likelihood (the Gumbel trick)."""
    candidates = np.abs(rng.standard_normal((_N_CANDIDATES, preferred_diffs.shape[1])))
    candidates /= np.linalg.norm(candidates, axis=1, keepdims=True)
    scores = log_likelihood(candidates, preferred_diffs) + rng.gumbel(size=_N_CANDIDATES)
    return candidates[np.argsort(-scores)[:n_chains]]
