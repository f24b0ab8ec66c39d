"""How long the feature networks of a person take to train, beside the plain loop in torch, and those of a study."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float
from rich.progress import Progress

from app.bench.answers import simulated_training
from app.bench.report import figures, provenance
from app.bench.torch_training import train_in_turns
from app.process import n_cores
from study_core.domain import Domain, domain_named
from study_core.networks.config import NetworkConfig
from study_core.networks.model import Networks, initial_networks
from study_core.networks.training import Lesson, train
from study_core.predictors.personal_network import PersonalNetwork, examples
from study_core.predictors.predictor import Training
from study_core.streams import stream

_DOMAIN = "driving-v1"
_N_ANSWERS = 100
_N_TURNS, _TRIALS_OF_A_TURN = 4, 2

# Both compute in float32 and sum in different orders; a training that went another way is off by far more.
_SAME_LOSS = 1e-3

_Way = Callable[[np.random.Generator], Float[np.ndarray, "n_trials n_epochs"]]


def run(
    seed: int, progress: Progress, n_people: int = 15, config: NetworkConfig | None = None
) -> dict[str, Any]:
    """Trains trials of one simulated person both ways from the same starts, in turns, and then a whole study's.

    All cores are at hand; torch is timed with all of them and with one, and the faster counts. A person is trained
    as published: on the first 70 of 100 answers, for 40 epochs, in 40 trials in the study and fewer where torch has
    to follow. The study's networks are the published code's; their time has everything in it: training, validation
    and selection.

    Args:
        seed: Of the simulated people, their answers and the networks.
        progress: Shows how far it is.
        n_people: People of the study.
        config: Networks and training; the published ones unless told.

    Returns:
        `ratio_to_sequential`, how much longer torch takes; `study_seconds`; the milliseconds of a trial each way;
        whether both reach the same losses, and the largest difference; and where it was measured.
    """
    config = config or NetworkConfig()
    domain = domain_named(_DOMAIN)
    people = {
        str(number): replace(
            simulated_training(domain, seed, number, _N_ANSWERS), stored_mean=_stored_mean(domain)
        )
        for number in range(1, n_people + 1)
    }
    seconds, difference = _race(seed, domain, config, people["1"], progress)
    n_trials = _N_TURNS * _TRIALS_OF_A_TURN
    return {
        "ratio_to_sequential": figures(
            min(seconds["torch"], seconds["torch, 1 thread"]) / seconds["prefstudy"]
        ),
        "study_seconds": figures(_time_study(seed, domain, config, people, progress)),
        "milliseconds_of_a_trial": {way: figures(1e3 * value / n_trials) for way, value in seconds.items()},
        "losses_agree": difference <= _SAME_LOSS,
        "largest_loss_difference": float(f"{difference:.2g}"),
        "people": n_people,
        "trials": config.n_trials,
        "epochs": config.n_epochs,
        **provenance(seed, ["torch"]),
    }


def _race(
    seed: int, domain: Domain, config: NetworkConfig, training: Training, progress: Progress
) -> tuple[dict[str, float], float]:
    """Returns the seconds of each way for the same trials of one person, and the largest difference of their losses."""
    turn = replace(config, n_trials=_TRIALS_OF_A_TURN, n_selected=_TRIALS_OF_A_TURN, training_share=1.0)
    n_training = round(config.training_share * _N_ANSWERS)
    pairs = examples(domain, config, training.pairs)
    lesson = Lesson(pairs, training.signs, _stored_mean(domain))[:n_training]
    ways: dict[str, _Way] = {
        "prefstudy": lambda rng: train(rng, turn, lesson, n_cores()).losses,
        "torch": lambda rng: train_in_turns(turn, lesson, _starts(rng, turn, lesson), n_cores()),
        "torch, 1 thread": lambda rng: train_in_turns(turn, lesson, _starts(rng, turn, lesson), 1),
    }
    ways["prefstudy"](stream(seed, "bench-training", "warm-up"))  # compiles
    seconds, largest = dict.fromkeys(ways, 0.0), 0.0
    for number in progress.track(range(_N_TURNS), description="one person"):
        losses = {}
        for name, way in ways.items():
            began = time.perf_counter()
            losses[name] = way(stream(seed, "bench-training", number))
            seconds[name] += time.perf_counter() - began
        largest = max(largest, float(np.abs(losses["prefstudy"] - losses["torch"]).max()))
    return seconds, largest


def _starts(rng: np.random.Generator, config: NetworkConfig, lesson: Lesson) -> Networks:
    """Returns the untrained networks that `train` starts from."""
    sizes = (lesson.pairs.inputs_a.shape[2], config.n_hidden, config.n_features)
    return initial_networks(rng.spawn(config.n_trials), *sizes, lesson.hand_coded_weights)


def _stored_mean(domain: Domain) -> Float[np.ndarray, " n_features"]:
    """Returns what stands for the posterior mean that a study stores: that of somebody who has said next to nothing."""
    n_features = len(domain.feature_names)
    return np.full(n_features, 1.0 / n_features)


def _time_study(
    seed: int, domain: Domain, config: NetworkConfig, people: dict[str, Training], progress: Progress
) -> float:
    """Returns the seconds that everybody's networks take, as many people at once as there are cores."""
    predictor = PersonalNetwork(replace(config, procedure="continued"), n_threads=n_cores())
    progress.add_task("study", total=None)
    began = time.perf_counter()
    predictor.fit(seed, domain, people)
    return time.perf_counter() - began
