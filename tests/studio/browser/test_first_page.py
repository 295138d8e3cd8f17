"""The page as a browser shows it: no error, no request to another host, and text from files as text."""

import re
from urllib.parse import urlsplit


def test_the_page_opens_and_the_address_shows_no_token(journey):
    page = journey()
    assert page.title() == "rso_lidar studio"
    assert urlsplit(page.url).query in ("", "file=unsaved.toml")  # the document that a reload shows
    assert re.search(r"studio", page.inner_text("header"))
