"""About how long a study takes."""

from __future__ import annotations

from study_core.study import Study

_SECONDS_PER_QUERY = 14
_SECONDS_PER_PAGE = 40


def expected_minutes(study: Study) -> int:
    """Returns about how many minutes somebody needs for a study, at least one."""
    n_pages = len(study.file.path) - 1
    seconds = study.n_queries * _SECONDS_PER_QUERY + n_pages * _SECONDS_PER_PAGE
    return max(1, round(seconds / 60))
