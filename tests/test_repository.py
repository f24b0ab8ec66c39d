"""The repository keeps its promises: commands exist, versions are pinned, nothing leaks in."""

import itertools
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
CONTRACT_TARGETS = {"run", "test", "check", "check-slow", "bench", "clean", "help"}
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text())


def files_of_the_repository():
    """What is committed or about to be."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def normalised(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def named_requirements():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    requirements = [*project["dependencies"], *itertools.chain(*project["optional-dependencies"].values())]
    return {normalised(re.match(r"[\w.-]+", requirement).group()) for requirement in requirements}


def pins():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def prefstudy_calls():
    """Every call of the command line that the Makefile, the Dockerfile or the compose file makes."""
    makefile = (ROOT / "Makefile").read_text()
    calls = [match.split() for match in re.findall(r"^\t\$\(BIN\)/prefstudy (.+)$", makefile, re.MULTILINE)]
    dockerfile = re.search(r"^CMD (\[.+\])$", (ROOT / "Dockerfile").read_text(), re.MULTILINE).group(1)
    return [*calls, COMPOSE["services"]["app"]["command"][1:], yaml.safe_load(dockerfile)[1:]]


@pytest.mark.parametrize("call", prefstudy_calls(), ids=" ".join)
def test_a_command_that_the_repository_calls_exists_with_its_options(call):
    command = list(itertools.takewhile(lambda word: not word.startswith("-"), call))
    shown = subprocess.run(
        [sys.executable, "-c", "from app.cli import main; main()", *command, "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        env={"COLUMNS": "200", "TERM": "dumb", "NO_COLOR": "1", "PATH": ""},
        check=False,
    )
    assert shown.returncode == 0, shown.stderr
    missing = [
        word for word in call if word.startswith("--") and not re.search(rf"{word}(?![\w-])", shown.stdout)
    ]
    assert not missing


def test_the_compose_file_needs_a_public_address_and_keeps_its_database_on_a_volume():
    app = COMPOSE["services"]["app"]
    assert app["environment"]["PREFSTUDY_PUBLIC_URL"].startswith("${PREFSTUDY_PUBLIC_URL:?")
    folder = Path(app["environment"]["PREFSTUDY_DATABASE"].removeprefix("sqlite:///")).parent
    assert [volume.split(":") for volume in app["volumes"]] == [["data", str(folder)]]
    assert "data" in COMPOSE["volumes"]


def test_every_version_is_pinned_exactly_and_no_pin_names_a_local_build():
    assert [pin for pin in pins() if not re.fullmatch(r"[\w.-]+==[\w.]+", pin)] == []


def test_every_dependency_has_a_pin():
    pinned = {normalised(pin.split("==")[0]) for pin in pins()}
    assert named_requirements() - pinned == set()


def test_no_pin_brings_a_gpu_build():
    assert [pin for pin in pins() if re.match(r"nvidia|cuda|triton", pin)] == []


def test_the_makefile_has_the_targets_of_the_contract():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert targets >= CONTRACT_TARGETS


def test_the_help_of_make_names_every_target_of_the_contract():
    shown = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert {line.split()[0] for line in shown.splitlines()} >= CONTRACT_TARGETS


def test_no_module_is_named_after_nothing():
    nothing = {"utils.py", "util.py", "helpers.py", "helper.py", "common.py", "misc.py"}
    assert [path for path in files_of_the_repository() if path.name in nothing] == []


def test_no_file_names_a_place_outside_the_repository():
    # Put together here, so that this file doesn't name them either.
    places = ["shared" + "/design", "/work" + "/main", "/work" + "/shared", "/opt" + "/wheels", "/root" + "/"]
    named = [
        (path.name, place)
        for path in files_of_the_repository()
        for place in places
        if place.encode() in path.read_bytes()
    ]
    assert named == []


def test_the_scripts_are_sound_bash():
    subprocess.run(["bash", "-n", ".ci/run"], cwd=ROOT, check=True)
    assert (ROOT / ".ci/run").stat().st_mode & 0o111
