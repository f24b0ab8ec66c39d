"""emcee (Foreman-Mackey et al. 2013): an ensemble of walkers, no gradients, every walker's density in one numpy call.

Of its moves, proposals from a kernel density estimate of the other half of the ensemble (`KDEMove`) gave the largest
effective sample size per second of those tried (stretch, differential evolution with and without snooker steps).
Walkers of one ensemble depend on each other, and R-hat over them often stays above 1.01.
"""

from __future__ import annotations

import emcee
import numpy as np
from jaxtyping import Float

from app.bench.peers.target import draw_starts, log_likelihood

_N_WALKERS, _N_WARMUP, _N_DRAWS = 128, 40, 1000

SETTINGS = f"KDEMove, {_N_WALKERS} walkers, {_N_WARMUP} + {_N_DRAWS} steps"


def draw(
    seed: int, preferred_diffs: Float[np.ndarray, "n_answers n_features"]
) -> Float[np.ndarray, "n_walkers n_draws n_features"]:
    """Draws in the coordinates s_1 ... s_(d-1) of s = w / sum(w), where the prior density is |s|^-d."""
    n_features = preferred_diffs.shape[1]

    def log_density(points: Float[np.ndarray, "n n_points"]) -> Float[np.ndarray, " n"]:
        simplex = _to_simplex(points)
        lengths = np.linalg.norm(simplex, axis=1)
        densities = log_likelihood(simplex / lengths[:, None], preferred_diffs) - n_features * np.log(lengths)
        return np.where((simplex > 0.0).all(axis=1), densities, -np.inf)

    starts = draw_starts(np.random.default_rng(seed), preferred_diffs, _N_WALKERS)
    ensemble = emcee.EnsembleSampler(
        _N_WALKERS, n_features - 1, log_density, moves=emcee.moves.KDEMove(), vectorize=True
    )
    ensemble.random_state = np.random.RandomState(seed).get_state()
    ensemble.run_mcmc(starts[:, :-1] / starts.sum(axis=1, keepdims=True), _N_WARMUP + _N_DRAWS)
    simplex = _to_simplex(ensemble.get_chain(discard=_N_WARMUP).transpose(1, 0, 2))
    return np.asarray(simplex / np.linalg.norm(simplex, axis=-1, keepdims=True))


def _to_simplex(points: Float[np.ndarray, "*shape n_points"]) -> Float[np.ndarray, "*shape n_features"]:
    return np.concatenate([points, 1.0 - points.sum(axis=-1, keepdims=True)], axis=-1)
