"""Refusing what other methods have computed: their numbers are others, and nobody could say whether they are right."""

from __future__ import annotations

from itertools import zip_longest

from app.services.replay.errors import OtherVersionError
from app.services.replay.person import ExportedPerson
from study_core import lbfgs
from study_core.acquisition import acquisition_named
from study_core.events import FeatureLearned, QueryPrepared
from study_core.networks import training
from study_core.plan import Phase
from study_core.posterior import metropolis
from study_core.queries import Provenance
from study_core.study import Study

_WHAT = ("domain", "sampler", "optimiser", "acquisition method")


def require_same_versions(person: ExportedPerson) -> None:
    """Refuses a person with a query, or a learned feature, that other versions have computed.

    Raises:
        OtherVersionError: The message names the release to install.
    """
    for event in person.log:
        if isinstance(event, QueryPrepared) and isinstance(event.proposed.provenance, Provenance):
            expected = _versions(person.study, event.phase)
            for what, one, other in zip_longest(_WHAT, event.proposed.provenance.versions, expected):
                _require(person, event, what, one, other)
        elif isinstance(event, FeatureLearned) and event.feature is not None:
            learned_by = event.feature.checkpoint.lineage.versions[-1]
            _require(person, event, "training of networks", learned_by, training.VERSION)


def require_same_bank(person: ExportedPerson) -> None:
    """Refuses a person with a query that was chosen from another bank than this machine's.

    Raises:
        OtherVersionError: The message names the remedies.
    """
    bank = person.study.bank
    for event in person.queries:
        provenance = event.proposed.provenance
        if not isinstance(provenance, Provenance) or bank is None:
            continue
        if provenance.bank_digest is not None and provenance.bank_digest != bank.digest:
            raise OtherVersionError(
                f"{person.source}: query {event.query_index} was chosen from the bank {provenance.bank_digest[:16]}, "
                f"and this machine's is {bank.digest[:16]}. Install what computed it, prefstudy=={event.code_version}; "
                "or verify each step alone with --steps."
            )


def _versions(study: Study, phase: Phase) -> tuple[str | None, ...]:
    # A query that is asked again keeps the versions that it was chosen by.
    is_chosen = phase in (Phase.ACTIVE, Phase.REPEAT)
    method = acquisition_named(study.file.acquisition.method).version if is_chosen else None
    return (study.domain.id, metropolis.VERSION, lbfgs.VERSION, method)


def _require(
    person: ExportedPerson,
    event: QueryPrepared | FeatureLearned,
    what: str | None,
    stored: str | None,
    installed: str | None,
) -> None:
    if stored != installed:
        raise OtherVersionError(
            f"{person.source}: query {event.query_index} was computed with the {what or 'method'} '{stored}', and here "
            f"'{installed}' is installed. Install the release that computed it: prefstudy=={event.code_version}."
        )
