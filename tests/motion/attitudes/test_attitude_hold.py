import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import FixedAttitude, LookAt, LvlhCcsds, Rtn, Spin, Tumble
from rso_lidar.motion.attitudes.look_at import aim_axes
from rso_lidar.units import DEG

X, Y, Z = np.eye(3)

# The body axis, and where it points in rtn (x radially out, y along the track, z along the orbit normal).
RTN = [
    (Rtn(), X, X),
    (Rtn(), Y, Y),
    (Rtn(), Z, Z),
    (Rtn(euler_zyx_deg=(90, 0, 0)), X, Y),  # yaw: forward turns from radial to along-track
    (Rtn(euler_zyx_deg=(90, 0, 0)), Y, -X),
    (Rtn(euler_zyx_deg=(0, 90, 0)), X, -Z),  # pitch about +y takes x to -z
    (Rtn(euler_zyx_deg=(0, 0, 90)), Y, Z),  # roll about +x takes y to z
    (Rtn(euler_zyx_deg=(90, 90, 0)), X, -Z),  # intrinsic: the second turn is about the new y, which is -x
    (Rtn(euler_zyx_deg=(90, 90, 0)), Y, -X),
    (LvlhCcsds(), X, Y),  # CCSDS x: along-track on a circle
    (LvlhCcsds(), Y, -Z),  # y: against the orbit normal
    (LvlhCcsds(), Z, -X),  # z: nadir
    (LvlhCcsds(euler_zyx_deg=(90, 0, 0)), X, -Z),  # yaw about nadir takes along-track to the CCSDS y
]


@pytest.mark.parametrize(("attitude", "axis", "expected"), RTN)
def test_where_body_axes_point_in_rtn(attitude, axis, expected):
    np.testing.assert_allclose(attitude.rtn_from_body().apply(axis), expected, atol=1e-15)


def test_fixed_is_the_identity_by_default_and_takes_either_form():
    half = np.sqrt(0.5)
    for attitude, expected in [
        (FixedAttitude(), X),
        (FixedAttitude(euler_zyx_deg=(90, 0, 0)), Y),
        (FixedAttitude(quaternion_xyzw=(0, 0, half, half)), Y),
    ]:
        rotation, rates = attitude.orientation(np.arange(3.0))
        assert rotation.single
        assert rates.shape == (3, 3)
        assert not rates.any()
        np.testing.assert_allclose(rotation.apply(X), expected, atol=1e-15)
    assert FixedAttitude().orientation(1.0)[1].shape == (3,)


def test_fixed_refuses_two_rotations():
    with pytest.raises(ScenarioError, match="give one"):
        FixedAttitude(quaternion_xyzw=(0, 0, 0, 1), euler_zyx_deg=(0, 0, 0))


def test_spin_normalises_its_axis_and_starts_where_it_is_told():
    half = np.sqrt(0.5)
    spin = Spin(axis=(0, 0, 7), rate_deg_s=2.0, quaternion_xyzw=(half, 0, 0, half))  # body z along inertial -y
    rotation, rates = spin.orientation(np.array([0.0, 45.0]))
    np.testing.assert_allclose(rates, [[0, 0, 2 * DEG]] * 2, rtol=1e-15)
    np.testing.assert_allclose(rotation[0].as_quat(), (half, 0, 0, half), atol=1e-15)
    np.testing.assert_allclose(rotation.apply(Z), [-Y, -Y], atol=1e-15)  # the spin axis keeps still
    np.testing.assert_allclose(rotation[1].apply(X), Z, atol=1e-15)  # 90 deg about body z: x goes to where y was


@pytest.mark.parametrize(
    "attitude",
    [
        Spin(axis=(1, 2, 3), rate_deg_s=3.0),
        Tumble(inertia_kg_m2=(100, 200, 250), body_rate_deg_s=(3, 4, 5)),
        Tumble(inertia_kg_m2=(100, 200, 250), body_rate_deg_s=(1e-3, 5, 0)),  # Jacobi's functions near m = 1
        Tumble(inertia_kg_m2=(1, 1, 1), body_rate_deg_s=(3, 4, 5)),
    ],
)
def test_an_epoch_has_the_same_bits_whichever_others_are_asked_for(attitude):
    time = np.linspace(0.0, 6000.0, 1201)
    rotation, rates = attitude.orientation(time)
    for choice in (slice(None, None, 7), slice(3, 4), slice(1000, 1201), [5, 900, 17]):
        other, other_rates = attitude.orientation(time[choice])
        assert np.array_equal(other.as_quat(), rotation.as_quat()[choice])
        assert np.array_equal(other_rates, rates[choice])
    one, one_rate = attitude.orientation(float(time[777]))
    assert one.single
    assert one_rate.shape == (3,)
    assert np.array_equal(one.as_quat(), rotation.as_quat()[777])
    assert np.array_equal(one_rate, rates[777])


