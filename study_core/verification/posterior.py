"""Whether a stored posterior is that of its answers, as far as Monte Carlo can tell."""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Float

from study_core.choice import PARAMETER_PRIORS, ParameterName, ResponseModel
from study_core.comparison import ComparisonSet
from study_core.posterior.evidence import GRID, log_evidence
from study_core.posterior.run import infer
from study_core.queries import Participant
from study_core.streams import stream
from study_core.study import Study
from study_core.verification.findings import ROUNDING, Findings
from study_core.verification.stored import StoredPosterior

STANDARD_ERRORS = 6.0
"""A thousand people have half a million means; of so many, five standard errors would be exceeded by chance."""

_UNCONVERGED = "means of posteriors whose chains had not converged"
_PURPOSE = "verification"


def verify_posterior(
    findings: Findings,
    study: Study,
    participant: Participant,
    query_index: int,
    comparisons: ComparisonSet,
    stored: StoredPosterior,
) -> None:
    """Verifies samples, parameters and mean of a posterior against chains of other random numbers.

    Args:
        findings: Told what isn't so.
        study: The study, with what was known.
        participant: Names the random streams.
        query_index: The query that was chosen from it.
        comparisons: The answers before it, in the features of `study.rewards`.
        stored: What was kept.
    """
    _verify_support(findings, study, stored)
    response = _verify_parameters(findings, study, participant, query_index, comparisons, stored)
    if response is None:
        return
    rng = stream(study.seed, _PURPOSE, participant, query_index)
    fresh = infer(rng, study.rewards.prior, response, comparisons, study.sampler)
    if not (stored.diagnostics.has_converged and fresh.diagnostics.has_converged):
        findings.leave_out(_UNCONVERGED)
        return
    n_weights = len(fresh.mean)
    variances = fresh.samples.var(axis=0, ddof=1)
    ess_stored = stored.diagnostics.ess_bulk[:n_weights]
    of_fresh = variances / fresh.diagnostics.ess_bulk[:n_weights]
    _compare_means(findings, "mean", stored.mean, fresh.mean, variances / ess_stored + of_fresh)
    # Of the draws, few samples are kept; nearly independent ones, since they are evenly spaced.
    kept = variances / np.minimum(ess_stored, len(stored.samples))
    _compare_means(findings, "mean of the samples", stored.samples.mean(axis=0), fresh.mean, kept + of_fresh)


def _compare_means(
    findings: Findings,
    quantity: str,
    stored: Float[np.ndarray, " n"],
    fresh: Float[np.ndarray, " n"],
    variances: Float[np.ndarray, " n"],
) -> None:
    for place, variance in enumerate(variances):
        findings.compare(
            f"{quantity}[{place}]",
            float(stored[place]),
            float(fresh[place]),
            STANDARD_ERRORS * float(np.sqrt(variance)),
        )


def _verify_support(findings: Findings, study: Study, stored: StoredPosterior) -> None:
    """Verifies that every sample lies where the prior puts weights."""
    prior = study.rewards.prior
    shape = (len(stored.mean), stored.samples.shape[1])
    findings.compare_all("number of weights", shape, (prior.n_features,) * 2)
    findings.compare("number of samples", len(stored.samples), study.sampler.n_samples)
    least = stored.samples.min(axis=1)
    lengths = np.linalg.norm(stored.samples, axis=1)
    expected = np.ones(len(lengths)) if prior.support == "sphere" else np.minimum(lengths, 1.0)
    findings.compare_all("smallest weight of sample", least, np.maximum(least, 0.0), ROUNDING)
    findings.compare_all("length of sample", lengths, expected, ROUNDING)


def _verify_parameters(
    findings: Findings,
    study: Study,
    participant: Participant,
    query_index: int,
    comparisons: ComparisonSet,
    stored: StoredPosterior,
) -> ResponseModel | None:
    """Verifies the response parameters; returns the model with what the evidence chose; None where nobody kept it."""
    parameters, response = stored.parameters, study.response
    if parameters is None:
        # Only those that are inferred differ from sample to sample, so nothing has been chosen.
        return response if not response.chosen_by_evidence else None
    chosen: dict[ParameterName, float] = {}
    for name, setting in response.settings.items():
        values = getattr(parameters, name)
        if setting == "evidence":
            chosen[name] = float(values[0])
            is_on_grid = bool((values == chosen[name]).all()) and chosen[name] in GRID[name]
            findings.require(name, is_on_grid, chosen[name], f"one of {GRID[name]}")
        elif setting != "inferred":
            findings.compare_all(name, values, np.full(len(values), float(setting)))
    if not chosen:
        return response
    _verify_evidence(findings, study, participant, query_index, comparisons, chosen)
    return response.with_fixed(chosen)


def _verify_evidence(
    findings: Findings,
    study: Study,
    participant: Participant,
    query_index: int,
    comparisons: ComparisonSet,
    chosen: dict[ParameterName, float],
) -> None:
    """Verifies that no point of the grid has more evidence than the one chosen, as far as Monte Carlo can tell."""
    rng = stream(study.seed, _PURPOSE, "evidence", participant, query_index)
    of_chosen, error_of_chosen = _score(rng, study, comparisons, chosen)
    for values in itertools.product(*(GRID[name] for name in chosen)):
        candidate = dict(zip(chosen, values, strict=True))
        score, error = _score(rng, study, comparisons, candidate)
        tolerance = STANDARD_ERRORS * float(np.hypot(error, error_of_chosen))
        # Said of the difference, because a tolerance is relative to large numbers.
        findings.compare(
            f"log evidence of {candidate} above that of {chosen}", max(0.0, score - of_chosen), 0.0, tolerance
        )


def _score(
    rng: np.random.Generator, study: Study, comparisons: ComparisonSet, candidate: dict[ParameterName, float]
) -> tuple[float, float]:
    """Returns what the evidence chooses by, and its standard error."""
    evidence = log_evidence(rng, study.rewards.prior, study.response.with_fixed(candidate), comparisons)
    log_prior = sum(PARAMETER_PRIORS[name].log_density(value) for name, value in candidate.items())
    return evidence.log_evidence + log_prior, evidence.standard_error
