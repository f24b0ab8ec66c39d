"""What is known about each query of a rehearsal, as a table: what was asked and answered, by whom, and the truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from app.services.export.columns import Column, Row, TableSchema, distinct
from app.services.export.single import new_table
from app.services.export.tables import PHASE, QUERY
from study_core.comparison import Choice
from study_core.plan import Position
from study_core.study import Study


@contextmanager
def new_rehearsal_table(path: Path, study: Study) -> Iterator[Callable[[Sequence[Row]], None]]:
    """Opens a new file for a study's rehearsals, in all its conditions; gives what adds a rehearsal's rows.

    Raises:
        ExportError: The file can't be written, or its name ends otherwise than a table's.
    """
    with new_table(path, _schema(study.arms)) as add:
        yield lambda rows: add([_flat(row) for row in rows])


def _flat(row: Row) -> Row:
    """Returns a row with a column for each entry of a mapping."""
    flat: Row = {}
    for key, value in row.items():
        flat |= (
            {f"{key}_{name}": each for name, each in value.items()}
            if isinstance(value, dict)
            else {key: value}
        )
    return flat


def _schema(arms: Sequence[Study]) -> TableSchema:
    features = distinct(study.domain.feature_names for study in arms)
    weights = distinct(study.weight_names for study in arms)
    answers = distinct(study.answers for study in arms)
    return TableSchema(
        "rehearsals",
        "One row for each query that a simulated person answered.",
        (
            Column("study", "string", "Name of the study."),
            Column("condition", "string", "The condition that the person is in, where the study has some."),
            Column("participant", "string", "Names the person's random streams."),
            QUERY,
            PHASE,
            Column("first_shown", "string", "The trajectory in the first position.", levels=("a", "b")),
            Column("repeat_of", "integer", "Index of the query that this one asks again.", least=0),
            Column("instructed", "string", "What a check tells people to choose.", levels=tuple(Position)),
            Column("method", "string", "Where the pair comes from."),
            Column("visible_difference", "number", "How far apart A and B look.", "body lengths", least=0),
            Column("are_distinct", "boolean", "Whether A and B differ, by the study's bound."),
            Column("choice", "string", "What was answered.", levels=tuple(Choice)),
            Column("probability", "number", "How likely that answer was.", least=0, most=1),
            *(
                Column(
                    f"probability_of_{name}",
                    "number",
                    f"How likely the answer `{name}` was.",
                    least=0,
                    most=1,
                )
                for name in answers
            ),
            Column("alignment", "number", "Cosine between posterior mean and truth.", least=-1, most=1),
            *(Column(f"feature_difference_{name}", "number", f"Of `{name}`, A less B.") for name in features),
            *(
                Column(f"posterior_mean_{name}", "number", f"Mean weight of `{name}` after the answer.")
                for name in weights
            ),
            *(
                Column(f"true_weight_{name}", "number", f"The person's weight of `{name}`.")
                for name in features
            ),
            Column("true_rationality", "number", "Their beta.", least=0),
            Column(
                "true_lapse_rate", "number", "Share of answers that they give at random.", least=0, most=1
            ),
            Column("true_tie_threshold", "number", "Their eta of `same`.", least=0),
            Column("drift_rad", "number", "By how much their taste moves at every query.", "rad", least=0),
            Column("side_bias", "number", "What is added to their log-odds of the first position."),
            Column("unsure_rate", "number", "Share of queries that they can't tell.", least=0, most=1),
            Column("hidden_feature", "string", "A rich feature that they care for as well."),
            Column("hidden_weight", "number", "How much, per unit of that feature."),
        ),
    )
