"""Posteriors, one per query of a session."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import delete, func, insert, select
from sqlalchemy.orm import Session

from app.store import sessions
from app.store.codec import decode_floats, decode_json, encode_floats, encode_json
from app.store.errors import StoreError
from app.store.models import PosteriorRow, SessionRow, table_of
from app.store.records import PosteriorRecord, Source

N_PARAMETERS = 3
"""Rationality, lapse rate and tie threshold."""


def add(rows: Session, session_id: str, posterior: PosteriorRecord) -> None:
    """Adds the posterior of a query, in the place of an earlier one if an answer before it was taken back."""
    mean, samples = posterior.mean, posterior.samples
    if mean.ndim != 1 or samples.ndim != 2 or samples.shape[1] != mean.shape[0]:
        raise StoreError(
            f"Expected a mean of shape (d,) and samples of shape (m, d), got {mean.shape} and "
            f"{samples.shape}. Put one sample in each row."
        )
    n_samples, n_dims = samples.shape
    parameters = posterior.parameters
    if parameters is not None and parameters.shape != (n_samples, N_PARAMETERS):
        raise StoreError(
            f"Expected response parameters of shape {(n_samples, N_PARAMETERS)}, got {parameters.shape}. "
            "Put those of one sample in each row."
        )
    values = {
        "session_id": session_id,
        "query_index": posterior.query_index,
        "n_samples": n_samples,
        "n_dims": n_dims,
        "mean": encode_floats(mean),
        "samples": encode_floats(samples),
        "parameters": None if parameters is None else encode_floats(parameters),
        "summary": encode_json(posterior.summary),
    }
    drop(rows, session_id, posterior.query_index)
    rows.execute(insert(table_of(PosteriorRow)), [values])


def of_session(rows: Session, session_id: str) -> tuple[PosteriorRecord, ...]:
    """A session's posteriors by query index."""
    sessions.by_id(rows, session_id)
    query = (
        select(PosteriorRow).where(PosteriorRow.session_id == session_id).order_by(PosteriorRow.query_index)
    )
    return tuple(_record(row) for row in rows.scalars(query))


def last_mean(rows: Session, session_id: str) -> NDArray[np.float64] | None:
    """The mean of a session's last posterior, or None without any."""
    sessions.by_id(rows, session_id)
    query = (
        select(PosteriorRow.mean, PosteriorRow.n_dims)
        .where(PosteriorRow.session_id == session_id)
        .order_by(PosteriorRow.query_index.desc())
        .limit(1)
    )
    row = rows.execute(query).first()
    return None if row is None else decode_floats(row.mean, (row.n_dims,))


def last_means(rows: Session, study_hash: str) -> dict[str, NDArray[np.float64]]:
    """By session, the last posterior's mean of everybody who has completed a study; rehearsals are nobody."""
    last = (
        select(PosteriorRow.session_id, func.max(PosteriorRow.query_index).label("query_index"))
        .join(SessionRow, SessionRow.id == PosteriorRow.session_id)
        .where(
            SessionRow.study_hash == study_hash,
            SessionRow.ending == sessions.COMPLETED,
            SessionRow.source != Source.REHEARSED.value,
        )
        .group_by(PosteriorRow.session_id)
        .subquery()
    )
    # The samples, which are large, stay where they are.
    query = select(PosteriorRow.session_id, PosteriorRow.mean, PosteriorRow.n_dims).join(
        last,
        (last.c.session_id == PosteriorRow.session_id) & (last.c.query_index == PosteriorRow.query_index),
    )
    return {row.session_id: decode_floats(row.mean, (row.n_dims,)) for row in rows.execute(query)}


def drop(rows: Session, session_id: str, query_index: int) -> None:
    """Removes the posterior of a query, if there is one."""
    its_own = (PosteriorRow.session_id == session_id) & (PosteriorRow.query_index == query_index)
    rows.execute(delete(table_of(PosteriorRow)).where(its_own))


def drop_after(rows: Session, session_id: str, query_index: int) -> None:
    """Removes the posteriors of all queries after one, whose answer no longer stands."""
    later = (PosteriorRow.session_id == session_id) & (PosteriorRow.query_index > query_index)
    rows.execute(delete(table_of(PosteriorRow)).where(later))


def _record(row: PosteriorRow) -> PosteriorRecord:
    shape = (row.n_samples, N_PARAMETERS)
    return PosteriorRecord(
        query_index=row.query_index,
        mean=decode_floats(row.mean, (row.n_dims,)),
        samples=decode_floats(row.samples, (row.n_samples, row.n_dims)),
        summary=decode_json(row.summary),
        parameters=None if row.parameters is None else decode_floats(row.parameters, shape),
    )
