"""The page Build without a browser: forms and text are one document, and the check follows both."""

import asyncio
import contextlib

import pytest

pytest.importorskip("nicegui", reason="the extra studio is not installed")

from nicegui import ui
from nicegui.elements.upload_files import SmallFileUpload
from nicegui.testing.user_simulation import user_simulation

from rso_lidar.scenario import SHORTEST_EXAMPLE, find_examples
from rso_lidar.studio.application import make_root
from rso_lidar.studio.model.text_assessment import assess, list_warnings
from rso_lidar.studio.state import Workspace
from tests.scene.meshes.test_mesh import BOX, binary_stl

pytestmark = pytest.mark.slow

APPROACH = find_examples()["tdrs_approach"].text
OMM = """OBJECT_NAME = TDRS
NORAD_CAT_ID = 100019548
EPOCH = 2024-09-17T03:12:45.123456
MEAN_MOTION = 1.00271
ECCENTRICITY = 0.0041
INCLINATION = 13.9
RA_OF_ASC_NODE = 345.0
ARG_OF_PERICENTER = 200.0
MEAN_ANOMALY = 160.0
BSTAR = 0
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "bench.toml").write_text("# by hand\n" + SHORTEST_EXAMPLE, encoding="utf-8")
    return tmp_path


def visit(folder, journey):
    """Open the page of a folder as a user, and walk a journey with the workspace."""

    async def walk():
        workspace = Workspace(folder)
        async with user_simulation(root=make_root(workspace)) as user:
            await user.open("/")
            await journey(user, workspace)
        workspace.jobs.close()

    asyncio.run(walk())


async def wait_for(condition):
    """Wait until a condition holds, at most 10 s."""
    for _ in range(200):
        with contextlib.suppress(AssertionError):
            if condition():
                return
        await asyncio.sleep(0.05)
    raise AssertionError("it did not come within 10 s")


def only(user, marker):
    (found,) = user.find(marker).elements
    return found


def test_a_field_changes_the_text_and_keeps_its_comment(folder):
    async def journey(user, workspace):
        await user.should_see("Ready to fly: 10 frames", retries=100)
        user.find("table-time").click()
        field = user.find("field-time.duration_s")
        field.clear()
        field.type("20").trigger("change")
        document = workspace.open_document("bench.toml")
        assert "duration_s = 20" in document.text
        assert document.text.startswith("# by hand")
        await user.should_see("Ready to fly: 20 frames", retries=100)
        assert only(user, "editor").value == document.text

    visit(folder, journey)


def test_a_text_changes_the_form(folder):
    async def journey(user, workspace):
        await user.should_see("Ready to fly", retries=100)
        user.find("table-time").click()
        document = workspace.open_document("bench.toml")
        document.set_text(document.text.replace("frame_rate_hz = 1", "frame_rate_hz = 3"))
        await wait_for(lambda: only(user, "field-time.frame_rate_hz").value == "3")
        assert workspace.open_document("bench.toml").get("time.frame_rate_hz") == 3
        await user.should_see("Ready to fly: 30 frames", retries=100)

    visit(folder, journey)


def test_a_problem_names_its_place_and_leads_there(folder):
    async def journey(user, workspace):
        document = workspace.open_document("bench.toml")
        document.set_text(document.text.replace("duration_s = 10", "duration_s = -1"))
        await user.should_see("time.duration_s", retries=100)
        assert only(user, "go-to-problem").visible
        user.find("go-to-problem").click()
        assert only(user, "field-time.duration_s").value == "-1"
        document.undo()
        await user.should_see("Ready to fly", retries=100)

    visit(folder, journey)


def test_a_wrong_number_stays_in_the_field_and_out_of_the_text(folder):
    async def journey(user, workspace):
        await user.should_see("Ready to fly", retries=100)
        user.find("table-time").click()
        before = workspace.open_document("bench.toml").text
        field = user.find("field-time.duration_s")
        field.clear()
        field.type("ten").trigger("change")
        assert "is not a number" in only(user, "field-time.duration_s").error
        assert workspace.open_document("bench.toml").text == before

    visit(folder, journey)


def test_targets_are_added_and_removed(folder):
    async def journey(user, workspace):
        await user.should_see("Ready to fly", retries=100)
        document = workspace.open_document("bench.toml")
        user.find("add-target").click()
        assert [one["name"] for one in document.tables()["target"]] == ["plate", "target_1"]
        user.find("undo").click()
        assert len(document.tables()["target"]) == 1

    visit(folder, journey)


def test_a_camera_is_added_gets_its_lens_and_bands_and_is_removed(folder):
    async def journey(user, workspace):
        await user.should_see("Ready to fly", retries=100)
        document = workspace.open_document("bench.toml")
        user.find("add-camera").click()
        await user.should_see("camera[0].lens", retries=100)  # the check says what it needs
        user.find("table-camera[0]").click()
        document.set("camera[0].lens", {})
        for key, value in (("fov_deg", "20"), ("f_number", "4"), ("n_rows", "64"), ("n_cols", "64")):
            await user.should_see(marker=f"field-camera[0].lens.{key}", retries=100)
            user.find(f"field-camera[0].lens.{key}").type(value).trigger("change")
        user.find("choose-camera[0].bands").click()
        for name in ("grey", "nir", "rgb"):  # all are names that a camera takes
            await user.should_see(marker=f"bands-{name}", retries=100)
            user.find(f"bands-{name}").click()
            assert document.get("camera[0].bands") == name
            await user.should_see("Ready to fly", retries=100)
            user.find("choose-camera[0].bands").click()
        user.find("add-camera[0].bands").click()  # one of the user's own, in place of the name
        assert [band["name"] for band in document.get("camera[0].bands")] == ["bands_1"]
        user.find("remove").click()
        assert "camera" not in document.tables()
        await user.should_see("Ready to fly", retries=100)

    visit(folder, journey)


def test_a_text_that_is_not_toml_keeps_the_page(folder):
    async def journey(user, workspace):
        await user.should_see("Ready to fly", retries=100)
        document = workspace.open_document("bench.toml")
        document.set_text(document.text + "\n[broken\n")
        await user.should_see("not valid TOML", retries=100)
        assert not document.is_toml
        document.undo()
        await user.should_see("Ready to fly", retries=100)

    visit(folder, journey)


def test_a_pasted_message_becomes_the_motion(folder):
    async def journey(user, workspace):
        await user.should_see("Ready to fly: 10 frames", retries=100)
        document = workspace.open_document("bench.toml")
        document.set_text(APPROACH)
        await user.should_see("Ready to fly: 540 frames", retries=100)
        user.find("table-target[0]").click()
        user.find("Element sets").click()
        user.find("Paste two lines, or an OMM").type(OMM)
        user.find("Take this set").click()
        await wait_for(lambda: document.get("target[0].motion.type") == "omm")
        assert document.get("target[0].motion.norad_id") == 100019548
        await user.should_see("Ready to fly: 540 frames", retries=100)

    visit(folder, journey)


def test_a_mesh_in_millimetres_is_warned_of_beside_the_verdict_and_gets_its_scale(folder):
    (folder / "probe.stl").write_bytes(binary_stl(BOX * 1000.0))
    (folder / "bench.toml").write_text(
        SHORTEST_EXAMPLE.replace('model = "plate"', 'model = "probe.stl"'), encoding="utf-8"
    )

    async def journey(user, workspace):
        await user.should_see("Ready to fly: 10 frames, 4 warnings", retries=300)
        await user.should_see("probe.stl is 3000 m across; it may be in millimetres")
        document = workspace.open_document("bench.toml")
        made = assess(document.text, workspace.folder, "bench.toml")
        (warnings,) = user.find(marker="warnings").elements
        shown = [label.text for label in warnings.default_slot.children]
        assert shown == list_warnings(made, workspace.folder, "bench.toml")
        user.find("table-target[0]").click()
        user.find("choose-target[0].scale").click()
        await user.should_see("1 × 2 × 3 m (likely)", retries=100)
        user.find("unit-millimetres").click()
        assert (document.get("target[0].model"), document.get("target[0].scale")) == ("probe.stl", 0.001)
        await user.should_see("Ready to fly: 10 frames, 1 warning", retries=300)
        await user.should_not_see("m across")

    visit(folder, journey)


def test_an_uploaded_mesh_shows_its_size_and_its_unit_is_chosen(folder):
    async def journey(user, workspace):
        await user.should_see("Ready to fly", retries=100)
        document = workspace.open_document("bench.toml")
        document.set("target[0].size_m", 7.0)
        user.find("upload").click()
        (upload,) = user.find(kind=ui.upload).elements
        await upload.handle_uploads([SmallFileUpload("part.stl", "model/stl", binary_stl(BOX * 50.0))])
        await user.should_see("12 facets, 1 part, 50 × 100 × 150 m as it stands", retries=100)
        await user.should_see("1.27 × 2.54 × 3.81 m", retries=100)
        user.find("unit-inches").click()
        target = document.tables()["target"][0]
        assert (target["model"], target["scale"], "size_m" in target) == ("part.stl", 0.0254, False)

    visit(folder, journey)
