"""Licence, creators and web address: checked, and kept."""

import pytest

from rso_lidar.dataset.publication.attribution import CROISSANT, Attribution, read_attribution
from rso_lidar.dataset.publication.croissant import write_croissant
from rso_lidar.errors import DatasetError


def test_what_was_stated_is_read_again(data):
    stated = Attribution(licence="CC-BY-4.0", creators=("A. Person", "The Zoë group"), url="https://example.org/a")
    write_croissant(data, stated)
    assert read_attribution(data.folder) == stated


@pytest.mark.parametrize(
    "content", [None, "", "[]", "{", '{"license": 3}', '{"creator": [1]}', '{"license": "https://x/"}']
)
def test_without_a_readable_file_nothing_is_stated(tmp_path, content):
    if content is not None:
        (tmp_path / CROISSANT).write_text(content, encoding="utf-8")
    assert read_attribution(tmp_path) == Attribution()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"licence": "free for all"}, "licence 'free for all': is no SPDX identifier; write for example CC-BY-4.0"),
        ({"url": "example.org"}, "url 'example.org': is no web address"),
        ({"creators": ("A\nB",)}, "creator: an empty name, or one with control characters"),
        ({"creators": (" ",)}, "creator: an empty name"),
    ],
)
def test_bad_statements_are_refused(fields, message):
    with pytest.raises(DatasetError, match=message):
        Attribution(**fields)