def test_tumble_starts_where_it_is_told():
    tumble = Tumble(inertia_kg_m2=(3, 2, 4), body_rate_deg_s=(1, -2, 3), quaternion_xyzw=(0, 0.6, 0, 0.8))
    rotation, rates = tumble.orientation(0.0)
    np.testing.assert_allclose(rotation.as_quat(), (0, 0.6, 0, 0.8), atol=1e-15)
    np.testing.assert_allclose(rates, np.array([1, -2, 3]) * DEG, rtol=1e-14)


@pytest.mark.parametrize(
    ("inertia", "cure"),
    [
        ((1, 2, 4), "exceeds the sum"),
        ((1, 2, 0), "positive"),
        ((1, 2), "three principal moments"),
        (3.0, "three principal moments"),
        (((1, 0), (0, 1), (0, 0)), "three principal moments"),
        (((2, 0.1, 0), (0.2, 2, 0), (0, 0, 2)), "not symmetric"),
        (((2, 3, 0), (3, 2, 0), (0, 0, 2)), "positive"),
        ((1, "2", 2), "needs numbers, not '2'"),
        ((1, True, 2), "needs numbers, not True"),
    ],
)
def test_impossible_inertia_is_refused_with_a_cure(inertia, cure):
    with pytest.raises(ScenarioError, match=cure) as caught:
        Tumble(inertia_kg_m2=inertia, body_rate_deg_s=(0, 0, 1))
    assert "inertia_kg_m2" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_flat_plate_is_allowed():
    """Its greatest moment is the sum of the other two, also where rounding makes the sum 4e-17 too small."""
    for greatest in (0.1 + 0.2, 0.3):
        plate = Tumble(inertia_kg_m2=(0.1, 0.2, greatest), body_rate_deg_s=(0, 0, 1))
        np.testing.assert_allclose(plate.orientation(90.0)[0].apply(X), Y, atol=1e-12)  # about a principal axis: a spin


def test_parts_are_filled_by_what_toml_gives():
    assert LookAt(at="tdrs", up=[0, 0, 1]).up == (0, 0, 1)
    rows = [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]]
    assert Tumble(inertia_kg_m2=rows, body_rate_deg_s=[0, 0, 0]).inertia_kg_m2[1] == (0.0, 3.0, 0.0)
    with pytest.raises(ScenarioError, match="zero vector"):
        LookAt(at="tdrs", up=(0, 0, 0))


def test_look_at_turns_x_to_the_target_and_z_nearest_up():
    rotation, rates = aim_axes(np.array([0.0, 5.0, 0.0]), np.zeros(3), np.array([1.0, 1.0, 0.0]))
    assert rotation.single
    np.testing.assert_allclose(rotation.apply([X, Y, Z]), [Y, Z, X], atol=1e-15)
    assert not rates.any()


def test_look_at_rates_are_those_of_the_triad():
    rng = np.random.default_rng(3)
    los, los_rate, up, up_rate = rng.normal(size=(4, 20, 3))
    _, rates = aim_axes(los, los_rate, up, up_rate)
    h = 1e-5  # the central difference errs by h^2 |third derivative| / 6, some 1e-9 here, and by eps / h = 1e-11
    before, _ = aim_axes(los - h * los_rate, los_rate, up - h * up_rate, up_rate)
    after, _ = aim_axes(los + h * los_rate, los_rate, up + h * up_rate, up_rate)
    np.testing.assert_allclose(rates, (before.inv() * after).as_rotvec() / (2 * h), rtol=1e-6, atol=1e-7)


def test_look_at_one_epoch_has_the_bits_it_has_among_many():
    rng = np.random.default_rng(4)
    los, los_rate, up = rng.normal(size=(3, 50, 3))
    rotation, rates = aim_axes(los, los_rate, up)
    for k in (0, 17, 49):
        one, one_rate = aim_axes(los[k], los_rate[k], up[k])
        assert np.array_equal(one.as_quat(), rotation[k].as_quat())
        assert np.array_equal(one_rate, rates[k])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_look_at_along_up_asks_for_another(sign):
    los = sign * np.array([[1e3, 0, 0], [0.0, 0.0, 1e3]])
    with pytest.raises(ScenarioError, match="give an `up`"):
        aim_axes(los, np.zeros(3), Z)
    tilted = Rotation.from_rotvec([2e-6, 0, 0]).apply(los[1])  # just beyond 1e-6 rad: allowed
    aim_axes(tilted, np.zeros(3), Z)


def test_look_at_nothing_is_an_error():
    with pytest.raises(ScenarioError, match="at the position of the body"):
        aim_axes(np.zeros(3), X, Z)
