import pytest

from rso_lidar.errors import RecordingError
from rso_lidar.picture import animate, contact_sheet, save_figure, save_frame
from rso_lidar.picture.style.figures import new_figure, use_minus_sign


def test_a_bad_path_is_told_before_anything_is_drawn(tmp_path):
    def frames():
        raise AssertionError("looked at")
        yield

    def one_line(match):
        return pytest.raises(RecordingError, match=match)

    with one_line(r"a\.jpg: unknown suffix '.jpg' \(known: \.png, \.pdf, \.svg\)$"):
        save_frame(None, tmp_path / "a.jpg")
    with one_line(r"unknown suffix '.pnng'; did you mean '.png'\? \(known: \.png\)$"):
        contact_sheet(frames(), tmp_path / "a.pnng")
    with one_line(r"the name has no suffix \(known: \.gif, \.mp4\)"):
        animate(frames(), tmp_path / "a")
    with one_line("there is no folder .*nowhere; create it first"):
        contact_sheet(frames(), tmp_path / "nowhere" / "a.png")
    (tmp_path / "b.png").mkdir()
    with one_line("is a folder"):
        contact_sheet(frames(), tmp_path / "b.png")


@pytest.mark.parametrize(
    ("suffix", "head"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml"), (".PNG", b"\x89PNG")]
)
def test_figures_are_written_by_suffix(tmp_path, suffix, head):
    place = save_figure(new_figure(2, 2, "title", "note", ("foot",)), tmp_path / f"a{suffix}")
    assert place.read_bytes().startswith(head)


def test_a_pdf_says_nothing_of_the_clock(tmp_path):
    one, two = (save_figure(new_figure(2, 2, "t"), tmp_path / name).read_bytes() for name in ("a.pdf", "b.pdf"))
    assert one == two
    assert b"CreationDate" not in one


def test_numbers_get_a_true_minus():
    assert use_minus_sign("-3.0") == "−3.0"
