"""BlackJAX's Hamiltonian Monte Carlo (Cabezas et al. 2024), many chains at once.

With a fixed number of leapfrog steps the chains stay in step, and JAX turns them into vector instructions. That is
fast where the posterior is inside the prior and slow to converge where it leans on an edge: y has a long tail there.
"""

from __future__ import annotations

import blackjax
import jax

from app.bench.peers.jax_target import all_chains, log_density

_N_CHAINS, _N_WARMUP, _N_DRAWS, _N_LEAPFROG = 64, 300, 4000, 6

SETTINGS = (
    f"HMC, {_N_LEAPFROG} leapfrogs, dense metric, {_N_CHAINS} chains at once, {_N_WARMUP} + {_N_DRAWS} steps"
)


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


draw = all_chains(_run_chain, _N_CHAINS)
