"""Fixed places and tables: splines, spans, and files that are wrong in one line."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.motion import Fixed, Table
from rso_lidar.motion.motions.prescribed_motion import read_table

HEADER = "time_s,x_m,y_m,z_m"


def written(tmp_path, text, name="path.csv"):
    path = tmp_path / name
    path.write_text(text)
    return str(path)


def rows(*columns):
    return "\n".join(",".join(repr(float(value)) for value in row) for row in zip(*columns, strict=True))


def test_fixed_stays():
    position, velocity = Fixed(position_m=(1.0, 2.0, 3.0)).positions(np.arange(4.0))
    np.testing.assert_array_equal(position, [[1.0, 2.0, 3.0]] * 4)
    np.testing.assert_array_equal(velocity, np.zeros((4, 3)))


def test_cubic_is_followed_exactly(tmp_path):
    # the not-a-knot spline through samples of a cubic is that cubic
    t = np.array([0.0, 1.0, 2.5, 4.0, 7.0])

    def path(s):
        return np.stack([1 + s - s**3, 2 * s**2, 5 - s], axis=-1)

    def slope(s):
        return np.stack([1 - 3 * s**2, 4 * s, 0 * s - 1], axis=-1)

    part = Table(file=written(tmp_path, HEADER + "\n" + rows(t, *path(t).T)))
    s = np.linspace(0.0, 7.0, 71)
    position, velocity = part.positions(s)
    np.testing.assert_allclose(position, path(s), rtol=0, atol=1e-12)
    np.testing.assert_allclose(velocity, slope(s), rtol=0, atol=1e-11)
    assert part.orientations(s) is None


def test_two_rows_move_uniformly(tmp_path):
    part = Table(file=written(tmp_path, f"{HEADER}\n0,0,0,0\n10,20,0,-5\n"))
    position, velocity = part.positions(np.array([2.5]))
    np.testing.assert_allclose(position, [[5.0, 0.0, -1.25]], atol=1e-15)
    np.testing.assert_allclose(velocity, [[2.0, 0.0, -0.5]], atol=1e-15)


def test_columns_may_come_in_any_order(tmp_path):
    part = Table(file=written(tmp_path, "z_m, time_s ,y_m,x_m\n\n3,0,2,1\n6,10,5,4\n"))
    np.testing.assert_allclose(part.positions(np.array([0.0, 10.0]))[0], [[1, 2, 3], [4, 5, 6]], atol=1e-15)


def test_uniform_turn_is_followed_with_its_rate_in_body_axes(tmp_path):
    t = np.linspace(0.0, 8.0, 9)
    rate = np.array([0.02, -0.05, 0.1])
    start = Rotation.from_rotvec([0.3, 0.1, -0.7])
    quaternion = (start * Rotation.from_rotvec(np.outer(t, rate))).as_quat()
    text = HEADER + ",qx,qy,qz,qw\n" + rows(t, 0 * t, 0 * t, 0 * t, *quaternion.T)
    part = Table(file=written(tmp_path, text))
    s = np.linspace(0.0, 8.0, 33)
    rotation, found = part.orientations(s)
    # RotationSpline solves for its rates to 1e-9 of itself
    np.testing.assert_allclose(
        (rotation.inv() * start * Rotation.from_rotvec(np.outer(s, rate))).magnitude(), 0, atol=1e-9
    )
    np.testing.assert_allclose(found, np.broadcast_to(rate, found.shape), rtol=0, atol=1e-9)


def test_rate_is_the_slope_of_the_turn(tmp_path):
    t = np.linspace(0.0, 5.0, 6)
    quaternion = Rotation.from_euler("ZYX", np.stack([0.3 * t, np.sin(t), 0.1 * t**2], axis=1)).as_quat()
    part = Table(file=written(tmp_path, HEADER + ",qx,qy,qz,qw\n" + rows(t, t, t, t, *quaternion.T)))
    s, h = np.linspace(0.4, 4.6, 30), 1e-4
    ahead, behind = part.orientations(s + h)[0], part.orientations(s - h)[0]
    # h^2 / 6 times the rate's second derivative (some 10 rad/s^3) and rounding over 2 h
    np.testing.assert_allclose((behind.inv() * ahead).as_rotvec() / (2 * h), part.orientations(s)[1], atol=1e-7)


def test_outside_the_span(tmp_path):
    part = Table(file=written(tmp_path, f"{HEADER}\n0,0,0,0\n10,1,1,1\n"))
    with pytest.raises(PropagationError, match=r"2 of 3 epochs, first at time_s = 10\.5: it spans 0 to 10 s") as caught:
        part.positions(np.array([10.0, 10.5, -1.0]))
    np.testing.assert_array_equal(caught.value.bad, [False, True, True])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        (f"{HEADER}\n0,0,0,0\n", "has 1 rows; a table needs at least two"),
        ("time_s,x_m,y_m\n0,0,0\n1,0,0\n", "line 1: column z_m is missing"),
        ("t_s,x_m,y_m,z_m\n0,0,0,0\n1,0,0,0\n", "line 1: unknown column 't_s'; did you mean 'time_s'"),
        (f"{HEADER},x_m\n0,0,0,0,0\n1,0,0,0,0\n", "line 1: column 'x_m' is given twice"),
        (f"{HEADER},qx,qy,qz\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n", "line 1: column qw is missing"),
        (f"{HEADER}\n0,0,0,0\n\n1,0,zero,0\n", "line 4: y_m 'zero' is not a number"),
        (f"{HEADER}\n0,0,0,0\n1,0,nan,0\n", "line 3: y_m is nan; give a finite number"),
        (f"{HEADER}\n0,0,0,0\n1,0,0\n", "line 3: has 3 cells, the header 4"),
        (f"{HEADER}\n0,0,0,0\n2,0,0,0\n1,0,0,0\n", "line 4: its epoch is before that of the row before; sort the rows"),
        (f"{HEADER}\n0,0,0,0\n0,0,0,0\n", "line 3: its epoch occurs twice, in the row before, too"),
        (f"{HEADER},qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,2\n", "line 3: the quaternion's norm is 2, not 1"),
    ],
)
def test_bad_tables_are_refused_in_one_line(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(ScenarioError, match=message) as caught:
        Table(file=path).positions(np.zeros(1))
    assert str(caught.value).startswith(path)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_tables(tmp_path):
    with pytest.raises(ScenarioError, match=r"nowhere\.csv: no such file"):
        Table(file="nowhere.csv").positions(np.zeros(1))
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match="not UTF-8 text"):
        read_table(tmp_path / "binary.csv")
    with pytest.raises(ScenarioError, match="is a folder"):
        read_table(tmp_path)
