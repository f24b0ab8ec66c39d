"""What is sampled: weights and the response parameters that are inferred, given the answers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from study_core.choice import PARAMETER_PRIORS, ResponseModel, ResponseParameters
from study_core.choice_kernels import pack
from study_core.comparison import ComparisonSet
from study_core.posterior import kernels
from study_core.posterior.kernels import KernelTarget
from study_core.posterior.prior import Prior


@dataclass(frozen=True)
class Target:
    """The joint posterior of w and the inferred response parameters, in unbounded coordinates.

    The first coordinates are the prior's, then one for each inferred parameter, standard normal under its prior.
    Where the people before are known, `draw_prior` and `log_normaliser` leave them out, and `log_densities` counts
    what they say with the answers.

    Attributes:
        prior: Prior over w.
        response: Response model, with no parameter left to be chosen by the evidence.
        comparisons: The answers.
    """

    prior: Prior
    response: ResponseModel
    comparisons: ComparisonSet

    @property
    def n_coordinates(self) -> int:
        """Returns how many coordinates there are."""
        return self.prior.n_coordinates + len(self.response.inferred)

    @cached_property
    def for_kernels(self) -> KernelTarget:
        """Returns the target as the kernels take it."""
        fixed, places, locations, scales = np.zeros(3), np.full(3, -1), np.zeros(3), np.zeros(3)
        for k, (name, setting) in enumerate(self.response.settings.items()):
            if setting == "inferred":
                places[k] = self.prior.n_coordinates + self.response.inferred.index(name)
                locations[k], scales[k] = PARAMETER_PRIORS[name].location, PARAMETER_PRIORS[name].scale
            else:
                assert not isinstance(setting, str), "the evidence chooses before anything is sampled"
                fixed[k] = setting
        answers = pack(self.comparisons.feature_diffs, self.comparisons.signs)
        response = (fixed, places, locations, scales)
        return (
            self.prior.kernel_support,
            self.prior.n_features,
            self.response.kernel_kind,
            response,
            answers,
            self._population_for_kernels(),
        )

    def _population_for_kernels(
        self,
    ) -> tuple[Float[np.ndarray, " n_known"], Float[np.ndarray, "n_known n_known"]]:
        """Returns mean and precision of what the people before care for; empty without them."""
        population = self.prior.population
        if population is None:
            return np.empty(0), np.empty((0, 0))
        assert self.prior.support == "sphere", "on the ball the length of w isn't the rationality's"
        assert self.response.settings["rationality"] == "inferred", "utilities have a length of their own"
        return population.mean.copy(), population.precision

    def draw_prior(self, rng: np.random.Generator, n: int) -> Float[np.ndarray, "n n_coordinates"]:
        """Returns the coordinates of n independent draws from the prior."""
        weights = self.prior.coordinates(self.prior.draw(rng, n))
        return np.hstack([weights, rng.standard_normal((n, len(self.response.inferred)))])

    def log_densities(
        self, points: Float[np.ndarray, "n n_coordinates"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Returns the log prior density of each point, without `log_normaliser`, and its log-likelihood.

        What the people before say is part of the second, up to a constant.
        """
        log_priors, log_likelihoods = kernels.log_densities(self.for_kernels, points)
        return log_priors, log_likelihoods

    @property
    def log_normaliser(self) -> float:
        """Returns the logarithm of the prior density's integral over all coordinates."""
        return self.prior.log_normaliser + 0.5 * len(self.response.inferred) * float(np.log(2.0 * np.pi))

    def weights(self, points: Float[np.ndarray, "n n_coordinates"]) -> Float[np.ndarray, "n n_features"]:
        """Returns the weights of each point."""
        return self.prior.weights(points[:, : self.prior.n_coordinates])

    def parameters(self, points: Float[np.ndarray, "n n_coordinates"]) -> ResponseParameters:
        """Returns the response parameters of each point."""
        columns = points[:, self.prior.n_coordinates :].T
        inferred = {
            name: PARAMETER_PRIORS[name].value(column)
            for name, column in zip(self.response.inferred, columns, strict=True)
        }
        return self.response.parameters(len(points), inferred)
