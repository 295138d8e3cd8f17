"""The paper has what the Journal of Open Source Software asks of its form: metadata, sections, length, references."""

import datetime
import re
from pathlib import Path

PAPER = Path(__file__).resolve().parents[2] / "paper"
HEAD, TEXT = (PAPER / "paper.md").read_text(encoding="utf-8").split("---\n", 2)[1:]
BIBLIOGRAPHY = (PAPER / "paper.bib").read_text(encoding="utf-8")
FIGURE = re.compile(r"!\[(.*?)\]\(([^)]+)\)(?:\{[^}]*\})?", re.DOTALL)


def test_metadata_is_complete():
    keys = re.findall(r"^(\w+):", HEAD, re.MULTILINE)
    assert keys == ["title", "tags", "authors", "affiliations", "date", "bibliography"]
    date = re.search(r"^date: (.*)$", HEAD, re.MULTILINE)[1]
    assert datetime.datetime.strptime(date, "%d %B %Y").year >= 2026
    assert (PAPER / re.search(r"^bibliography: (.*)$", HEAD, re.MULTILINE)[1]).is_file()
    assert set(re.findall(r"affiliation: (\d+)", HEAD)) == set(re.findall(r"index: (\d+)", HEAD))


def test_sections_are_those_of_the_journal():
    sections = re.findall(r"^# (.*)$", TEXT, re.MULTILINE)
    asked = ["Summary", "Statement of need", "State of the field", "Software design", "Research impact statement"]
    assert [section for section in sections if section in asked] == asked
    assert sections[-2:] == ["Acknowledgements", "References"]


def test_length_is_within_bounds():
    words = FIGURE.sub("", TEXT).split()
    assert 750 <= len(words) <= 1750


def test_every_reference_is_cited_and_every_citation_is_resolved():
    cited = set(re.findall(r"(?<!\w)@(\w+)", TEXT))
    assert cited
    assert cited == set(re.findall(r"^@\w+\{(\w+),$", BIBLIOGRAPHY, re.MULTILINE))


def test_figures_exist_and_are_referred_to():
    figures = FIGURE.findall(TEXT)
    assert figures
    labels = [re.search(r"\\label\{(.+?)\}", caption)[1] for caption, _ in figures]
    assert [label for label in labels if f"\\autoref{{{label}}}" not in TEXT] == []
    assert [file for _, file in figures if not (PAPER / file).is_file()] == []
