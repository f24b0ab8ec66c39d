"""How long the feature networks of a person take to train, beside the plain loop in torch, and those of a study."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from rich.progress import Progress

from app.bench.answers import simulated_training
from app.bench.report import figures, provenance
from app.bench.torch_training import train_in_turns
from app.process import n_cores
from study_core.domain import Domain, domain_named
from study_core.networks.config import NetworkConfig
from study_core.networks.model import initial_networks
from study_core.networks.training import Lesson, train
from study_core.predictors.personal_network import PersonalNetwork, examples
from study_core.predictors.predictor import Training
from study_core.streams import stream

_DOMAIN = "driving-v1"
_N_ANSWERS = 100
_N_TURNS = 4

# Both compute in float32 and sum in different orders; a training that went another way is off by far more.
_SAME_LOSS = 1e-3


def run(
    seed: int, progress: Progress, n_people: int = 15, config: NetworkConfig | None = None
) -> dict[str, Any]:
    """Trains one simulated person's networks both ways from the same starts, and then a whole study's.

    Both may use all cores, and run in turns, a few trials at a time. A person is trained as
    published: 40 trials of 40 epochs on the first 70 of 100 answers. The study's time has everything in it: posteriors,
    training, validation and selection.

    Args:
        seed: Of the simulated people, their answers and the networks.
        progress: Shows how far it is.
        n_people: People of the study.
        config: Networks and training; the published ones unless told. At least four trials.

    Returns:
        `ratio_to_sequential`, how much longer torch takes; `study_seconds`; the seconds of each way; whether both
        reach the same losses, and the largest difference; and where it was measured.
    """
    config = config or NetworkConfig()
    domain = domain_named(_DOMAIN)
    people = {str(number): simulated_training(domain, seed, number, _N_ANSWERS) for number in range(n_people)}
    seconds, difference = _race(seed, domain, config, people["0"], progress)
    return {
        "ratio_to_sequential": figures(seconds["torch"] / seconds["prefstudy"]),
        "study_seconds": figures(_time_study(seed, domain, config, people, progress)),
        "person_seconds": {way: figures(value) for way, value in seconds.items()},
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
    """Returns the seconds of each way for all trials of one person, and how far apart their losses are."""
    n_trials = config.n_trials // _N_TURNS
    turn = replace(config, n_trials=n_trials, n_selected=n_trials, training_share=1.0)
    n_training = round(config.training_share * _N_ANSWERS)
    weights = np.full(len(domain.feature_names), 0.5)
    lesson = Lesson(examples(domain, config, training.pairs), training.signs, weights)[:n_training]
    task = progress.add_task("one person, both ways", total=_N_TURNS + 1)
    _train_both(seed, "warm-up", replace(turn, n_trials=1, n_selected=1), lesson)
    progress.advance(task)
    seconds, largest = {"prefstudy": 0.0, "torch": 0.0}, 0.0
    for number in range(_N_TURNS):
        took, difference = _train_both(seed, f"turn {number}", turn, lesson)
        seconds = {way: total + took[way] for way, total in seconds.items()}
        largest = max(largest, difference)
        progress.advance(task)
    return seconds, largest


def _train_both(
    seed: int, name: str, config: NetworkConfig, lesson: Lesson
) -> tuple[dict[str, float], float]:
    """Returns the seconds of each way for the same trials, and the largest difference of their losses."""
    began = time.perf_counter()
    ours = train(stream(seed, "bench-training", name), config, lesson, n_cores()).losses
    between = time.perf_counter()
    sizes = (lesson.pairs.inputs_a.shape[2], config.n_hidden, config.n_features)
    rngs = stream(seed, "bench-training", name).spawn(config.n_trials)
    starts = initial_networks(rngs, *sizes, lesson.hand_coded_weights)
    theirs = train_in_turns(config, lesson, starts, n_cores())
    seconds = {"prefstudy": between - began, "torch": time.perf_counter() - between}
    return seconds, float(np.abs(ours - theirs).max())


def _time_study(
    seed: int, domain: Domain, config: NetworkConfig, people: dict[str, Training], progress: Progress
) -> float:
    """Returns the seconds that everybody's networks take, one person after the other."""
    predictor = PersonalNetwork(config, n_threads=n_cores())
    began = time.perf_counter()
    for person, training in progress.track(people.items(), description="study"):
        predictor.fit(seed, domain, {person: training})
    return time.perf_counter() - began
