"""Whole sessions made by the core alone: a log, and the posterior that was stored with each query."""

from dataclasses import dataclass, replace

import numpy as np

from study_core.comparison import Choice
from study_core.events import AnswerGiven, FeatureLearned, PopulationAdopted, QueryPrepared, SessionBegun
from study_core.knowledge import NOTHING
from study_core.learning import compared, feature_due, known_comparisons
from study_core.online.learn import learn_feature
from study_core.plan import Phase, plan_of
from study_core.queries import (
    infer_posterior,
    propose_active_query,
    propose_common_query,
    propose_test_set,
)
from study_core.session import apply, initial_state
from study_core.study import parse_study
from study_core.verification.session import Verifier
from study_core.verification.stored import StoredPosterior
from tests.study_core import references

TASTE = np.array([0.3, 0.5, 0.2, 0.8])


@dataclass(frozen=True)
class Walked:
    """A session as it would be exported."""

    study: object
    log: tuple
    posteriors: dict

    @property
    def queries(self):
        return {event.query_index: event for event in self.log if isinstance(event, QueryPrepared)}

    def with_query(self, query_index, change):
        """The session with another query; `change` takes the one that was asked."""
        log = tuple(change(event) if event is self.queries[query_index] else event for event in self.log)
        return replace(self, log=log)

    def with_posterior(self, query_index, **changes):
        changed = replace(self.posteriors[query_index], **changes)
        return replace(self, posteriors=self.posteriors | {query_index: changed})

    def with_answer(self, query_index, choice):
        def changed(event):
            is_it = isinstance(event, AnswerGiven) and event.query_index == query_index
            return replace(event, choice=choice) if is_it else event

        return replace(self, log=tuple(map(changed, self.log)))

    def verified(self, verifier=None):
        return (verifier or Verifier(self.study)).verify(self.log, self.posteriors.__getitem__)


def small_study(**changes):
    enough = {"sampler__samples": 40, "sampler__draws": 1000, "sampler__most_draws": 8000}
    return parse_study(references.study_text(**(enough | changes)))


def chosen(query, rng):
    """What somebody of that taste answers, now and then by mistake."""
    prefers_a = TASTE @ query.feature_diff > 0.0
    return Choice.A if prefers_a != (rng.random() < 0.1) else Choice.B


def walk(study, participant=1, population=None):
    """A session from its beginning to its end."""
    rng, test_set, posteriors = np.random.default_rng(4), propose_test_set(study), {}
    begun = [SessionBegun(participant)]
    if population is not None:
        begun.append(PopulationAdopted(0, "population-1", ("somebody",), population))
    log, state, plan = [], initial_state(study), plan_of(study, participant)

    def note(event):
        nonlocal state
        log.append(event)
        state = apply(study, state, event)

    for event in begun:
        note(event)
    for index, slot in enumerate(plan.slots):
        due = feature_due(study, state, index)
        if due is not None:
            feature = learn_feature(study, participant, due.n_queries, compared(state, due.n_queries))
            note(FeatureLearned(index, due.n_queries, feature, "0.1.0"))
        knowing = study.knowing(state.knowledge)
        posterior = None
        if plan.needs_posterior(index):
            posterior = infer_posterior(knowing, participant, index, known_comparisons(study, state))
            posteriors[index] = StoredPosterior(
                posterior.samples, posterior.mean, posterior.parameters, posterior.diagnostics
            )
        if slot.phase is Phase.ACTIVE:
            proposed = propose_active_query(knowing, participant, index, posterior)
        elif slot.phase is Phase.TEST:
            proposed = test_set[slot.number]
        elif slot.phase is Phase.REPEAT:
            proposed = state.prepared[slot.repeat_of].proposed
        else:
            proposed = propose_common_query(study.knowing(NOTHING), slot.phase.value, slot.number)
        note(
            QueryPrepared(
                index,
                slot.phase,
                proposed,
                {},
                "0.1.0",
                1.0,
                slot.first_shown,
                slot.repeat_of,
                slot.instructed,
                "a processor",
            )
        )
        note(AnswerGiven(index, chosen(proposed.query, rng), 900))
    return Walked(study, tuple(log), posteriors)
