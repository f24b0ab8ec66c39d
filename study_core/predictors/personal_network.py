"""The paper's predictor: features learned by networks from one person's answers (Katz et al. 2021, section IV)."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
from jaxtyping import Float
from scipy.special import expit

from study_core.domain import Domain, domain_named
from study_core.errors import TooFewAnswersError
from study_core.networks.checkpoint import Checkpoint, Lineage
from study_core.networks.config import NetworkConfig
from study_core.networks.model import Examples, Networks
from study_core.networks.selection import best_trials
from study_core.networks.training import VERSION, Lesson, OnProgress, train
from study_core.predictors.hand_coded import learn_posterior, posterior_mean
from study_core.predictors.own_answers import Learn, OwnAnswers, hand_coded_diffs
from study_core.predictors.predictor import Pairs, PersonModel, Training

FEWEST_ANSWERS = 10

PUBLISHED_CODE = NetworkConfig(procedure="continued")
"""What made the paper's numbers. The paper's text has independent trials, which learn less of the same answers."""

# A network may be certain to the last bit; what a predictor says is not.
_LEAST_PROBABILITY = 1e-12


@dataclass(frozen=True)
class NetworkModel:
    """Somebody known by a few networks, each with linear weights of its own.

    Attributes:
        domain: Whose trajectories the networks see.
        config: What they are, and how they were trained.
        networks: Those that were selected, best first.
    """

    domain: Domain
    config: NetworkConfig
    networks: Networks

    def members_probability_of_a(self, pairs: Pairs) -> Float[np.ndarray, "n_networks n"]:
        """Returns each network's own probabilities; the paper reports the mean and spread of their accuracies."""
        return np.asarray(expit(self.networks.logits(examples(self.domain, self.config, pairs))))

    def probability_of_a(self, pairs: Pairs) -> Float[np.ndarray, " n"]:
        """Returns the mean of the networks' probabilities: one of them is right, and nobody knows which."""
        mean = self.members_probability_of_a(pairs).mean(axis=0)
        return mean.clip(_LEAST_PROBABILITY, 1.0 - _LEAST_PROBABILITY)


class PersonalNetwork:
    """Hand-coded features and one learned by a network, trained as published on each person's own answers.

    Of 40 trials the 5 that predict the last 30 % of the answers best are kept. Somebody with fewer than
    `FEWEST_ANSWERS` can't be trained on: `fit` refuses, and `with_person` returns the calibrated posterior of the
    hand-coded features, which without any answers is the prior predictive.

    Attributes:
        name: `personal-network`, or `personal-network-independent` where the trials are, as the paper's text has it.
        config: The networks and their training; the published code's unless told.
        n_threads: Threads that share the people.
    """

    def __init__(self, config: NetworkConfig = PUBLISHED_CODE, n_threads: int = 1) -> None:
        self.name = "personal-network" + ("" if config.procedure == "continued" else "-independent")
        self.config = config
        self.n_threads = n_threads

    def fit(self, seed: int, domain: Domain, people: Mapping[str, Training]) -> OwnAnswers:
        """Trains each person's networks.

        Raises:
            TooFewAnswersError: Somebody has given fewer than `FEWEST_ANSWERS`.
        """

        def learn(rng: np.random.Generator, training: Training) -> NetworkModel:
            return train_networks(rng, domain, self.config, training)

        return learn_by_networks(self.name, seed, domain, learn, people, self.n_threads)


def learn_by_networks(
    name: str, seed: int, domain: Domain, learn: Learn, people: Mapping[str, Training], n_threads: int
) -> OwnAnswers:
    """Learns each person by networks, and somebody new with fewer than `FEWEST_ANSWERS` by the calibrated posterior.

    Args:
        name: The predictor's.
        seed: Names the random streams, together with the predictor's and the person's name.
        domain: Whose trajectories were compared.
        learn: Trains networks; of somebody with enough answers.
        people: Whom to learn, by name.
        n_threads: Threads that share the people.

    Raises:
        TooFewAnswersError: One of the people has given fewer than `FEWEST_ANSWERS`.
    """
    _require_answers(name, people)

    def learn_enough(rng: np.random.Generator, training: Training) -> PersonModel:
        if len(training) < FEWEST_ANSWERS:
            return learn_posterior(rng, training, domain)
        return learn(rng, training)

    return OwnAnswers.of(name, seed, learn_enough, people, n_threads)


def train_networks(
    rng: np.random.Generator,
    domain: Domain,
    config: NetworkConfig,
    training: Training,
    n_threads: int = 1,
    on_progress: OnProgress = lambda share: None,
) -> NetworkModel:
    """Trains one person's networks and selects among them.

    Args:
        rng: Draws a posterior where the study stored none, and starts every trial.
        domain: Whose trajectories were compared.
        config: What is trained, and how.
        training: The person's answers.
        n_threads: Threads that share independent trials; the result doesn't depend on it.
        on_progress: Is told the share of the trials that are done.

    Raises:
        TooFewAnswersError: Too few answers to train and to validate.
        NetworkError: The training diverged.
    """
    weights = posterior_mean(rng, training, domain) if config.has_hand_coded else np.empty(0)
    lesson = Lesson(examples(domain, config, training.pairs), training.signs, weights)
    trials = train(rng, config, lesson, n_threads, on_progress)
    return NetworkModel(domain, config, trials.networks[best_trials(trials, config.n_selected)])


def checkpoint_of(model: NetworkModel, training: Training, seed: int) -> Checkpoint:
    """Returns what can be stored of a model, with the answers, configuration and code that it comes from."""
    answers = (training.pairs.states_a, training.pairs.states_b, training.signs)
    lineage = Lineage(
        answers_digest=hashlib.sha256(b"".join(part.tobytes() for part in answers)).hexdigest(),
        config_digest=model.config.digest,
        domain_id=model.domain.id,
        versions=(f"prefstudy-{version('prefstudy')}", VERSION),
        seed=seed,
    )
    return Checkpoint(model.networks, model.config, lineage)


def model_of(checkpoint: Checkpoint) -> NetworkModel:
    """Returns the model of a checkpoint.

    Raises:
        UnknownNameError: Its domain isn't there.
    """
    domain = domain_named(checkpoint.lineage.domain_id)
    return NetworkModel(domain, checkpoint.config, checkpoint.networks)


def examples(
    domain: Domain, config: NetworkConfig, pairs: Pairs, base_logits: Float[np.ndarray, " n"] | None = None
) -> Examples:
    """Returns pairs as a configuration's networks see them; base log-odds are 0 unless told."""
    diffs = hand_coded_diffs(domain, pairs)
    return Examples(
        config.inputs_of(domain, pairs.states_a),
        config.inputs_of(domain, pairs.states_b),
        diffs if config.has_hand_coded else diffs[:, :0],
        np.zeros(len(pairs)) if base_logits is None else base_logits,
    )


def _require_answers(name: str, people: Mapping[str, Training]) -> None:
    """Checks that everybody has answered enough for a network.

    Raises:
        TooFewAnswersError: Names somebody who hasn't.
    """
    for person, training in people.items():
        if len(training) < FEWEST_ANSWERS:
            raise TooFewAnswersError(
                f"Expected at least {FEWEST_ANSWERS} answers of {person} for '{name}', got {len(training)}. "
                "Ask for more of them, or leave the person out."
            )
