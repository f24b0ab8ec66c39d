"""What a feature learned in the middle of a session is worth: simulated people with a hidden taste, and without."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
from rich.progress import Progress, TaskID

from app import wiring
from app.bench.report import figures, provenance
from app.process import n_cores
from app.services.rehearsal import rehearse_all
from app.services.rehearsed_person import Crowd
from app.services.runtime import Runtime
from app.settings import find_study
from study_core.evaluation.intervals import Mean, mean_over_people
from study_core.participants import Habits, SimulatedPerson
from study_core.plan import Phase
from study_core.session import SessionState
from study_core.study import Study, parse_study

STUDY = "online"

_RATIONALITY, _LAPSE_RATE = 100.0, 0.02
TASTES = {
    "likes one side of the road": Habits(hidden_feature="side", hidden_weight=1.0),
    "no hidden taste": Habits(),
}


def run(seed: int, n_people: int, progress: Progress) -> dict[str, Any]:
    """Walks the same simulated people through a study twice: with a learned feature, and with none.

    Args:
        seed: Of the people and their answers.
        n_people: How many of each taste.
        progress: Shows how far it is.

    Returns:
        For each taste, the share of the common test pairs whose truly better drive the final posterior mean names,
        with the feature, without it, and the difference, each with its interval over people; the last mean weight of
        the feature; and where it was measured.
    """
    with_feature = find_study(STUDY)
    text, _, _ = with_feature.text.partition("\n[learning]")
    arms = {"with": with_feature, "without": parse_study(text)}
    n_answers = with_feature.n_queries * n_people * len(arms) * len(TASTES)
    task = progress.add_task("sessions", total=n_answers)
    tastes = {}
    for taste, habits in TASTES.items():
        crowd = Crowd(seed, n_people, habits, _RATIONALITY, _LAPSE_RATE)
        found = {name: list(_walk(study, crowd, progress, task)) for name, study in arms.items()}
        tastes[taste] = _compared(seed, found)
    return {
        "tastes": tastes,
        "people": n_people,
        "active_queries": with_feature.protocol.active_queries,
        "test_queries": with_feature.protocol.test_queries,
        "rationality": _RATIONALITY,
        "lapse_rate": _LAPSE_RATE,
        **provenance(seed),
    }


def _walk(study: Study, crowd: Crowd, progress: Progress, task: TaskID) -> Iterator[tuple[float, float]]:
    """Gives each person's accuracy and the weight of the last feature in the final posterior mean."""
    n_workers = n_cores()
    with wiring.headless(n_workers=n_workers) as runtime:
        walks = rehearse_all(runtime, study, crowd, 2 * n_workers, lambda: progress.advance(task))
        with closing(walks):
            for number, rehearsal in enumerate(walks, start=1):
                person = crowd.person(study, number)
                yield _score(runtime, rehearsal.summary["participant"], person)


def _score(runtime: Runtime, participant: str, person: SimulatedPerson) -> tuple[float, float]:
    record = next(
        one for one in runtime.store.sessions() if runtime.live(one.id).state.participant == participant
    )
    live, mean = runtime.live(record.id), runtime.store.posteriors(record.id)[-1].mean
    n_hand_coded = len(live.study.domain.feature_names)
    weight = float(mean[n_hand_coded]) if len(mean) > n_hand_coded else 0.0
    return _accuracy(live.study, live.state, mean, person), weight


def _accuracy(study: Study, state: SessionState, mean: np.ndarray, person: SimulatedPerson) -> float:
    """Returns how often the mean prefers the drive of a test pair that the person truly prefers."""
    domain = study.knowing(state.knowledge).rewards.domain
    queries = [one.proposed.query for one in state.prepared if one.phase is Phase.TEST]
    of_a, of_b = (
        domain.features(domain.rollout(np.array(controls))) @ mean
        for controls in ([query.controls_a for query in queries], [query.controls_b for query in queries])
    )
    truth = np.sign([person.reward_diff(query) for query in queries])
    return float(np.mean(np.sign(of_a - of_b) == truth))


def _compared(seed: int, found: dict[str, list[tuple[float, float]]]) -> dict[str, Any]:
    accuracy = {name: [one for one, _ in people] for name, people in found.items()}
    difference = np.subtract(accuracy["with"], accuracy["without"]).tolist()
    return {
        **{name: _mean(mean_over_people(seed, values)) for name, values in accuracy.items()},
        "difference": _mean(mean_over_people(seed, difference)),
        "weight_of_feature": figures(np.mean([weight for _, weight in found["with"]])),
    }


def _mean(mean: Mean) -> dict[str, Any]:
    return {"mean": figures(mean.value), "interval": [figures(mean.low), figures(mean.high)]}
