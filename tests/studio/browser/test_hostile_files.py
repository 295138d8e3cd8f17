"""Files that are not meant well, in a real browser: their names and titles are shown as text, and nothing of them runs."""

import os

import pytest

import rso_lidar as rl

SCRIPT = "<img src=x onerror=alert(1)>"


@pytest.mark.skipif(os.name != "posix", reason="Windows has no such file names")
def test_names_and_titles_are_text(journey, text, tmp_path):
    hostile = text.replace("a plate on a bench", f"{SCRIPT}</script><script>alert(2)</script>")
    hostile = hostile.replace("[1000, 0, 0]", "[200, 0, 0]") + '\n[lidar.detector]\ntype = "empirical"\n'
    (tmp_path / f"0{SCRIPT}.toml").write_text(hostile, encoding="utf-8")
    rl.save(tmp_path / f"1{SCRIPT}.h5", rl.simulate(rl.Scenario.loads(hostile), frames=[0, 1]))
    page = journey()
    for name in ("Build", "See", "Run", "Build"):
        page.get_by_role("tab", name=name, exact=True).click()
        page.wait_for_timeout(3000)
        assert page.locator('img[src="x"]').count() == 0
        assert page.locator("[onerror]").count() == 0
    assert SCRIPT in page.content().replace("&lt;", "<").replace("&gt;", ">")


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe not a text",
        b"\0" * 1000,
        b"version = 1\n" + b"# a comment\n" * 700_000,  # 8 MB
        b"a = " + b"[" * 50_000 + b"]" * 50_000,
        b"a." * 20_000 + b"b = 1\n",
        b"[[target]]\n" * 20_000,
        b"x = 1" + b"0" * 100_000 + b"\n",
        'name = "\u202e\u0007\U0001f600"\n'.encode(),
    ],
    ids=["no_utf8", "zeros", "large", "nested", "dotted", "many", "digits", "odd_letters"],
)
def test_broken_files_leave_the_studio_usable(journey, text, tmp_path, content):
    (tmp_path / "a.toml").write_bytes(content)
    (tmp_path / "b.toml").write_text(text, encoding="utf-8")
    page = journey()
    page.get_by_role("tab", name="Run", exact=True).click()
    page.get_by_role("tab", name="Build", exact=True).click()
    page.wait_for_timeout(1500)
    assert page.evaluate("window.socket.connected")
    assert page.get_by_role("tab", name="See", exact=True).is_visible()
