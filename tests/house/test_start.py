"""What starting costs: a bare import loads what every use needs, and what checks a part is made when first asked for."""

import json
import subprocess
import sys

# Of scipy a pose needs spatial.transform, which brings half of scipy along; nothing at all is needed to import the package.
LATER = [
    "PIL",
    "embreex",
    "h5py",
    "imageio_ffmpeg",
    "matplotlib",
    "multiprocessing",
    "numba",
    "rich",
    "scipy",
    "sgp4",
    "skyfield",
    "tomli_w",
    "trimesh",
    "typer",
]


def said(code):
    """Return what a fresh interpreter prints, read as JSON."""
    run = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def loaded(statement):
    """Return which of the libraries above a statement loads in a fresh interpreter."""
    return said(f"{statement}\nimport json, sys; print(json.dumps([name for name in {LATER} if name in sys.modules]))")


def test_what_the_package_exports_loads_none_of_them():
    assert loaded("import rso_lidar as rl; [getattr(rl, name) for name in rl.__all__]") == []


def test_the_list_of_commands_loads_what_draws_it_and_no_more():
    assert loaded("import rso_lidar.cli.app") == ["typer"]


def test_what_is_loaded_is_seen():
    there = [name for name in LATER if name != "imageio_ffmpeg"]  # an extra
    assert loaded("import " + ", ".join(there)) == there


def rooms_loaded(statement):
    """Return the modules of the package that a statement loads in a fresh interpreter, and the rooms that they lie in."""
    names = said(
        f"{statement}\nimport json, sys; print(json.dumps([it for it in sys.modules if it[:9] == 'rso_lidar']))"
    )
    return names, {name.split(".")[1] for name in names if name.count(".") > 1}


def test_a_bare_import_loads_no_room():
    names, rooms = rooms_loaded("import rso_lidar")
    assert len(names) < 6 and rooms == set()


def test_a_first_use_loads_the_rooms_that_it_needs():
    assert rooms_loaded("import rso_lidar as rl; rl.open")[1] == {"export", "files", "part", "records"}
    assert rooms_loaded("import rso_lidar as rl; rl.orbit.propagate_sgp4")[1] <= {"orbit", "files", "part", "records"}
    assert "orbit" not in rooms_loaded("import rso_lidar as rl; rl.Laser, rl.scene.Mesh")[1]


def test_a_scenario_builds_few_parts_before_it_is_used():
    """The checks of a part take a millisecond or so to build: only those that are defaults of others are built early."""
    built, parts = said(
        "import json, rso_lidar; rso_lidar.Scenario; from rso_lidar.part import Part\n"
        "def below(cls): return {cls}.union(*map(below, cls.__subclasses__()))\n"
        "parts = below(Part); print(json.dumps([sum(p.__pydantic_complete__ for p in parts), len(parts)]))"
    )
    assert parts > 100
    assert built < parts / 4


def test_a_part_first_asked_for_in_many_threads_is_checked_in_each():
    """A part that is not built yet must not be taken for its base, which has no fields, as pydantic 2.11 did."""
    wrong = said(
        "import json, sys, threading, rso_lidar as rl\n"
        "sys.setswitchinterval(1e-6)\n"
        "asked = [(rl.Receiver, 'fov_deg', 2.5), (rl.Spin, 'rate_deg_s', 0.5), (rl.Kepler, 'raan_deg', 1.0),\n"
        "         (rl.Tumble, 'inertia_kg_m2', (1.0, 2.0, 3.0)), (rl.Gsfl, 'max_returns', 2),\n"
        "         (rl.Hill, 'curvilinear', True)]\n"
        "wrong, ready = [], threading.Barrier(8)\n"
        "def ask():\n"
        "    for part, key, value in asked:\n"
        "        ready.wait()\n"
        "        try: part(**{key: value})\n"
        "        except rl.ScenarioError as error:\n"
        "            if key in str(error): wrong.append(str(error))  # the key is known: others may be missing\n"
        "        except Exception as error: wrong.append(repr(error))\n"
        "        try: part(nonsense=1); wrong.append(f'{part}: took it')\n"
        "        except rl.ScenarioError: pass\n"
        "        except Exception as error: wrong.append(repr(error))\n"
        "threads = [threading.Thread(target=ask) for _ in range(8)]\n"
        "for thread in threads: thread.start()\n"
        "for thread in threads: thread.join()\n"
        "print(json.dumps(wrong))"
    )
    assert wrong == []
