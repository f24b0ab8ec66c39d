"""The target in JAX, on all of R^(d-1), as gradient-based samplers need it.

The coordinates are the logarithms of ratios y_k = log(w_k / w_d), k < d. With s = softmax(y, 0), so that w = s / |s|,
the uniform density on the sphere has |s|^-d per unit of s_1 ... s_(d-1) (the gnomonic projection), and these have
s_1 ... s_d per unit of y (the determinant of the softmax): the log prior density is sum_k log s_k - d log |s|.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from app.bench.peers import Draw
from app.bench.peers.target import LAPSE_RATE, RATIONALITY, draw_starts

# The precision that every other sampler here works in.
jax.config.update("jax_enable_x64", True)

RunChain = Callable[[jax.Array, jax.Array, jax.Array], jax.Array]
"""Returns the points of one chain from its random key, its start and the answers."""


def all_chains(run_chain: RunChain, n_chains: int) -> Draw:
    """Returns a sampler that runs chains from starts of their own in one compiled function."""
    run_chains = jax.jit(jax.vmap(run_chain, in_axes=(0, 0, None)))

    def draw(
        seed: int, preferred_diffs: Float[np.ndarray, "n_answers n_features"]
    ) -> Float[np.ndarray, "n_chains n_draws n_features"]:
        starts = draw_starts(np.random.default_rng(seed), preferred_diffs, n_chains)
        keys = jax.random.split(jax.random.key(seed), n_chains)
        return to_weights(np.asarray(run_chains(keys, to_points(starts), jnp.asarray(preferred_diffs))))

    return draw


def log_density(point: jax.Array, preferred_diffs: jax.Array) -> jax.Array:
    """Returns the log posterior density at y, up to a constant."""
    log_simplex = jax.nn.log_softmax(jnp.append(point, 0.0))
    simplex = jnp.exp(log_simplex)
    length = jnp.linalg.norm(simplex)
    utilities = RATIONALITY * (preferred_diffs @ (simplex / length))
    likely = 0.5 * LAPSE_RATE + (1.0 - LAPSE_RATE) * jax.nn.sigmoid(utilities)
    return log_simplex.sum() - len(simplex) * jnp.log(length) + jnp.log(likely).sum()


def to_points(weights: Float[np.ndarray, "n n_features"]) -> jax.Array:
    """Returns y of each row of weights."""
    return jnp.asarray(np.log(weights[:, :-1] / weights[:, -1:]))


def to_weights(points: Float[np.ndarray, "*shape n_points"]) -> Float[np.ndarray, "*shape n_features"]:
    """Returns w of each row of y."""
    logs = np.concatenate([points, np.zeros((*points.shape[:-1], 1))], axis=-1)
    ratios = np.exp(logs - logs.max(axis=-1, keepdims=True))
    return np.asarray(ratios / np.linalg.norm(ratios, axis=-1, keepdims=True))
