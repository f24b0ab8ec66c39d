"""BlackJAX's Hamiltonian Monte Carlo (Cabezas et al. 2024), many chains at once.

With a fixed number of leapfrog steps the chains stay in step, and JAX turns them into vector instructions. That is
fast where the posterior is inside the prior and slow to converge where it leans on an edge: y has a long tail there.
"""

from __future__ import annotations

import blackjax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from app.bench.peers.jax_target import log_density, to_points, to_weights
from app.bench.peers.target import draw_starts

_N_CHAINS, _N_WARMUP, _N_DRAWS, _N_LEAPFROG = 64, 300, 1000, 6

SETTINGS = (
    f"HMC, {_N_LEAPFROG} leapfrogs, dense metric, {_N_CHAINS} chains at once, {_N_WARMUP} + {_N_DRAWS} steps"
)


def draw(
    seed: int, preferred_diffs: Float[np.ndarray, "n_answers n_features"]
) -> Float[np.ndarray, "n_chains n_draws n_features"]:
    """Draws with `jax_target`'s coordinates; each chain learns step size and metric in its warm-up."""
    starts = draw_starts(np.random.default_rng(seed), preferred_diffs, _N_CHAINS)
    keys = jax.random.split(jax.random.key(seed), _N_CHAINS)
    points = _run_chains(keys, to_points(starts), jnp.asarray(preferred_diffs))
    return to_weights(np.asarray(points))


@jax.jit
def _run_chains(keys: jax.Array, starts: jax.Array, preferred_diffs: jax.Array) -> jax.Array:
    return jax.vmap(_run_chain, in_axes=(0, 0, None))(keys, starts, preferred_diffs)


def _run_chain(key: jax.Array, start: jax.Array, preferred_diffs: jax.Array) -> jax.Array:
    def density(point: jax.Array) -> jax.Array:
        return log_density(point, preferred_diffs)

    warmup_key, sampling_key = jax.random.split(key)
    warmup = blackjax.window_adaptation(
        blackjax.hmc, density, is_mass_matrix_diagonal=False, num_integration_steps=_N_LEAPFROG
    )
    (state, parameters), _ = warmup.run(warmup_key, start, _N_WARMUP)
    chain = blackjax.hmc(density, **parameters)

    def step(
        state: blackjax.mcmc.hmc.HMCState, key: jax.Array
    ) -> tuple[blackjax.mcmc.hmc.HMCState, jax.Array]:
        state, _ = chain.step(key, state)
        return state, state.position

    _, points = jax.lax.scan(step, state, jax.random.split(sampling_key, _N_DRAWS))
    return points
