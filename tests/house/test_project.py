"""What is said twice about the project is said alike, and the network is shut while tests run."""

import json
import re
import runpy
import socket
import tomllib
from importlib.metadata import requires, version
from pathlib import Path

import pytest

from tests.processor import LEFT_OUT, REPEATED

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def names(requirements):
    return {re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", line)[0]).lower() for line in requirements}


def test_citation_names_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    said = dict(re.findall(r"^(version|license|abstract): \"?(.*?)\"?$", text, re.MULTILINE))
    project = PROJECT["project"]
    assert said == {"version": project["version"], "license": project["license"], "abstract": project["description"]}


def test_address_of_the_repository_is_the_same_everywhere():
    urls = PROJECT["project"]["urls"]
    assert all(url.startswith(urls["Source"]) for url in urls.values())
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r'^repository-code: "(.*)"$', text, re.MULTILINE)[1] == urls["Source"]
    text = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    assert re.search(r"^  repository: (.*)$", text, re.MULTILINE)[1] == urls["Source"]


def test_recipe_needs_what_the_package_needs():
    text = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    assert re.search(r'^  version: "(.*)"$', text, re.MULTILINE)[1] == PROJECT["project"]["version"]
    run = re.search(r"^  run:\n((?:    - .*\n)+)", text, re.MULTILINE)[1]
    wanted = {re.sub(r" +#.*", "", line).replace(" ", "") for line in re.findall(r"^    - (.*)$", run, re.MULTILINE)}
    wanted = {re.sub(r"^matplotlib-base", "matplotlib", line) for line in wanted if not line.startswith("python>=")}
    assert wanted == set(PROJECT["project"]["dependencies"])


def test_installation_page_lists_every_extra():
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == sorted(PROJECT["project"]["optional-dependencies"])


def test_archive_and_citation_agree_with_the_project():
    archive = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    project = PROJECT["project"]
    assert archive["title"].startswith(f"rso_lidar: {project['description'][:20]}")
    assert archive["keywords"] == project["keywords"]
    assert archive["license"] == project["license"]
    assert [creator["name"] for creator in archive["creators"]] == [author["name"] for author in project["authors"]]
    assert "version" not in archive  # that of the release


def test_long_description_has_absolute_links_and_leaves_code_alone():
    made = runpy.run_path(str(ROOT / "hatch_build.py"))["make_links_absolute"]
    text = (
        "[a](docs/x.md#y) ![p](p.png) [b](https://example.org) [c](#d) [![i](i.png)](e.md)\n```python\nf[0](x)\n```\n"
    )
    assert made(text, "https://h/r", "1.2") == (
        "[a](https://h/r/blob/v1.2/docs/x.md#y) ![p](https://h/r/raw/v1.2/p.png) [b](https://example.org) [c](#d) "
        "[![i](https://h/r/raw/v1.2/i.png)](https://h/r/blob/v1.2/e.md)\n```python\nf[0](x)\n```\n"
    )


def test_installed_version_is_this_one():
    assert version("rso-lidar") == PROJECT["project"]["version"], "install again: make venv"


def test_constraints_hold_for_all_that_is_installed():
    """Every dependency, and every dependency of one, is pinned."""
    pinned = set(re.findall(r"^([\w-]+)==", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.MULTILINE))
    groups = PROJECT["dependency-groups"]
    grouped = [
        line for line in groups["test"] + groups["site"] if isinstance(line, str)
    ]  # the first includes the other
    waiting = names(PROJECT["project"]["dependencies"] + grouped)
    needed = set()
    while waiting:
        name = waiting.pop()
        needed.add(name)
        unconditional = [line for line in requires(name) or [] if ";" not in line]
        waiting |= names(unconditional) - needed
    assert needed <= pinned


def test_make_describes_every_target():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    phony = set(re.search(r"^\.PHONY: (.*)$", text, re.MULTILINE)[1].split())
    described = set(re.findall(r"^([a-z-]+):.*## .+$", text, re.MULTILINE))
    assert phony == described


def test_no_test_is_lost_between_make_test_and_make_check():
    """`make check` runs what `make test` leaves out, and a run of CI is `make check`."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    rules = dict(re.findall(r"^([a-z-]+): ([^\n]*\n(?:\t.*\n)+)", text, re.MULTILINE))
    assert '$(PYTEST) -m "not slow"\n' in rules["test"]
    assert rules["check"].startswith("test ") and "\t$(PYTEST) -m slow\n" in rules["check"]
    assert (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()[-1] == "exec make check"


def test_every_folder_of_tests_that_compares_numbers_is_repeated_on_another_processor_or_left_out_for_a_reason():
    compares = re.compile(r"\bapprox\(|\bassert_allclose\(|\b(?:np|math)\.(?:all|is)close\(")
    folders = {
        path.relative_to(ROOT / "tests").parts[0]
        for path in (ROOT / "tests").glob("*/**/*.py")
        if compares.search(path.read_text(encoding="utf-8"))
    }
    assert folders <= {*REPEATED, *LEFT_OUT} and not set(REPEATED) & set(LEFT_OUT)
    assert all((ROOT / "tests" / name).is_dir() for name in (*REPEATED, *LEFT_OUT))


def test_no_connection_leaves_the_machine():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as plug, pytest.raises(RuntimeError, match="no network"):
        plug.connect(("192.0.2.1", 80))
    with pytest.raises(RuntimeError, match="no network"):
        socket.create_connection(("example.org", 80))


def test_connections_inside_the_machine_go_through(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a socket's path may be no longer than about 100 characters
    with socket.socket(socket.AF_UNIX) as server, socket.socket(socket.AF_UNIX) as client:
        server.bind("door")
        server.listen()
        client.connect("door")
        assert client.getpeername() == "door"
