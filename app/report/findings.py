"""Everything that a report says, as numbers; `find` computes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from app.errors import AppError
from app.services.evaluation import Evaluated
from app.settings import find_study, with_method
from study_core.comparison import ComparisonSet, Query
from study_core.domain import Domain
from study_core.evaluation.best_drives import best_of, draw_candidates, optimise
from study_core.evaluation.comparison import Comparison, compare
from study_core.evaluation.hypotheses import PairedTest, paired_test
from study_core.evaluation.learned import RewardFn, learned_reward
from study_core.evaluation.learning_curve import Curve, learning_curve, majority_accuracy
from study_core.evaluation.people import Person
from study_core.evaluation.scores import score
from study_core.networks.config import NetworkConfig
from study_core.predictors.alone import Alone
from study_core.predictors.hand_coded import HandCodedCalibrated, HandCodedStored, MeanModel
from study_core.predictors.hand_coded_population import HandCodedPopulation
from study_core.predictors.hierarchical import Hierarchical
from study_core.predictors.personal_network import NetworkModel, PersonalNetwork
from study_core.predictors.predictor import Predictor
from study_core.predictors.registry import all_predictors
from study_core.predictors.shared_network import SharedNetwork
from study_core.queries import infer_posterior, propose_active_query

STORED, NETWORK = HandCodedStored().name, PersonalNetwork().name
REWARDS = {STORED: "hand-coded features", NETWORK: "with a learned feature"}
SEARCHES = ("best of 10,000 candidates", "found by the optimiser")
QUERY_METHODS = ("information-gain", "heuristic", "information-gain-realistic")
_QUERY_STUDY, _ANSWERS_BEFORE_QUERY = "quickstart", 10

# Who predicts somebody new: with the others' answers, and without them, the same models foremost.
_TOGETHER: tuple[Predictor, ...] = (Hierarchical(), SharedNetwork(), HandCodedPopulation())
_ALONE: tuple[Predictor, ...] = (Alone(Hierarchical()), Alone(SharedNetwork()), HandCodedCalibrated())
LEARN_ALONE = frozenset(predictor.name for predictor in _ALONE)
"""Names of predictors of somebody new that know nobody else."""

Drives = dict[tuple[str, str], dict[str, Float[np.ndarray, " n_controls"]]]
"""The best drive by what is rewarded and how it was looked for, then by person."""

OnStep = Callable[[], None]


class NoOthersError(AppError):
    """There is nobody else to know when one person is taken for new."""


@dataclass(frozen=True)
class Findings:
    """What a report is written from.

    Attributes:
        seed: Of everything random.
        evaluated: The people.
        comparison: All predictors.
        accuracy: By predictor and person; see `accuracies`.
        trials: Of the personal network: accuracy of each selected trial, by person.
        majority: How often each person answers as most others did; nobody who saw other queries.
        curves: See `new_person_curves`; empty for a single person.
        wide_network: The first person's network with every input that the domain has.
        drives: Everybody's best drives.
        queries: What the first person would be asked next, by method.
    """

    seed: int
    evaluated: Evaluated
    comparison: Comparison
    accuracy: dict[str, dict[str, float]]
    trials: dict[str, list[float]]
    majority: Mapping[str, float]
    curves: dict[str, Curve]
    wide_network: NetworkModel
    drives: Drives
    queries: dict[str, Query]

    @property
    def domain(self) -> Domain:
        """Returns whose trajectories were compared."""
        return self.evaluated.domain

    @property
    def people(self) -> list[Person]:
        """Returns the people."""
        return self.evaluated.people

    @property
    def h1(self) -> PairedTest | None:
        """Returns whether the personal network predicts better than what the study stored; None for one person."""
        return test_h1(self.accuracy)


def n_fits() -> int:
    """Returns how often `compare_all` tells that it has done something."""
    return 2 * len(all_predictors(n_threads=1))


def n_steps(n_people: int) -> int:
    """Returns how often `find` does."""
    n_curves = n_curve_steps(n_people) if n_people > 1 else 0
    return n_fits() + n_curves + len(REWARDS) * len(SEARCHES) * n_people + 2


def n_curve_steps(n_people: int) -> int:
    """Returns how often `new_person_curves` does."""
    return (len(_TOGETHER) + len(_ALONE)) * n_people


def find(seed: int, evaluated: Evaluated, n_threads: int, on_step: OnStep) -> Findings:
    """Computes everything, in some minutes.

    Args:
        seed: Names every random stream.
        evaluated: The people.
        n_threads: Threads that train a person's networks; the result doesn't depend on it.
        on_step: Called after each of `n_steps`.
    """
    comparison = compare_all(seed, evaluated, n_threads, on_step)
    trials = trial_accuracies(evaluated, comparison)
    domain, first = evaluated.domain, evaluated.people[0]
    curves = new_person_curves(seed, evaluated, on_step) if len(evaluated.people) > 1 else {}
    wide = PersonalNetwork(NetworkConfig(inputs=domain.network_input_names), n_threads)
    wide_network = wide.fit(seed, domain, {first.name: first.training}).people[first.name]
    assert isinstance(wide_network, NetworkModel), "whoever is evaluated has answered enough for a network"
    on_step()
    queries = _next_queries(domain, first)
    on_step()
    return Findings(
        seed,
        evaluated,
        comparison,
        accuracies(comparison, trials),
        trials,
        majority_accuracy(evaluated.people),
        curves,
        wide_network,
        _best_drives(seed, evaluated, comparison, on_step),
        queries,
    )


def compare_all(seed: int, evaluated: Evaluated, n_threads: int, on_step: OnStep) -> Comparison:
    """Compares every predictor on the people of an evaluation."""
    return compare(seed, evaluated.domain, evaluated.people, all_predictors(n_threads), on_step)


def new_person_curves(seed: int, evaluated: Evaluated, on_step: OnStep) -> dict[str, Curve]:
    """Returns scores for somebody new by number of own answers; the cost grows with the square of the people.

    Args:
        seed: Names every random stream.
        evaluated: The people, each of whom is new in turn.
        on_step: Called after each of `n_curve_steps`.

    Returns:
        By predictor: those that know the others, then those that don't, whom `LEARN_ALONE` names.

    Raises:
        NoOthersError: There is a single person.
    """
    if len(evaluated.people) < 2:
        raise NoOthersError(
            "Expected at least 2 people to take one of them for new, got 1. Finish more sessions, or don't ask for it."
        )
    return {
        predictor.name: learning_curve(
            seed,
            evaluated.domain,
            evaluated.people,
            predictor,
            knows_others=predictor in _TOGETHER,
            on_person=on_step,
        )
        for predictor in (*_TOGETHER, *_ALONE)
    }


def networks_of(comparison: Comparison) -> dict[str, NetworkModel]:
    """Returns everybody's personal network."""
    models = comparison.fitted[NETWORK].people
    return {name: model for name, model in models.items() if isinstance(model, NetworkModel)}


