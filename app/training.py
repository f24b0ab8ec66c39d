"""What is learned from everyone who finishes, as the engine trains it. Pure, importable by name."""

from __future__ import annotations

import json

from app.services.population import PopulationRequest
from app.services.training import TrainingMethod, TrainingRequest
from study_core import session_codec
from study_core.domain import domain_named
from study_core.networks import training
from study_core.networks.checkpoint import to_bytes
from study_core.networks.config import NetworkConfig
from study_core.predictors.hand_coded_population import learn_population_prior
from study_core.predictors.personal_network import (
    FEWEST_ANSWERS,
    PUBLISHED_CODE,
    PersonalNetwork,
    checkpoint_of,
    train_networks,
)
from study_core.streams import stream


def train_personal_network(request: TrainingRequest) -> bytes:
    """Returns the networks of one person as a checkpoint."""
    config = NetworkConfig.from_json(json.dumps(request.settings))
    rng = stream(request.seed, request.kind, "person", str(request.participant))
    model = train_networks(rng, domain_named(request.domain_id), config, request.training)
    return to_bytes(checkpoint_of(model, request.training, request.seed))


def fit_population(request: PopulationRequest) -> bytes:
    """Returns what people have in common, as JSON text."""
    population = learn_population_prior(request.people)
    assert population is not None, "nobody asks where nobody has answered"
    return json.dumps(session_codec.population_to_json(population)).encode()


PERSONAL_NETWORK = TrainingMethod(
    kind=PersonalNetwork().name,
    version=training.VERSION,
    settings=json.loads(PUBLISHED_CODE.to_json()),
    fewest_answers=FEWEST_ANSWERS,
    train=train_personal_network,
)
