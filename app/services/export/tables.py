"""The tables of an export, column by column, for the studies that are in it.

Columns that depend on a study (its features, its weights) are there for all studies of the export; they are empty in
the rows of a study that has none of that name.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from app.services.export.columns import Column, TableSchema, distinct
from app.store import Verdict
from study_core.comparison import Choice
from study_core.events import MOST_CONFIDENT, StepOutcome
from study_core.path import Ending
from study_core.plan import Phase, Position
from study_core.session_codec import KINDS
from study_core.study import Study

PERSON = Column("person_id", "string", "The person's session: a random name, or a pseudonym.")
STUDY = Column(
    "study_hash", "string", "SHA-256 of the study's text, which names its file in the folder `studies`."
)
QUERY = Column("query_index", "integer", "Place of the query in the session, from 0.", least=0)
_VERSION = Column(
    "study_version",
    "string",
    "SHA-256 of the study file's text: as `study_hash`, but the same for all its conditions.",
)
_POSITION = Column("position", "integer", "Place in the person's log, from 0.", least=0)
_TAKEN_BACK = Column(
    "is_taken_back", "boolean", "Whether it stands no longer, because an answer was taken back."
)
_LANGUAGE = Column("language", "string", "Code of the language that was read, such as `en`.")
PHASE = Column(
    "phase",
    "string",
    "What the query is for; only answers to active queries inform the posterior.",
    levels=tuple(Phase),
)
_IDS = (PERSON, STUDY, _VERSION)

MEASURES = (
    Column("replays", "integer", "How often the drives were played again.", least=0),
    Column("pauses", "integer", "How often they were paused.", least=0),
    Column("speed_changes", "integer", "How often their speed was changed.", least=0),
    Column("scrubs", "integer", "How often somebody moved through them by hand.", least=0),
    Column("hidden", "integer", "How often the page was hidden.", least=0),
    Column("out_of_focus_ms", "number", "How long the page was out of focus.", "ms", least=0),
    Column("means", "string", "What the answer was given with, such as `key` or `mouse`."),
    Column("confidence_time_ms", "number", "From the answer to the confidence.", "ms", least=0),
    Column(
        "first_frame", "string", "Whether the first picture was seen or assumed.", levels=("seen", "assumed")
    ),
    Column("frame_ms", "number", "Time from one picture of the page to the next.", "ms", least=0),
    Column("stage_frame_ms", "number", "Time from one picture of the drives to the next.", "ms", least=0),
    Column("layout", "string", "Picture layout that was shown, such as `wide`."),
    Column("viewport", "json", "Width and height of the page.", "px"),
    Column("device_pixel_ratio", "number", "Pixels of the screen in one of the page's.", least=0),
)
"""What browsers measure; whatever else one may have sent is in `other`."""

DIAGNOSED = ("r_hat", "ess_bulk", "ess_tail")
QUANTITIES = ("rationality", "lapse_rate", "tie_threshold")
QUANTILES = ("q05", "median", "q95")


def tables_of(studies: Iterable[Study], with_samples: bool) -> tuple[TableSchema, ...]:
    """Returns all tables for people of these studies; that of the posterior samples only if it is wanted."""
    known = tuple(studies)
    features = distinct(study.domain.feature_names for study in known)
    weights = distinct(study.weight_names for study in known)
    inferred = distinct(study.response.inferred for study in known)
    n_controls = max((len(study.domain.control_lower) for study in known), default=0)
    samples = (_samples(weights),) if with_samples else ()
    return (
        _people(),
        _steps(),
        _responses(),
        _queries(features, weights, n_controls),
        _answers(),
        _measures(),
        _posteriors(weights, inferred),
        *samples,
        _networks(),
        _events(),
    )


def _people() -> TableSchema:
    return TableSchema(
        "people",
        "One row a person.",
        (
            *_IDS,
            Column("study", "string", "Name of the study."),
            Column("condition", "string", "The condition that the person is in, where the study has some."),
            Column("ordinal", "integer", "The person's number within the study, from 1.", least=1),
            Column(
                "source",
                "string",
                "Whether a participant, a simulated person or a participant of another program's study.",
                levels=("joined", "rehearsed", "imported"),
            ),
            Column("created_at", "timestamp", "When the session was created."),
            _LANGUAGE,
            Column("n_answers", "integer", "Answers that stand.", "answers", least=0),
            Column("is_finished", "boolean", "Whether every query has been answered."),
            Column(
                "ending", "string", "How the session ended; empty while it goes on.", levels=tuple(Ending)
            ),
            Column("n_repeats", "integer", "Repeated queries that were answered.", "queries", least=0),
            Column(
                "n_repeats_agreed", "integer", "Of these, how many as the first time.", "queries", least=0
            ),
            Column("n_checks", "integer", "Attention checks that were answered.", "queries", least=0),
            Column("n_checks_passed", "integer", "Of these, how many as they told.", "queries", least=0),
            Column("n_sided", "integer", "Answers that chose a side of the screen.", "answers", least=0),
            Column("n_first", "integer", "Of these, how many chose the first position.", "answers", least=0),
            Column("median_response_ms", "number", "Median response time.", "ms", least=0),
            Column(
                "verdict",
                "string",
                "Why the session doesn't count: its work wasn't accepted, or it is left out of the analysis.",
                levels=tuple(Verdict),
            ),
            Column("verdict_reason", "string", "The reason that the experimenter gave."),
            Column("external_id", "string", "Who the person is to whoever sent them, such as Prolific's id."),
            Column("other_ids", "json", "What else the link said about the person, by name."),
        ),
    )


def _steps() -> TableSchema:
    return TableSchema(
        "steps",
        "One row for each page of the path that was taken, queries apart.",
        (
            *_IDS,
            _POSITION,
            Column("step", "integer", "Place of the page in the path, from 0.", least=0),
            Column("kind", "string", "What the page is, such as `consent`."),
            Column("outcome", "string", "What became of it.", levels=tuple(StepOutcome)),
            _LANGUAGE,
            Column(
                "text_sha256",
                "string",
                "SHA-256 of the text that was read; the texts are in the folder `texts`.",
            ),
            Column("at", "timestamp", "When it was taken."),
        ),
    )


def _responses() -> TableSchema:
    return TableSchema(
        "responses",
        "One row for each item of a questionnaire that was answered.",
        (
            *_IDS,
            _POSITION,
            Column("step", "integer", "Place of the page in the path, from 0.", least=0),
            Column("questionnaire", "string", "Name of the questionnaire."),
            Column("item", "string", "Name of the item."),
            Column("value", "json", "The answer: a number, a text, or the names of what was chosen."),
        ),
    )


def _queries(features: Sequence[str], weights: Sequence[str], n_controls: int) -> TableSchema:
    pair = ("a", "b")
    return TableSchema(
        "queries",
        "One row for each query that was prepared.",
        (
            *_IDS,
            QUERY,
            _POSITION,
            PHASE,
            Column("prepared_at", "timestamp", "When the query was ready."),
            _TAKEN_BACK,
            Column(
                "first_shown", "string", "The trajectory in the first position, if written down.", levels=pair
            ),
            Column("repeat_of", "integer", "Index of the query that this one asks again.", least=0),
            Column("instructed", "string", "What a check tells people to choose.", levels=tuple(Position)),
            *(
                Column(f"controls_{side}_{i}", "number", f"Control {i} of trajectory {side.upper()}.")
                for side in pair
                for i in range(n_controls)
            ),
            *(
                Column(f"features_{side}_{name}", "number", f"Feature `{name}` of trajectory {side.upper()}.")
                for side in pair
                for name in features
            ),
            Column(
                "method", "string", "Where the pair comes from: acquisition method, test set, practice..."
            ),
            Column("score", "number", "Acquisition value of the pair."),
            Column("runner_up_score", "number", "Acquisition value of the next best pair."),
            Column("pairs_tried", "integer", "Pairs that looked alike before this one, plus one.", "pairs"),
            *(
                Column(
                    f"weights_{side}_{name}",
                    "number",
                    f"Weight of `{name}` that trajectory {side.upper()} is best for.",
                )
                for side in pair
                for name in weights
            ),
            *(
                Column(
                    f"has_converged_{side}",
                    "boolean",
                    f"Whether the search for trajectory {side.upper()} met its tolerance.",
                )
                for side in pair
            ),
            Column("are_distinct", "boolean", "Whether A and B differ, by the study's bound."),
            Column("visible_difference", "number", "How far apart A and B look.", "body lengths", least=0),
            Column("seed", "integer", "The study's seed."),
            Column("stream", "json", "Names of the random streams that the query came from."),
            Column("versions", "json", "Ids of domain, sampler, optimiser and acquisition method."),
            Column("bank_digest", "string", "SHA-256 of the bank of local optima that was searched."),
            Column("clips", "json", "SHA-256 of the clip that shows the query, by picture layout."),
            Column("code_version", "string", "Version of prefstudy that computed or imported the query."),
            Column("machine", "string", "Type of the processor that computed the query."),
            Column("compute_ms", "number", "What the query cost, on one core.", "ms", least=0),
            Column("imported_file", "string", "File that an imported query was read from."),
            Column("imported_sha256", "string", "SHA-256 of that file."),
            Column("imported_entry", "integer", "Place of the query among that file's, from 0.", least=0),
        ),
    )


def _answers() -> TableSchema:
    return TableSchema(
        "answers",
        "One row for each answer.",
        (
            *_IDS,
            QUERY,
            _POSITION,
            PHASE,
            Column(
                "choice", "string", "What was answered: trajectory A, B or neither.", levels=tuple(Choice)
            ),
            Column("position_chosen", "string", "Where the chosen trajectory stood.", levels=tuple(Position)),
            Column("response_time_ms", "integer", "As measured in the browser.", "ms", least=0),
            Column(
                "confidence", "integer", "How sure the person is; 1 is a guess.", least=1, most=MOST_CONFIDENT
            ),
            Column("answered_at", "timestamp", "When the answer was kept."),
            _TAKEN_BACK,
        ),
    )


def _measures() -> TableSchema:
    return TableSchema(
        "measures",
        "One row for each report of a browser on a query that it showed.",
        (
            *_IDS,
            QUERY,
            Column("received_at", "timestamp", "When the report came."),
            *MEASURES,
            Column("other", "json", "What else the browser sent."),
        ),
    )


def _posteriors(weights: Sequence[str], inferred: Sequence[str]) -> TableSchema:
    what = {
        "r_hat": "R-hat",
        "ess_bulk": "Effective sample size of the bulk",
        "ess_tail": "Effective sample size of the tails",
    }
    return TableSchema(
        "posteriors",
        "One row for each posterior: what was believed about the person before a query.",
        (
            *_IDS,
            QUERY,
            *(
                Column(f"mean_{name}", "number", f"Posterior mean of the weight of `{name}`.")
                for name in weights
            ),
            *(
                Column(f"{quantity}_{quantile}", "number", f"{words} of the person's {quantity}.")
                for quantity in QUANTITIES
                for quantile, words in zip(
                    QUANTILES, ("5 % quantile", "Median", "95 % quantile"), strict=True
                )
            ),
            Column("has_converged", "boolean", "Whether the diagnostics were satisfied."),
            *(
                Column(f"{key}_{name}", "number", f"{what[key]} of `{name}`.")
                for key in DIAGNOSED
                for name in distinct((weights, inferred))
            ),
            Column("acceptance", "number", "Share of proposals that the sampler accepted.", least=0, most=1),
            Column("n_draws", "integer", "Draws of all chains.", "draws", least=0),
            Column("n_samples", "integer", "Of these, how many were kept.", "draws", least=0),
            Column("warning", "string", "What is wrong with the posterior, in words."),
        ),
    )


def _samples(weights: Sequence[str]) -> TableSchema:
    return TableSchema(
        "samples",
        "One row for each kept sample of a posterior.",
        (
            PERSON,  # without the study, which would be half of every row
            QUERY,
            Column("sample", "integer", "Number of the sample in its posterior, from 0.", least=0),
            *(Column(f"sample_{name}", "number", f"Sampled weight of `{name}`.") for name in weights),
            *(
                Column(
                    name, "number", f"Sampled {name}; empty where all samples have the posterior's median."
                )
                for name in QUANTITIES
            ),
        ),
        block=65_536,
    )


def _networks() -> TableSchema:
    return TableSchema(
        "networks",
        "One row for each model that was learned, from one person or from several; its bytes are in `networks`.",
        (
            *_IDS,
            Column("study", "string", "Name of the study."),
            Column("kind", "string", "Which predictor the model is of."),
            Column("key", "string", "Hash of everything that the model was computed from."),
            Column("sha256", "string", "SHA-256 of the model's bytes, which names its file."),
            Column("n_bytes", "integer", "Size of the model.", "bytes", least=0),
            Column("lineage", "json", "What the model was computed from, and by what."),
        ),
    )


def _events() -> TableSchema:
    return TableSchema(
        "events",
        "One row for each entry of a person's log, from which everything else can be derived.",
        (
            *_IDS,
            _POSITION,
            Column("kind", "string", "What happened.", levels=tuple(KINDS.values())),
            Column("at", "timestamp", "When it was kept."),
            Column("payload", "json", "All that was kept of it."),
        ),
    )
