"""Whether a query is the one that its method chooses, given what was stored."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from study_core.acquisition import acquisition_named
from study_core.acquisition.pairs import Climbed, RankedPairs, RankedTrajectories
from study_core.posterior.run import Posterior
from study_core.queries import (
    LAST_RESORT,
    Participant,
    ProposedQuery,
    Provenance,
    Ranking,
    is_pair_swapped,
    rank_active,
    rank_common,
    rank_last_resort,
    tries,
)
from study_core.study import Study
from study_core.verification.drives import verify_best_drives, verify_free_pair
from study_core.verification.findings import ROUNDING, Findings

UNKNOWN_PARAMETERS = "choices by response parameters that nobody kept"
_OTHER_BANK = "choices from a bank of drives that this machine rounds differently"

Place = tuple[Ranking, int]
"""A ranking, and a rank in it."""


def verify_common(
    findings: Findings, study: Study, purpose: str, number: int, proposed: ProposedQuery
) -> None:
    """Verifies a query that is the same for everyone.

    Args:
        findings: Told what isn't so.
        study: The study; what a session knows besides has no part in it.
        purpose: `test-set`, `practice` or `check`.
        number: Of the query among those of its purpose.
        proposed: The query.
    """
    places = list(tries((rank_common(study, purpose, number),)))
    _verify_place(findings, study, proposed, _candidates(findings, proposed, places))
    _verify_searched(findings, study, proposed)


def verify_active(
    findings: Findings,
    study: Study,
    participant: Participant,
    query_index: int,
    proposed: ProposedQuery,
    posterior: Posterior | None,
) -> None:
    """Verifies a query that the study's acquisition method chose.

    Args:
        findings: Told what isn't so.
        study: The study, with what was known.
        participant: Names the random streams.
        query_index: The query.
        proposed: What was asked.
        posterior: From which it was chosen, as it was stored; None where that doesn't say all.
    """
    provenance = provenance_of(proposed)
    method = acquisition_named(study.file.acquisition.method)
    last_resort = rank_last_resort(study, participant, query_index)
    if provenance.method == LAST_RESORT:
        _verify_place(findings, study, proposed, list(tries((last_resort,))))
        _verify_searched(findings, study, proposed)
    elif method.climbed is not None:
        _verify_climbed(findings, study, method.climbed, proposed, posterior)
    elif method.needs_bank and not has_bank(study, provenance):
        findings.leave_out(_OTHER_BANK)
        verify_best_drives(findings, study.rewards.domain, proposed)
    elif posterior is None:
        findings.leave_out(UNKNOWN_PARAMETERS)
        verify_best_drives(findings, study.rewards.domain, proposed)
    else:
        ranked = rank_active(study, participant, query_index, posterior)
        places = list(tries((ranked, last_resort)))
        _verify_place(findings, study, proposed, _candidates(findings, proposed, places))
        _verify_searched(findings, study, proposed)


def provenance_of(proposed: ProposedQuery) -> Provenance:
    """Returns where a query comes from that isn't another program's."""
    assert isinstance(proposed.provenance, Provenance), "an imported query can't be verified"
    return proposed.provenance


def has_bank(study: Study, provenance: Provenance) -> bool:
    """Returns whether the bank is here that a query was chosen from, to the last bit."""
    return study.bank is not None and study.bank.digest == provenance.bank_digest


def _candidates(findings: Findings, proposed: ProposedQuery, places: list[Place]) -> list[Place]:
    """Returns the places that a query may have in a ranking, given how many pairs were tried.

    The first pair that looks different is shown; where none does, all were tried, and any may differ most.
    """
    provenance = provenance_of(proposed)
    n_tried = provenance.pairs_tried
    if not provenance.are_distinct:
        findings.compare("provenance.pairs_tried", n_tried, len(places))
        return places
    is_possible = 1 <= n_tried <= len(places)
    findings.require("provenance.pairs_tried", is_possible, n_tried, f"1 to {len(places)}")
    return [places[n_tried - 1]] if is_possible else []


def _verify_place(findings: Findings, study: Study, proposed: ProposedQuery, places: list[Place]) -> None:
    """Verifies that a query is one of these places' pair, with its score and the next one's."""
    if not places:
        return
    provenance = provenance_of(proposed)
    order = [1, 0] if is_pair_swapped(study, provenance.stream) else [0, 1]
    expected = [
        (ranking, rank, row) for ranking, rank in places for row in _equally_good(ranking.pairs, rank)
    ]
    matching = (each for each in expected if _is_pair(proposed, each[0].pairs, each[2], order))
    ranking, rank, row = next(matching, expected[0])
    scores = ranking.pairs.scores
    following = float(scores[rank + 1]) if rank + 1 < len(scores) else None
    findings.compare("provenance.method", provenance.method, ranking.method)
    findings.compare("provenance.score", provenance.score, float(scores[rank]), ROUNDING)
    findings.compare("provenance.runner_up_score", provenance.runner_up_score, following, ROUNDING)
    for name, stored, pair in _numbers(proposed, ranking.pairs, row, order):
        findings.compare_all(name, stored, pair, ROUNDING)


def _equally_good(pairs: RankedPairs, rank: int) -> list[int]:
    """Returns the rows whose scores rounding may have put in this place; a drawn order has no scores."""
    scores = pairs.scores
    if scores[0] == scores[-1]:
        return [rank]
    close = np.flatnonzero(np.abs(scores - scores[rank]) <= ROUNDING * max(1.0, abs(float(scores[rank]))))
    return [rank, *(int(row) for row in close if row != rank)]


def _is_pair(proposed: ProposedQuery, pairs: RankedPairs, row: int, order: list[int]) -> bool:
    return all(
        len(stored) == len(pair) and bool(np.all(np.abs(stored - pair) <= ROUNDING))
        for _, stored, pair in _numbers(proposed, pairs, row, order)
    )


def _numbers(
    proposed: ProposedQuery, pairs: RankedPairs, row: int, order: list[int]
) -> Iterator[tuple[str, Float[np.ndarray, " n"], Float[np.ndarray, " n"]]]:
    """Gives what a ranking says of a pair: its name, what was stored, and what is ranked there."""
    query, provenance = proposed.query, provenance_of(proposed)
    nothing = np.empty(0)
    if pairs.weights is not None:
        for side, name in enumerate("ab"):
            stored = (provenance.weights_a, provenance.weights_b)[side]
            yield (
                f"provenance.weights_{name}",
                nothing if stored is None else stored,
                pairs.weights[row, order[side]],
            )
    if isinstance(pairs, RankedTrajectories):
        for side, name in enumerate("ab"):
            stored_controls = (query.controls_a, query.controls_b)[side]
            yield f"query.controls_{name}", stored_controls, pairs.controls[row, order[side]]


def _verify_searched(findings: Findings, study: Study, proposed: ProposedQuery) -> None:
    """Verifies that both drives are what the study's search should have found for their weights."""
    query, provenance, rewards = proposed.query, provenance_of(proposed), study.rewards
    verify_best_drives(findings, rewards.domain, proposed)
    is_searched = study.file.trajectory.search == "bank" and not _is_ranked_drive(study, provenance)
    if not is_searched or rewards.bank is None:
        return
    if not has_bank(study, provenance):
        findings.leave_out(_OTHER_BANK)
        return
    for name, controls, weights in (
        ("A", query.controls_a, provenance.weights_a),
        ("B", query.controls_b, provenance.weights_b),
    ):
        assert weights is not None, "a search has weights"
        reward = float(rewards.domain.reward_and_gradient(controls[None], weights[None])[0][0])
        of_bank = float((rewards.bank.features @ weights).max())
        findings.compare(f"reward of trajectory {name}", reward, max(reward, of_bank), ROUNDING)


