"""The type of the processor: short, the same in every process of one machine, and in what is computed."""

import platform
import subprocess
import sys

from app.continuation import continue_session
from app.machine import machine
from app.services.continuation import Request
from app.settings import find_study
from study_core.comparison import ComparisonSet
from study_core.plan import plan_of


def test_every_process_of_one_machine_says_the_same():
    done = subprocess.run(
        [sys.executable, "-c", "from app.machine import machine; print(machine())"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == machine()
    assert machine().startswith(platform.machine())
    assert 20 < len(machine()) < 400


def test_a_computed_query_says_what_it_was_computed_on():
    study = find_study("quickstart")
    first = plan_of(study, 1).index_of_active(0)
    nothing = ComparisonSet.empty(len(study.domain.feature_names))
    done = continue_session(Request(study.text, 1, first, nothing, True, None))
    assert done.prepared.machine == machine()
