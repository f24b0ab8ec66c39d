"""About how long a study takes, and how long what is left of it."""

from __future__ import annotations

from statistics import median

from study_core.session import SessionState
from study_core.study import Study

SECONDS_PER_QUERY = 14
"""What a query takes somebody, all in all."""

_SECONDS_PER_PAGE = 40
# Of somebody's own pace, the last so many queries count; to each belongs the moment until the next is there.
_N_RECENT = 20
_BETWEEN_QUERIES_MS = 1000


def expected_minutes(study: Study) -> int:
    """Returns about how many minutes somebody needs for a study, at least one."""
    return _minutes(study.n_queries, SECONDS_PER_QUERY, len(study.file.path) - 1)


def minutes_left(study: Study, state: SessionState) -> int | None:
    """Returns about how many minutes the queries and pages that are left take somebody who goes on as they began.

    At least one; None before there is an answer to go by.
    """
    times = [
        given.response_time_ms for given in state.answers[-_N_RECENT:] if given.response_time_ms is not None
    ]
    if not times:
        return None
    seconds_per_query = (median(times) + _BETWEEN_QUERIES_MS) / 1000
    n_pages = len(study.file.path) - 1 - state.step
    return _minutes(study.n_queries - state.query_index, seconds_per_query, n_pages)


def _minutes(n_queries: int, seconds_per_query: float, n_pages: int) -> int:
    return max(1, round((n_queries * seconds_per_query + n_pages * _SECONDS_PER_PAGE) / 60))