def _is_ranked_drive(study: Study, provenance: Provenance) -> bool:
    """Returns whether the method itself said which drives to show, and nothing was searched for."""
    method = acquisition_named(study.file.acquisition.method)
    return method.needs_bank and provenance.method == study.file.acquisition.method


def _verify_climbed(
    findings: Findings, study: Study, climbed: Climbed, proposed: ProposedQuery, posterior: Posterior | None
) -> None:
    """Verifies a pair that a climb over both drives' controls ended at, wherever that climb began."""
    if posterior is None:
        findings.leave_out(UNKNOWN_PARAMETERS)
        return
    provenance, domain = provenance_of(proposed), study.rewards.domain
    both = np.stack([proposed.query.controls_a, proposed.query.controls_b])
    pair = both[::-1] if is_pair_swapped(study, provenance.stream) else both
    features = domain.features(domain.rollout(pair))
    score = float(climbed.scores(posterior, features[:1] - features[1:])[0])
    findings.compare("provenance.score", provenance.score, score, ROUNDING)
    runner_up = provenance.runner_up_score
    is_less = runner_up is None or runner_up <= provenance.score
    findings.require("provenance.runner_up_score", is_less, runner_up, "no more than the score")
    verify_free_pair(findings, domain, climbed.objective(posterior), pair, all(provenance.has_converged))