def trial_accuracies(evaluated: Evaluated, comparison: Comparison) -> dict[str, list[float]]:
    """Returns the accuracy of each selected trial of everybody's network: what the paper's bars are made of."""
    networks = networks_of(comparison)
    return {
        person.name: [
            score(probabilities, person.test.signs).accuracy
            for probabilities in networks[person.name].members_probability_of_a(person.test.pairs)
        ]
        for person in evaluated.people
    }


def accuracies(comparison: Comparison, trials: Mapping[str, list[float]]) -> dict[str, dict[str, float]]:
    """Returns every accuracy, by predictor and person.

    That of the personal network is the paper's: the mean over the selected trials, not that of their mean prediction.
    """
    known = {
        name: {person: one.accuracy for person, one in of_people.items()}
        for name, of_people in comparison.scores.items()
    }
    return known | {NETWORK: {person: float(np.mean(values)) for person, values in trials.items()}}


def test_h1(accuracy: Mapping[str, Mapping[str, float]]) -> PairedTest | None:
    """Tests H1 with the accuracies of all predictors; None for a single person."""
    return paired_test(accuracy[NETWORK], accuracy[STORED]) if len(accuracy[STORED]) > 1 else None


def _best_drives(seed: int, evaluated: Evaluated, comparison: Comparison, on_step: OnStep) -> Drives:
    domain = evaluated.domain
    candidates, networks = draw_candidates(seed, domain), networks_of(comparison)
    drives: Drives = {}
    for search, look_for in zip(SEARCHES, (best_of, optimise), strict=True):
        for reward in (STORED, NETWORK):
            found = {}
            for person in evaluated.people:
                rewarded = (
                    _stored_reward(domain, comparison, person.name)
                    if reward == STORED
                    else learned_reward(networks[person.name])
                )
                found[person.name] = look_for(domain, candidates, rewarded)
                on_step()
            drives[reward, search] = found
    return drives


def _stored_reward(domain: Domain, comparison: Comparison, name: str) -> RewardFn:
    model = comparison.fitted[STORED].people[name]
    assert isinstance(model, MeanModel), "what a study stored is a mean of w"
    weights = model.weights
    return lambda states: domain.features(states) @ weights


def _next_queries(domain: Domain, person: Person) -> dict[str, Query]:
    """Returns what each method would ask somebody after their first answers; nothing in another domain."""
    base = find_study(_QUERY_STUDY)
    if base.domain.id != domain.id:
        return {}
    known = person.training.first(_ANSWERS_BEFORE_QUERY)
    diffs = domain.features(known.pairs.states_a) - domain.features(known.pairs.states_b)
    posterior = infer_posterior(base, "report", len(known), ComparisonSet(diffs, known.signs))
    queries = {}
    for method in QUERY_METHODS:
        study = with_method(base, method)
        queries[method] = propose_active_query(study, "report", len(known), posterior).query
    return queries
