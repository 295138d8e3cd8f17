"""Sunlight behind a lens that blurs: each hit's kernel where it lands, and every photon on the focal plane."""

import numpy as np
import pytest

from rso_lidar.optics import AiryPsf, BrownConrady, FieldDependentPsf, FieldPsf, GaussianPsf, Receiver
from rso_lidar.optics.returns.blur import blur_sunlight
from tests.optics.bench_for_tests import place, plate, see, surface, truth_of
from tests.reference.optics import blur as oracle

LENS = Receiver(focal_length_mm=100, f_number=2.8, n_rows=24, n_cols=32, filter_width_nm=1.0)
SOFT = GaussianPsf(sigma_um=50.0)
HALO = GaussianPsf(sigma_um=20.0, halo_fraction=0.05, halo_radius_um=40.0)
FIELD = FieldDependentPsf(fields=(FieldPsf(field_deg=0.0, psf=AiryPsf()), FieldPsf(field_deg=0.5, psf=SOFT)))
WAVELENGTH_M = 1064e-9


def hits_of(lens, width=3.3, height=2.2):
    target = surface("plate", plate(width, height))
    hits = see(target, truth_of(plate=place((0.4, -0.7, 1000.0))), lens.replace(psf=None)).hits
    rng = np.random.default_rng(1)
    rate = rng.random(len(hits.pixel)) * 1e9 * hits.weight
    return hits, np.where(np.arange(len(rate)) % 25 == 0, rate, 0.0)  # a few in sunlight: the oracle is slow


@pytest.mark.parametrize("psf", [SOFT, AiryPsf(), HALO, FIELD], ids=["gaussian", "airy", "halo", "field"])
@pytest.mark.parametrize("distortion", [None, BrownConrady(k1=-40.0)], ids=["straight", "barrel"])
def test_sunlight_is_spread_as_its_oracle_says(psf, distortion):
    lens = LENS.replace(psf=psf, distortion=distortion)
    hits, rate = hits_of(lens)
    ours, reference = (room(hits, rate, lens, WAVELENGTH_M) for room in (blur_sunlight, oracle.blur_sunlight))
    assert ours == pytest.approx(reference, rel=1e-9, abs=1e-9 * reference.max())


def test_no_sunlight_on_an_empty_field():
    hits, rate = hits_of(LENS)
    some = type(hits)(
        **{
            name: getattr(hits, name)[:0] if isinstance(getattr(hits, name), np.ndarray) else getattr(hits, name)
            for name in type(hits).__dataclass_fields__
        }
    )
    assert np.all(blur_sunlight(some, rate[:0], LENS.replace(psf=SOFT), WAVELENGTH_M) == 0.0)
