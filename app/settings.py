"""Where things are, and which study is meant."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from study_core.errors import StudyError
from study_core.study import Study, read_study

ROOT = Path(__file__).resolve().parent.parent
STATIC = ROOT / "static"
STUDIES = STATIC / "studies"

DEFAULT_DATABASE = "sqlite:///prefstudy.db"
DEFAULT_STUDY = "quickstart"


def find_study(name_or_path: str) -> Study:
    """Returns the study of a file, or one that ships under that name.

    Raises:
        StudyError: There is neither, or the file is not a study.
    """
    path = Path(name_or_path)
    if not path.exists() and path.suffix == "" and path.name == name_or_path:
        shipped = sorted(file.stem for file in STUDIES.glob("*.toml"))
        if name_or_path not in shipped:
            raise StudyError(
                f"No study file '{name_or_path}', and none ships under that name. "
                f"Give a path, or one of: {', '.join(shipped)}."
            )
        path = STUDIES / f"{name_or_path}.toml"
    return read_study(path, library=STATIC)


def with_method(study: Study, method: str) -> Study:
    """Returns a study whose pairs another method chooses, all else being equal."""
    section = study.file.acquisition.model_copy(update={"method": method})
    return replace(study, file=study.file.model_copy(update={"acquisition": section}))
