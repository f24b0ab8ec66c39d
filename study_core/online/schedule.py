"""When a session learns a feature, and from which of its answers: a pure function, so that a log says it all."""

from __future__ import annotations

LEAD = 4
"""So many queries are asked while a feature is being learned: nobody waits for it."""

FEWEST_ANSWERS = 10
"""Nothing is learned from fewer answers that prefer one of the two."""


def n_learned_from(every: int, n_active: int, query_index: int) -> int:
    """Returns from the answers to how many first queries the feature is learned that a query is chosen with.

    Args:
        every: Active queries from one feature to the next.
        n_active: Active queries of a session; the first query after them is chosen by nothing, but the last posterior
            is inferred with its feature.
        query_index: From 0.

    Returns:
        0 as long as there is none.
    """
    block = min(query_index, n_active) // every
    return block * every - LEAD if block else 0
