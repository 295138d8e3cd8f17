"""What the project takes from others is pinned by hash, listed for every extra and looked through for vulnerabilities."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

from tests.bill_of_materials import EXTRAS, name_bill

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
CONSTRAINTS = (ROOT / "constraints.txt").read_text(encoding="utf-8")
WORKFLOWS = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / ".github" / "workflows").glob("*.yml")}

PIN = re.compile(r"[a-z0-9-]+==[a-z0-9.]+(?: ; [^\\\n]+)?(?: \\\n    --hash=sha256:[0-9a-f]{64})+")


def name_requirements(lines):
    return {re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", line)[0]).lower() for line in lines if isinstance(line, str)}


def find_unpinned(text):
    """Return the lines of a workflow that use an action without a commit, or without its version in a comment."""
    uses = [line.strip() for line in text.splitlines() if re.match(r"\s*(?:- )?uses:", line)]
    pinned = re.compile(r"(?:- )?uses: [\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+")
    return [line for line in uses if not pinned.fullmatch(line)]


def test_every_constraint_is_a_version_with_hashes_of_its_files():
    entries = re.split(r"\n(?! )", CONSTRAINTS.strip())
    entries = [entry for entry in entries if not entry.startswith("#")]
    assert [entry for entry in entries if not PIN.fullmatch(entry)] == []
    assert len(entries) > 200


@pytest.mark.parametrize(
    "entry", ["numpy==2.4.6", "numpy>=2 \\\n    --hash=sha256:" + 64 * "a", "numpy==2 --hash=md5:a"]
)
def test_a_constraint_without_version_or_hash_is_noticed(entry):
    assert not PIN.fullmatch(entry)


def test_all_extras_and_groups_are_compiled_into_the_constraints():
    asked = [*PROJECT["project"]["dependencies"], *PROJECT["build-system"]["requires"]]
    for lines in (*PROJECT["project"]["optional-dependencies"].values(), *PROJECT["dependency-groups"].values()):
        asked += lines
    assert name_requirements(asked) - set(re.findall(r"^([a-z0-9-]+)==", CONSTRAINTS, re.MULTILINE)) == set()
    groups = re.search(r"addprefix --group ,([a-z ]+)\)", MAKEFILE)[1].split()
    assert {*groups, "dev"} == set(PROJECT["dependency-groups"])


@pytest.mark.parametrize("name", sorted(WORKFLOWS))
def test_every_action_is_pinned_to_a_commit_and_says_its_version(name):
    assert find_unpinned(WORKFLOWS[name]) == []


def test_an_action_at_a_tag_or_without_its_version_is_noticed():
    commit = 40 * "a"
    text = f"  - uses: a/b@v5\n    uses: a/b@{commit}\n    uses: a/b@{commit} # v5\n    uses: a/b@{commit} # v5.1.0\n"
    assert [line.split("@")[1] for line in find_unpinned(text)] == ["v5", commit, f"{commit} # v5"]


def test_an_action_has_one_commit_in_all_workflows():
    uses = {line for text in WORKFLOWS.values() for line in re.findall(r"uses: (\S+)", text)}
    assert len(uses) == len({line.split("@")[0] for line in uses})


def test_each_extra_has_a_bill_of_materials_in_a_release():
    jobs = yaml.safe_load(WORKFLOWS["release"])["jobs"]
    assert jobs["bills"]["strategy"]["matrix"]["extra"] == EXTRAS == sorted(PROJECT["project"]["optional-dependencies"])
    assert "bills" in jobs["publish"]["needs"]
    assert name_bill("mp4") == f"rso_lidar-{PROJECT['project']['version']}-mp4.cdx.json"


def test_vulnerabilities_are_looked_for_daily_and_in_pull_requests_in_all_constraints():
    audit = yaml.safe_load(WORKFLOWS["audit"])
    triggers = audit[True]  # YAML 1.1 reads `on` as true
    assert triggers["schedule"] == [{"cron": "43 5 * * *"}]
    assert {"pyproject.toml", "constraints.txt"} <= set(triggers["pull_request"]["paths"])
    (command,) = (step["run"] for step in audit["jobs"]["audit"]["steps"] if "Audit" in step.get("name", ""))
    assert command.endswith("-r constraints.txt")
    assert command.removeprefix("python ") in MAKEFILE


def test_dependabot_watches_packages_and_actions():
    updates = yaml.safe_load((ROOT / ".github" / "dependabot.yml").read_text(encoding="utf-8"))["updates"]
    assert {(update["package-ecosystem"], update["directory"]) for update in updates} == {
        ("github-actions", "/"),
        ("pip", "/"),
    }
