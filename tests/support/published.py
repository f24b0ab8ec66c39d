"""Files of the published study's layout with made-up people, driven step by step and written with h5py alone."""

from __future__ import annotations

import itertools
from pathlib import Path

import h5py
import numpy as np

from tests.study_core import references

_ANSWER = np.dtype([("x₁", h5py.ref_dtype), ("x₂", h5py.ref_dtype), ("ψ", h5py.ref_dtype), ("pref", "<i8")])
_WEIGHTS = np.array([0.2, 0.5, 0.3, 0.8])


def write_person(
    folder: Path,
    number: int,
    n_active: int = 6,
    n_test: int = 3,
    n_samples: int | None = None,
    training_name: str = "train{}.jld2",
    nudge: float = 0.0,
) -> dict[str, np.ndarray]:
    """Writes both files of a person; returns what was written.

    Args:
        folder: Where.
        number: The person's; also decides what they do.
        n_active: Active queries.
        n_test: Test queries.
        n_samples: Sets of posterior samples; one a query unless told.
        training_name: How the training file is called.
        nudge: Added to the last x of every drive, so that no controls lead there.
    """
    rng = np.random.default_rng(number)
    sets = n_active if n_samples is None else n_samples
    content = {
        "samples": rng.random((sets, 100, 4)) / 2,
        "active_controls": rng.uniform(-1, 1, (n_active, 2, 10)),
        "test_controls": rng.uniform(-1, 1, (n_test, 2, 10)),
    }
    for phase in ("active", "test"):
        states = np.array(
            [
                [references.drive(references.ROBOT_START, row) for row in pair]
                for pair in content[f"{phase}_controls"]
            ]
        )
        phi = np.array([[references.features(path) for path in pair] for pair in states])
        content[f"{phase}_diffs"] = phi[:, 0] - phi[:, 1]
        content[f"{phase}_signs"] = np.where(content[f"{phase}_diffs"] @ _WEIGHTS > 0, 1, -1)
        states[:, :, -1, 0] += nudge
        content[f"{phase}_states"] = states
    _write(folder / training_name.format(number), content, "active", content["samples"])
    _write(folder / f"test{number}.jld2", content, "test", ())
    return content


def _write(path: Path, content: dict[str, np.ndarray], phase: str, samples: object) -> None:
    numbers = itertools.count()
    with h5py.File(path, "w") as file:

        def keep(**values: object) -> h5py.Reference:
            # h5py drops what has no name when it closes a file; Julia doesn't.
            return file.create_dataset(f"kept/{next(numbers)}", **values).ref

        def answer(states: np.ndarray, diff: np.ndarray, sign: int) -> h5py.Reference:
            entry = np.empty((), dtype=_ANSWER)
            entry["x₁"], entry["x₂"] = (keep(data=path) for path in states)
            entry["ψ"], entry["pref"] = keep(data=diff), sign
            return keep(data=entry, dtype=_ANSWER)

        answers = [
            answer(*row)
            for row in zip(
                *(content[f"{phase}_{what}"] for what in ("states", "diffs", "signs")), strict=True
            )
        ]
        lists = {"prefs": answers, "w_hist": [keep(data=values) for values in samples]}
        for name, references_ in lists.items():
            if references_:
                file.create_dataset(name, data=np.array(references_, dtype=object), dtype=h5py.ref_dtype)
