"""Verifying each step of an exported person alone, where they can't be derived again to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float

from app.services.export import Export
from app.services.export.columns import Row
from app.services.export.tables import QUANTITIES
from app.services.replay.errors import ReplayDifferenceError
from app.services.replay.person import ExportedPerson
from study_core.choice import ResponseParameters
from study_core.errors import ScriptError
from study_core.posterior.diagnostics import Diagnostics
from study_core.study import Study
from study_core.verification.findings import Findings
from study_core.verification.session import Verifier
from study_core.verification.stored import StoredPosterior

_MOST_TOLD = 20


def verify_steps(
    verifier: Verifier, export: Export, person: ExportedPerson, on_query: Callable[[], None] = lambda: None
) -> Findings:
    """Verifies a person's steps against the posteriors that were stored with them.

    Args:
        verifier: Of the person's study; it remembers queries that are everybody's.
        export: Where the posteriors are.
        person: The person.
        on_query: Called after each query.

    Raises:
        ReplayDifferenceError: Something isn't what it should be; the message names every such number.
        ScriptError: The samples weren't exported.
    """
    rows = {row["query_index"]: row for row in export.rows_of("posteriors", person.id)}
    findings = verifier.verify(
        person.log, lambda query_index: stored_posterior(export, person, rows, query_index), on_query
    )
    found = findings.violations
    if found:
        told = "; ".join(map(str, found[:_MOST_TOLD]))
        more = f"; and {len(found) - _MOST_TOLD} more" if len(found) > _MOST_TOLD else ""
        raise ReplayDifferenceError(
            f"{person.source}: {len(found)} of {findings.n_compared} numbers aren't what they should be: {told}{more}."
        )
    return findings


def stored_posterior(
    export: Export, person: ExportedPerson, rows: Mapping[int, Row], query_index: int
) -> StoredPosterior:
    """Returns a posterior as it was exported.

    Args:
        export: Where its samples are.
        person: Whose it is.
        rows: The person's, of the table `posteriors`, by query.
        query_index: The query that was chosen from it.

    Raises:
        ScriptError: It wasn't exported, or not with its samples.
    """
    samples = export.samples(person.id, query_index)
    if query_index not in rows or not len(samples):
        raise ScriptError(
            f"{person.source}: expected the samples of the posterior of query {query_index}, found none: steps are "
            "verified against stored samples. Export again with --samples all."
        )
    row, names = rows[query_index], person.study.weight_names
    means = [row[f"mean_{name}"] for name in names if row[f"mean_{name}"] is not None]
    parameters = _parameters(row, len(samples), export.parameters(person.id, query_index))
    return StoredPosterior(samples, np.array(means), parameters, _diagnostics(row, person.study, len(means)))


def _parameters(
    row: Row, n_samples: int, kept: Float[np.ndarray, "n_samples 3"] | None
) -> ResponseParameters | None:
    """Returns the response parameters of each sample: those kept with it, or the ones that all samples have."""
    if kept is not None:
        return ResponseParameters(*np.ascontiguousarray(kept.T))
    constants = [row[f"{name}_median"] for name in QUANTITIES if row[f"{name}_q05"] == row[f"{name}_q95"]]
    if len(constants) < len(QUANTITIES) or None in constants:
        return None
    return ResponseParameters.constant(n_samples, *constants)


def _diagnostics(row: Row, study: Study, n_weights: int) -> Diagnostics:
    names = (*study.weight_names[:n_weights], *study.response.inferred)

    def of(key: str, absent: float) -> Float[np.ndarray, " n_quantities"]:
        values = [row[f"{key}_{name}"] for name in names]
        return np.array([absent if value is None else value for value in values])

    return Diagnostics(
        of("r_hat", np.inf), of("ess_bulk", 0.0), of("ess_tail", 0.0), row["acceptance"], row["n_draws"]
    )
