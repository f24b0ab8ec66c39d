"""How well somebody new is predicted, by how much they have answered, with and without knowing other people."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from study_core.domain import Domain
from study_core.evaluation.people import Person
from study_core.evaluation.scores import Scores, score
from study_core.predictors.predictor import Predictor

N_ANSWERS = (0, 5, 10, 20, 50, 100)

Curve = dict[int, dict[str, Scores]]
"""By number of own answers, then by person."""


def learning_curve(
    seed: int,
    domain: Domain,
    people: Sequence[Person],
    predictor: Predictor,
    n_answers: Sequence[int] = N_ANSWERS,
    knows_others: bool = True,
    on_person: Callable[[], None] = lambda: None,
) -> Curve:
    """Returns the scores for each person as if they were new.

    The predictor is fitted to everybody else, for each person anew, or to nobody: nothing of theirs has any part in it
    but the first answers that they give. Numbers beyond what somebody has answered stand for all of their answers.

    Args:
        seed: Names every random stream.
        domain: Whose trajectories are compared.
        people: At least two if they are to know others.
        predictor: Who predicts.
        n_answers: How many own answers.
        knows_others: Whether it learns from everybody else. One that learns each person by themselves need not.
        on_person: Called after each person.
    """
    curve: Curve = {n: {} for n in n_answers}
    for person in people:
        others = {other.name: other.training for other in people if knows_others and other is not person}
        fitted = predictor.fit(seed, domain, others)
        scores: dict[int, Scores] = {}
        for n in n_answers:
            own = person.training.first(n)
            if len(own) not in scores:
                probabilities = fitted.with_person(seed, own).probability_of_a(person.test.pairs)
                scores[len(own)] = score(probabilities, person.test.signs)
            curve[n][person.name] = scores[len(own)]
        on_person()
    return curve


def majority_accuracy(people: Sequence[Person]) -> Mapping[str, float]:
    """Returns how often each person answers a common test query as most of the others did; a tie counts half.

    Only people with the same test queries have a majority; whoever saw others is left out.
    """
    shared = [person for person in people if _same_queries(person, people[0])]
    votes = np.array([person.test.signs for person in shared])
    others = votes.sum(axis=0) - votes
    return {
        person.name: float(np.mean(0.5 * (1.0 + np.sign(votes[row] * others[row]))))
        for row, person in enumerate(shared)
    }


def _same_queries(one: Person, other: Person) -> bool:
    a, b = one.test.pairs, other.test.pairs
    return len(a) == len(b) and bool(
        np.allclose(a.states_a, b.states_a) and np.allclose(a.states_b, b.states_b)
    )
