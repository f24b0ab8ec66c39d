"""NumPyro's no-U-turn sampler (Phan et al. 2019), the customary choice: step size and metric learned in warm-up.

The whole run is one compiled function: `numpyro.infer.MCMC` would prepare each run anew, in seconds.
"""

from __future__ import annotations

from typing import Any

import jax
from numpyro.infer.hmc import hmc

from app.bench.peers.jax_target import all_chains, log_density

_N_CHAINS, _N_WARMUP, _N_DRAWS = 4, 300, 2000

SETTINGS = f"NUTS, dense metric, {_N_CHAINS} chains vectorised, {_N_WARMUP} + {_N_DRAWS} steps"


def _run_chain(key: jax.Array, start: jax.Array, preferred_diffs: jax.Array) -> jax.Array:
    initialise, advance = hmc(lambda point: -log_density(point, preferred_diffs), algo="NUTS")
    state = initialise(start, num_warmup=_N_WARMUP, dense_mass=True, rng_key=key)

    def step(state: Any, _: None) -> tuple[Any, jax.Array]:
        state = advance(state)
        return state, state.z

    _, points = jax.lax.scan(step, state, length=_N_WARMUP + _N_DRAWS)
    return points[_N_WARMUP:]


draw = all_chains(_run_chain, _N_CHAINS)
