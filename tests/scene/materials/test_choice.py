"""Materials of the catalogue by wavelength."""

import numpy as np
import pytest

from rso_lidar.scene import Named, Phong, find_material, load_materials


@pytest.mark.parametrize("name", ["mli_gold", "mli_gold_crinkled", "ablator", "cube_corner", "lambertian_30"])
def test_lasers_at_1064_and_1570_nm_get_the_entries_to_the_bit(name):
    """Also where the wavelength in metres is rounded, and up to the geometric mean of the two."""
    entry = load_materials()[name]
    for wavelength_m, fields in (
        *((light_m, entry) for light_m in (1064e-9, 1064.0 * 1e-9, 1064.0 / 1e9, 1.28e-6)),
        *((light_m, entry | entry["at_1570_nm"]) for light_m in (1.30e-6, 1570e-9)),
    ):
        material = find_material(name, wavelength_m)
        for key in ("reflectance", "diffuse", "specular", "exponent"):
            assert getattr(material, key, None) == fields.get(key), (name, wavelength_m, key)


def test_below_1064_nm_the_total_is_linear_between_its_wavelengths_and_the_lobe_stays():
    entry = load_materials()["mli_gold"]
    below = entry["below_1064_nm"]

    def total(light_nm):
        material = Named(name="mli_gold").at(light_nm * 1e-9)
        assert isinstance(material, Phong)
        assert material.exponent == entry["exponent"]
        assert material.specular / material.diffuse == pytest.approx(entry["specular"] / entry["diffuse"], rel=1e-12)
        return material.diffuse + material.specular

    at_nm, reflectance = np.array(below["wavelength_nm"]), np.array(below["reflectance"])
    assert [total(light_nm) for light_nm in at_nm] == pytest.approx(reflectance, rel=1e-12)
    middle = [total(light_nm) for light_nm in 0.5 * (at_nm[1:] + at_nm[:-1])]
    assert middle == pytest.approx(0.5 * (reflectance[1:] + reflectance[:-1]), rel=1e-9)
    assert total(957.0) == pytest.approx(0.5 * (reflectance[-1] + 0.8), rel=1e-9)  # midway from 850 to 1064 nm
    assert total(350.0) == total(460.0)
    assert total(460.0) < total(535.0) < total(625.0) < total(850.0) < total(1063.9) < 0.8  # gold, not grey
