"""A learned feature on top of what a person's calibrated posterior already explains, as much of it as pays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from study_core.comparison import Choice
from study_core.domain import Domain
from study_core.networks.config import NetworkConfig
from study_core.networks.model import Networks
from study_core.networks.training import Lesson, train
from study_core.posterior.run import Posterior
from study_core.predictors.hand_coded import learn_posterior
from study_core.predictors.own_answers import OwnAnswers, hand_coded_diffs
from study_core.predictors.personal_network import examples, learn_by_networks
from study_core.predictors.predictor import Pairs, Training

CONFIG = NetworkConfig(has_hand_coded=False, n_trials=8, n_selected=8, training_share=1.0, weight_decay=0.3)
"""Chosen on the published training answers, by five-fold cross-validation of each person's own."""

SHARES = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
_N_FOLDS = 5


@dataclass(frozen=True)
class CalibratedNetworkModel:
    """Somebody known by a posterior of the hand-coded weights, and by networks of what that doesn't explain.

    Attributes:
        domain: Whose trajectories the networks see.
        config: What they are, and how they were trained.
        posterior: Of the hand-coded features' weights, rationality and lapse rate.
        networks: All that were trained; what they add to the log-odds is averaged.
        share: How much of that average is believed, from 0 to 1.
    """

    domain: Domain
    config: NetworkConfig
    posterior: Posterior
    networks: Networks
    share: float

    def probability_of_a(self, pairs: Pairs) -> Float[np.ndarray, " n"]:
        """Returns the posterior predictive probability, each sample's log-odds moved by what was learned."""
        return _shared_probabilities(self, pairs, (self.share,))[0]


@dataclass(frozen=True)
class PersonalCalibrated:
    """The calibrated posterior of a person, corrected by as much of a learned feature as their own answers support.

    The hand-coded reward, with rationality and lapse rate, stays as `hand-coded-calibrated` infers it. Small networks
    (no hand-coded part, weight decay) learn the rest of the log-odds, and the mean of several is taken. The share of it
    that is believed is the one of `SHARES` with the smallest cross-validated log loss on the person's own answers.
    Among the shares is 0, so there it is never worse than `hand-coded-calibrated`, which it then equals.

    Somebody with fewer than `FEWEST_ANSWERS` can't be trained on: `fit` refuses, and `with_person` returns the
    calibrated posterior alone, which without any answers is the prior predictive.

    Attributes:
        config: The networks and their training.
        n_threads: Threads that share the people.
    """

    config: NetworkConfig = CONFIG
    n_threads: int = 1
    name = "personal-calibrated"

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> OwnAnswers:
        """Draws each person's posterior, trains their networks and chooses their share.

        Raises:
            TooFewAnswersError: Somebody has given fewer than `FEWEST_ANSWERS`.
        """

        def learn(rng: np.random.Generator, training: Training) -> CalibratedNetworkModel:
            losses = self.cross_validated_losses(rng, domain, training)
            return self._fit_all(rng, domain, training, SHARES[int(losses.argmin())])

        return learn_by_networks(self.name, seed, domain, learn, people, self.n_threads)

    def cross_validated_losses(
        self, rng: np.random.Generator, domain: Domain, training: Training
    ) -> Float[np.ndarray, " n_shares"]:
        """Returns the mean of -log P(answer) for each of `SHARES`, of answers that were left out of the training."""
        folds = rng.permutation(len(training)) % _N_FOLDS
        likely = np.empty((len(SHARES), len(training)))
        for fold in range(_N_FOLDS):
            is_out = folds == fold
            model = self._fit_all(rng, domain, _rows(training, ~is_out), 1.0)
            of_a = _shared_probabilities(model, training.pairs[is_out], SHARES)
            likely[:, is_out] = np.where(training.signs[is_out] > 0.0, of_a, 1.0 - of_a)
        return -np.log(likely).mean(axis=1)

    def _fit_all(
        self, rng: np.random.Generator, domain: Domain, training: Training, share: float
    ) -> CalibratedNetworkModel:
        posterior = learn_posterior(rng, training, domain).posterior
        parameters = posterior.parameters
        log_odds = (parameters.rationality[:, None] * posterior.samples).mean(axis=0)
        known = hand_coded_diffs(domain, training.pairs) @ log_odds
        pairs = examples(domain, self.config, training.pairs, known)
        lesson = Lesson(pairs, training.signs, np.empty(0), float(parameters.lapse_rate.mean()))
        networks = train(rng, self.config, lesson).networks
        return CalibratedNetworkModel(domain, self.config, posterior, networks, share)


def _shared_probabilities(
    model: CalibratedNetworkModel, pairs: Pairs, shares: tuple[float, ...]
) -> Float[np.ndarray, "n_shares n"]:
    """Returns P(A) of each pair for each share of what the networks have learned."""
    posterior = model.posterior
    reward_diffs = posterior.samples @ hand_coded_diffs(model.domain, pairs).T
    learned = model.networks.learned_logits(examples(model.domain, model.config, pairs)).mean(axis=0)
    # As a difference of rewards, what is added to the log-odds is divided by each sample's rationality.
    added = learned / posterior.parameters.rationality[:, None]
    return np.stack(
        [
            posterior.parameters.probability_of(Choice.A, reward_diffs + share * added).mean(axis=0)
            for share in shares
        ]
    )


def _rows(training: Training, rows: Bool[np.ndarray, " n"]) -> Training:
    return Training(training.pairs[rows], training.signs[rows])
