"""What a participant's stage shows: the query being asked, or the example of the instructions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from app.services.runtime import Runtime
from study_core.comparison import Choice, Query
from study_core.domain import Domain
from study_core.path import InstructionsStep
from study_core.queries import propose_common_query
from study_core.session import Action, current_step, next_action
from study_core.study import parse_study

# No query follows it whose number has the same mark.
_EXAMPLE = -1


@dataclass(frozen=True)
class Shown:
    """Two trajectories on the stage.

    Attributes:
        key: Tells one picture from the next.
        number: Of a query, its index; goes into the picture's mark.
        domain: Whose trajectories they are.
        query: The two.
        first_shown: Which of them is in the first position.
    """

    key: str
    number: int
    domain: Domain
    query: Query
    first_shown: Choice


def shown(runtime: Runtime, session_id: str) -> Shown | None:
    """Returns what a session's stage should show now, or None."""
    live = runtime.live(session_id)
    with live.lock:
        study, state = live.study, live.state
    step, current = current_step(study, state), state.current
    if isinstance(step, InstructionsStep) and step.example:
        return Shown("example", _EXAMPLE, study.domain, _example(study.text), Choice.A)
    # A query may be prepared during a break, but it is seen from its beginning when the break is over.
    if current is None or next_action(study, state) is not Action.ASK:
        return None
    # After an answer that was taken back, another query may have the same index.
    key = "-".join([f"query-{current.query_index}", *current.clips.values()])
    return Shown(key, current.query_index, study.domain, current.proposed.query, current.side_shown_first)


@lru_cache(maxsize=8)
def _example(study_text: str) -> Query:
    return propose_common_query(parse_study(study_text), "example", 0).query
