"""NumPyro's no-U-turn sampler (Phan et al. 2019), the customary choice: step size and metric learned in warm-up.

The whole run is one compiled function: `numpyro.infer.MCMC` would prepare each run anew, in seconds.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from numpyro.infer.hmc import hmc

from app.bench.peers.jax_target import log_density, to_points, to_weights
from app.bench.peers.target import draw_starts

_N_CHAINS, _N_WARMUP, _N_DRAWS = 4, 300, 2000

SETTINGS = f"NUTS, dense metric, {_N_CHAINS} chains vectorised, {_N_WARMUP} + {_N_DRAWS} steps"


def draw(
    seed: int, preferred_diffs: Float[np.ndarray, "n_answers n_features"]
) -> Float[np.ndarray, "n_chains n_draws n_features"]:
    """Draws with `jax_target`'s coordinates."""
    starts = draw_starts(np.random.default_rng(seed), preferred_diffs, _N_CHAINS)
    keys = jax.random.split(jax.random.key(seed), _N_CHAINS)
    points = _run_chains(keys, to_points(starts), jnp.asarray(preferred_diffs))
    return to_weights(np.asarray(points))


@jax.jit
def _run_chains(keys: jax.Array, starts: jax.Array, preferred_diffs: jax.Array) -> jax.Array:
    return jax.vmap(_run_chain, in_axes=(0, 0, None))(keys, starts, preferred_diffs)


def _run_chain(key: jax.Array, start: jax.Array, preferred_diffs: jax.Array) -> jax.Array:
    initialise, advance = hmc(lambda point: -log_density(point, preferred_diffs), algo="NUTS")
    state = initialise(start, num_warmup=_N_WARMUP, dense_mass=True, rng_key=key)

    def step(state: Any, _: None) -> tuple[Any, jax.Array]:
        state = advance(state)
        return state, state.z

    _, points = jax.lax.scan(step, state, length=_N_WARMUP + _N_DRAWS)
    return points[_N_WARMUP:]
