"""Materials of single facets from a file: what is lit as what, and one line for each mistake."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.scenario.finishes import finished
from tests.optics.bench_for_tests import box, surface

SAT = surface("sat", box(1.0, 2.0, 3.0), rl.Lambertian(reflectance=0.5))
WHITE = {"1": rl.Lambertian(reflectance=0.9)}


def painted(tmp_path, name, content, materials=None):
    path = tmp_path / name
    if isinstance(content, str):
        path.write_text(content)
    else:
        np.save(path, content)
    said = rl.FacetMaterials(file=name, materials=materials or {})
    return finished(SAT, said, lambda file: tmp_path / file, 1064e-9)


def test_a_table_names_facets_and_spans(tmp_path):
    sat = painted(tmp_path, "labels.csv", "facet,material\n0,mine\n4-6,regolith_mare\n", {"mine": "regolith_highland"})
    expected = np.full(12, 0.5)
    expected[0], expected[4:7] = 0.35, 0.20
    assert sat.matt_per_sr * np.pi == pytest.approx(expected)
    assert np.array_equal(sat.part, SAT.part)  # labels stay


def test_an_array_holds_a_number_for_each_facet(tmp_path):
    numbers = np.full(12, -1)
    numbers[[3, 11]] = 1
    sat = painted(tmp_path, "labels.npy", numbers, WHITE)
    assert np.flatnonzero(sat.matt_per_sr * np.pi > 0.8).tolist() == [3, 11]


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.csv", "0,gold\n", r"a.csv: no material 'gold'.* say what it is in facet_materials.materials"),
        ("a.csv", "12,osr\n", r"line 1: no facets 12 in a mesh of 12; number them from 0"),
        ("a.csv", "facet,material\n7-3,osr\n", r"line 2: no facets 7-3"),
        ("a.csv", "one,osr\n", r"line 1: needs a facet, or a span"),
        ("a.csv", "1\n", r"line 1: needs a facet, or a span"),
        ("a.csv", "1-,osr\n", r"line 1: needs a facet, or a span"),
        ("a.txt", "1,osr\n", r"'.txt' is not read"),
        ("a.npy", np.zeros(11, dtype=int), r"holds int64 \(11,\); give one integer for each of the 12 facets"),
        ("a.npy", np.zeros(12), r"holds float64"),
        ("b.npy", "no array", None),
    ],
)
def test_mistakes_are_one_line(tmp_path, name, content, told):
    with pytest.raises((rl.ScenarioError, rl.MeshError), match=told) as caught:
        painted(tmp_path, name, content)
    assert str(caught.value).startswith("facet_materials: ")
    assert "\n" not in str(caught.value)
