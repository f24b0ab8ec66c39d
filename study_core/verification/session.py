"""Every step of a session, from its log and its stored posteriors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from study_core import lbfgs
from study_core.acquisition import acquisition_named
from study_core.events import Event, FeatureLearned, QueryPrepared
from study_core.knowledge import NOTHING
from study_core.learning import known_comparisons
from study_core.plan import Phase, plan_of
from study_core.posterior import metropolis
from study_core.queries import LAST_RESORT, TEST_SET
from study_core.replay import first_difference
from study_core.session import SessionState, apply, initial_state, reduce
from study_core.study import Study
from study_core.verification.choice import provenance_of, verify_active, verify_common
from study_core.verification.drives import verify_pair
from study_core.verification.feature import verify_feature
from study_core.verification.findings import Findings
from study_core.verification.posterior import verify_posterior
from study_core.verification.stored import StoredPosterior, posterior_of

_PURPOSES = {
    Phase.TEST: TEST_SET,
    Phase.PRACTICE: Phase.PRACTICE.value,
    Phase.CHECK: Phase.CHECK.value,
}

StoredFn = Callable[[int], StoredPosterior]
"""Takes a query index; gives the posterior that was stored with it."""


class Verifier:
    """Verifies the sessions of one study. Queries that are everybody's are verified once."""

    def __init__(self, study: Study) -> None:
        """Takes a study; what a session of it knows besides is in the session's log."""
        self._study = study.knowing(NOTHING)
        self._common: dict[tuple[str, int, str | None], QueryPrepared] = {}

    def verify(
        self, events: Sequence[Event], stored_of: StoredFn, on_query: Callable[[], None] = lambda: None
    ) -> Findings:
        """Verifies every step of a session.

        Args:
            events: The session's log.
            stored_of: Gives the posteriors that it was stored with.
            on_query: Called after each query.

        Raises:
            SessionError: The log holds an event that was not possible when it came.
        """
        findings, state = Findings(), initial_state(self._study)
        standing = {id(prepared) for prepared in reduce(self._study, events).prepared}
        for event in events:
            if isinstance(event, FeatureLearned):
                findings.query_index = event.query_index
                verify_feature(findings, self._study, state, event)
            elif isinstance(event, QueryPrepared):
                findings.query_index = event.query_index
                # What was stored with a query whose predecessor's answer was taken back is no more.
                self._verify_query(findings, state, event, stored_of if id(event) in standing else None)
                on_query()
            state = apply(self._study, state, event)
        return findings

    def _verify_query(
        self, findings: Findings, state: SessionState, event: QueryPrepared, stored_of: StoredFn | None
    ) -> None:
        assert state.participant is not None, "a session with queries has begun"
        plan = plan_of(self._study, state.participant)
        slot = plan.slots[event.query_index]
        if event.first_shown is not None:
            findings.compare("first_shown", event.first_shown, slot.first_shown)
        findings.compare("repeat_of", event.repeat_of, slot.repeat_of)
        findings.compare("instructed", event.instructed, slot.instructed)
        if slot.repeat_of is not None:
            self._verify_same(findings, event, state.prepared[slot.repeat_of])
            return
        self._verify_names(findings, state, event)
        verify_pair(findings, self._study, event.proposed)
        if slot.phase is not Phase.ACTIVE:
            self._verify_common(findings, _PURPOSES[slot.phase], slot.number, event)
        if stored_of is not None and plan.needs_posterior(event.query_index):
            self._verify_chosen(findings, state, event, stored_of(event.query_index))

    def _verify_chosen(
        self, findings: Findings, state: SessionState, event: QueryPrepared, stored: StoredPosterior
    ) -> None:
        """Verifies the posterior before a query, and the choice of the query where it was chosen from that."""
        assert state.participant is not None, "a session with queries has begun"
        knowing = self._study.knowing(state.knowledge)
        comparisons = known_comparisons(self._study, state)
        verify_posterior(findings, knowing, state.participant, event.query_index, comparisons, stored)
        if event.phase is Phase.ACTIVE:
            posterior = posterior_of(knowing, comparisons, stored)
            verify_active(findings, knowing, state.participant, event.query_index, event.proposed, posterior)

    def _verify_common(self, findings: Findings, purpose: str, number: int, event: QueryPrepared) -> None:
        """Verifies a query that is the same for everyone whose queries were computed on such a machine."""
        known = self._common.setdefault((purpose, number, event.machine), event)
        if known is event or not self._verify_same(findings, event, known):
            verify_common(findings, self._study, purpose, number, event.proposed)

    def _verify_same(self, findings: Findings, event: QueryPrepared, other: QueryPrepared) -> bool:
        """Verifies that two queries are the same pair from the same place; returns whether they are."""
        difference = first_difference(event, replace(event, proposed=other.proposed))
        if difference is None:
            findings.n_compared += 1
            return True
        findings.compare(difference.quantity, difference.stored, difference.derived)
        return False

    def _verify_names(self, findings: Findings, state: SessionState, event: QueryPrepared) -> None:
        """Verifies what a query says about where it comes from."""
        assert state.participant is not None, "a session with queries has begun"
        study, provenance = self._study, provenance_of(event.proposed)
        slot = plan_of(study, state.participant).slots[event.query_index]
        names: tuple[str | int, ...] = (state.participant, event.query_index)
        method = study.file.acquisition.method
        methods: tuple[str, ...] = (method, LAST_RESORT)
        versions = [study.domain.id, metropolis.VERSION, lbfgs.VERSION, acquisition_named(method).version]
        if slot.phase is not Phase.ACTIVE:
            purpose = _PURPOSES[slot.phase]
            names, methods, versions = (purpose, slot.number), (purpose,), versions[:3]
        findings.compare("provenance.study_hash", provenance.study_hash, study.hash)
        findings.compare("provenance.seed", provenance.seed, study.seed)
        findings.compare_all("provenance.stream", provenance.stream, names)
        findings.compare_all("provenance.versions", provenance.versions, versions)
        is_possible = provenance.method in methods
        findings.require("provenance.method", is_possible, provenance.method, " or ".join(methods))
