"""Reader of the published study's data (Katz et al. 2021): JLD2 files, which are HDF5.

Each person has two files. `trainN.jld2` holds their answers to the active queries and the posterior samples after
each; `testN.jld2` holds their answers to the common test queries. Any subset of the people may be there.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from jaxtyping import Float

from study_core.comparison import ComparisonSet
from study_core.errors import PublishedDataError

# One person's training file was published without the dot of its ending.
_TRAINING_FILE = re.compile(r"train(\d+)\.?jld2")

# One stored answer: both drives, the difference of their features, and which was preferred.
_FIELDS = ("x₁", "x₂", "ψ", "pref")

_Content = TypeVar("_Content")
_Answers = tuple[ComparisonSet, Float[np.ndarray, "n_answers 2 50 4"]]


@dataclass(frozen=True)
class PublishedPerson:
    """One person of the published study.

    Attributes:
        number: As in the paper's data, from 1. The paper's chart swaps persons 8 and 9.
        training: Answers to the active queries, in order; psi as stored, Phi(first) - Phi(second), and +1 where the
            first drive was preferred.
        test: Answers to the common test queries.
        training_states: [x, y, theta, v] of both drives of each active query, shape `(n_answers, 2, 50, 4)`.
        test_states: The same of each test query.
        posterior_samples: Samples of w as the study drew them, oldest first, each `(100, 4)`; the last query was
            chosen from the last, which therefore doesn't know its answer. Some people have one more entry than
            queries, in front: the prior twice.
    """

    number: int
    training: ComparisonSet
    test: ComparisonSet
    training_states: Float[np.ndarray, "n_training 2 50 4"]
    test_states: Float[np.ndarray, "n_test 2 50 4"]
    posterior_samples: tuple[Float[np.ndarray, "100 4"], ...]


def read_study(directory: Path) -> dict[int, PublishedPerson]:
    """Returns every person in a folder, by number.

    Raises:
        PublishedDataError: The folder holds no training file, or one of its files can't be read.
    """
    return {number: read_person(*files) for number, files in find_files(directory).items()}


def find_files(directory: Path) -> dict[int, tuple[Path, Path]]:
    """Returns the training file and the test file of every person in a folder, by number; they may turn out missing.

    Raises:
        PublishedDataError: The folder holds no training file.
    """
    if not directory.is_dir():
        raise PublishedDataError(f"Expected the folder of the published data at {directory}; there is none.")
    matches = ((_TRAINING_FILE.fullmatch(path.name), path) for path in directory.iterdir())
    training_files = sorted((int(match[1]), path) for match, path in matches if match)
    if not training_files:
        raise PublishedDataError(
            f"Expected files such as train1.jld2 in {directory}; found none. Unpack the published data there."
        )
    return {number: (path, directory / f"test{number}.jld2") for number, path in training_files}


def read_person(train_path: Path, test_path: Path) -> PublishedPerson:
    """Returns one person.

    Args:
        train_path: Their file of active queries, `trainN.jld2`, whose name says the number.
        test_path: Their file of test queries.

    Raises:
        PublishedDataError: A file is missing, damaged, or not one of the published study.
    """
    match = _TRAINING_FILE.fullmatch(train_path.name)
    if match is None:
        raise PublishedDataError(
            f"Expected a training file named like train1.jld2, got {train_path.name}. Rename it."
        )
    training, training_states = _read(train_path, _answers)
    test, test_states = _read(test_path, _answers)
    return PublishedPerson(
        number=int(match[1]),
        training=training,
        test=test,
        training_states=training_states,
        test_states=test_states,
        posterior_samples=_read(train_path, _posterior_samples),
    )


def _read(path: Path, content_of: Callable[[h5py.File], _Content]) -> _Content:
    """Returns what a function finds in a file; whatever makes that fail is one error with one line."""
    try:
        with h5py.File(path, "r") as file:
            return content_of(file)
    except (OSError, KeyError, IndexError, TypeError, ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise PublishedDataError(
            f"Can't read {path} as a file of the published study: {reason}. Fetch it again."
        ) from error


def _answers(file: h5py.File) -> _Answers:
    """Returns the answers and both drives of each. Attributes are left alone: h5py can't read JLD2's."""
    records = [file[reference][()] for reference in _references(file, "prefs")]
    if any(set(record.dtype.names or ()) != set(_FIELDS) for record in records):
        raise ValueError(f"expected answers with the fields {', '.join(_FIELDS)}")
    feature_diffs = np.array([_array(file, record["ψ"], (4,)) for record in records])
    states = np.array(
        [[_array(file, record[drive], (50, 4)) for drive in ("x₁", "x₂")] for record in records]
    )
    signs = np.array([float(record["pref"]) for record in records])
    if not np.isin(signs, (-1.0, 1.0)).all():
        raise ValueError("expected every `pref` to be 1 or -1")
    return ComparisonSet(feature_diffs, signs), states


def _posterior_samples(file: h5py.File) -> tuple[Float[np.ndarray, "100 4"], ...]:
    """Returns the samples of every update. HDF5 reports Julia's arrays with their axes as stored: (sample, weight)."""
    return tuple(_array(file, reference, (100, 4)) for reference in _references(file, "w_hist"))


def _references(file: h5py.File, name: str) -> list[h5py.Reference]:
    """Returns what a list of the file refers to."""
    if name not in file or not isinstance(file[name], h5py.Dataset):
        raise ValueError(f"expected a dataset `{name}`")
    references: list[h5py.Reference] = list(file[name][()])
    if not references:
        raise ValueError(f"expected at least one entry in `{name}`")
    return references


def _array(file: h5py.File, reference: Any, shape: tuple[int, ...]) -> Float[np.ndarray, "..."]:
    values = np.asarray(file[reference][()], dtype=np.float64)
    if values.shape != shape or not np.isfinite(values).all():
        raise ValueError(f"expected finite numbers of shape {shape}, got shape {values.shape}")
    return values
