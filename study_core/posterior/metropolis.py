"""Metropolis-Hastings chains whose proposals the warm-up has learned and sampling leaves alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from study_core.posterior import kernels
from study_core.posterior.annealing import Proposal
from study_core.posterior.target import Target

VERSION = "mixture-metropolis-1"

# Each sweep, which ends in a draw: leaps to a point of the mixture, then steps of a random walk, more of them the
# more coordinates, since the mixture fits less well there.
_N_LEAPS = 2
_COORDINATES_PER_STEP = 4
_SWEEPS_BEFORE_DRAWING = 20


@dataclass(frozen=True)
class Chains:
    """Draws of several chains, in the target's coordinates.

    Attributes:
        points: Coordinates at the end of every sweep, shape `(n_chains, n_draws, n)`.
        acceptance: Share of leaps that were accepted: how well the mixture fits.
    """

    points: Float[np.ndarray, "n_chains n_draws n"]
    acceptance: float


def run_chains(rng: np.random.Generator, target: Target, proposal: Proposal, n_draws: int) -> Chains:
    """Draws from the posterior.

    Args:
        rng: Source of all randomness.
        target: What is sampled.
        proposal: What has been learned before; it stays as it is. A chain starts at each of its starts.
        n_draws: Draws of each chain that are kept, after some that let it forget its start.
    """
    n_chains, n = proposal.starts.shape
    n_sweeps, n_steps = _SWEEPS_BEFORE_DRAWING + n_draws, 1 + n // _COORDINATES_PER_STEP
    leaps = proposal.mixture.draw(rng, n_chains * n_sweeps * _N_LEAPS)
    leap_densities = proposal.mixture.log_density(leaps)
    # Roberts, Gelman and Gilks (1997): the best random walk for a normal target.
    walk_factor = 2.38 / np.sqrt(n) * np.linalg.cholesky(proposal.covariance)
    points, n_accepted = kernels.sample(
        target.for_kernels,
        proposal.starts.copy(),
        proposal.mixture.for_kernels,
        walk_factor,
        leaps.reshape(n_chains, n_sweeps, _N_LEAPS, n),
        leap_densities.reshape(n_chains, n_sweeps, _N_LEAPS),
        rng.standard_normal((n_chains, n_sweeps, n_steps, n)),
        rng.standard_exponential((n_chains, n_sweeps, _N_LEAPS + n_steps)),
    )
    return Chains(points[:, _SWEEPS_BEFORE_DRAWING:], n_accepted / len(leaps))
