"""The axioms of poses, links and their tree, over single ones and batches; rates against finite differences."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.pose import (
    ROOT,
    Link,
    PoseTree,
    cross,
    matrix_from_quaternion,
    matrix_from_vector,
    multiply_quaternions,
    pose,
    quaternion_from_vector,
    quaternion_xyzw,
    rotate_vectors,
    skew,
)

SHAPES = st.sampled_from([(), (1,), (4,)])  # one epoch, a batch of one, a batch
SEEDS = st.integers(0, 2**32 - 1)
few = settings(max_examples=30)  # seeds of draws that are all alike
POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0.5, -3, 7]])


def some_link(rng, shape):
    """Return a link of the given batch shape: positions of 1 km, rates of 1."""
    quaternion = rng.normal(size=(*shape, 4))
    return Link(
        pose(1e3 * rng.normal(size=(*shape, 3)), Rotation.from_quat(quaternion)),
        rng.normal(size=(*shape, 3)),
        rng.normal(size=(*shape, 3)),
    )


def same(a, b, size=1e4):
    """Compare two links: positions within a few hundred roundings of `size` [m], velocities of that times rates of 1."""
    for here, there, tolerance in [
        (a.pose.translation, b.pose.translation, 1e-12 * size),
        (a.pose.rotation.as_matrix(), b.pose.rotation.as_matrix(), 1e-13),
        (a.velocity_m_s, b.velocity_m_s, 1e-11 * size),
        (a.angular_velocity_rad_s, b.angular_velocity_rad_s, 1e-12),
    ]:
        here, there = np.broadcast_arrays(here, there)  # a batch of equal ones is the single one
        np.testing.assert_allclose(here, there, rtol=0.0, atol=tolerance)


def test_one_epoch_has_the_same_bits_and_shape_alone_and_within_a_batch():
    """A single rotation takes a shorter way, whatever its dimensions of length 1."""
    rng = np.random.default_rng(3)
    quaternions, vectors, others = rng.normal(size=(5, 4)), rng.normal(size=(5, 3)), rng.normal(size=(5, 3))
    matrices = matrix_from_quaternion(quaternions)
    rotated, product = rotate_vectors(matrices, vectors), cross(vectors, others)
    for k in range(5):
        np.testing.assert_array_equal(matrix_from_quaternion(quaternions[k]), matrices[k], strict=True)
        one = slice(k, k + 1)
        np.testing.assert_array_equal(matrix_from_quaternion(quaternions[one]), matrices[one], strict=True)
        for matrix, vector in ((matrices[k], vectors[one]), (matrices[one], vectors[k]), (matrices[one], vectors[one])):
            np.testing.assert_array_equal(rotate_vectors(matrix, vector), rotated[one], strict=True)
        np.testing.assert_array_equal(rotate_vectors(matrices[k], vectors[k]), rotated[k], strict=True)
        np.testing.assert_array_equal(cross(vectors[k], others[one]), product[one], strict=True)
        np.testing.assert_array_equal(cross(vectors[k], others[k]), product[k], strict=True)
    np.testing.assert_array_equal(rotate_vectors(matrices[None, :1], vectors[0]), rotated[None, :1], strict=True)


@few
@given(SEEDS)
def test_sums_that_are_written_out_are_the_rotations_of_scipy(seed):
    rng = np.random.default_rng(seed)
    vectors = 2.0 * rng.normal(size=(5, 3)) * [[1.0], [1e-3], [1e-9], [0.0], [1.0]]
    turns, others = Rotation.from_rotvec(vectors), Rotation.from_quat(rng.normal(size=(5, 4)))
    matrices = turns.as_matrix()
    np.testing.assert_allclose(matrix_from_vector(vectors), matrices, atol=1e-14)
    np.testing.assert_allclose(matrix_from_quaternion(3.0 * turns.as_quat()), matrices, atol=1e-14)
    product = multiply_quaternions(quaternion_from_vector(vectors), others.as_quat())
    np.testing.assert_allclose(matrix_from_quaternion(product), (turns * others).as_matrix(), atol=1e-14)
    for k in range(5):  # alone, with the same bits
        alone = multiply_quaternions(quaternion_from_vector(vectors[k]), others.as_quat()[k])
        np.testing.assert_array_equal(alone, product[k])
        expected = cross(vectors[k], vectors[k - 1])
        np.testing.assert_allclose(skew(vectors[k]) @ vectors[k - 1], expected, rtol=1e-14, atol=1e-14)


@few
@given(SEEDS, SHAPES, SHAPES, SHAPES)
def test_links_are_associative(seed, first, second, third):
    rng = np.random.default_rng(seed)  # a batch of one meets a batch of four, as numpy has it
    a, b, c = (some_link(rng, shape) for shape in (first, second, third))
    same((a * b) * c, a * (b * c))


@few
@given(SEEDS, SHAPES)
def test_a_still_link_changes_nothing(seed, shape):
    link = some_link(np.random.default_rng(seed), shape)
    same(Link.still() * link, link)
    same(link * Link.still(), link)


@few
@given(SEEDS, SHAPES)
def test_the_inverse_undoes(seed, shape):
    link = some_link(np.random.default_rng(seed), shape)
    for product in (link * link.inv(), link.inv() * link):
        same(product, Link.still())
    same(link.inv().inv(), link)


@few
@given(SEEDS, SHAPES)
def test_the_inverse_of_a_product_is_the_product_of_inverses(seed, shape):
    rng = np.random.default_rng(seed)
    a, b = some_link(rng, shape), some_link(rng, shape)
    same((a * b).inv(), b.inv() * a.inv())


@few
@given(SEEDS)
def test_a_product_acts_as_one_after_the_other(seed):
    rng = np.random.default_rng(seed)
    a, b = some_link(rng, ()), some_link(rng, ())
    np.testing.assert_allclose((a * b).pose.apply(POINTS), a.pose.apply(b.pose.apply(POINTS)), atol=1e-8)


@few
@given(SEEDS, st.integers(0, 3), st.booleans())
def test_one_epoch_of_a_product_is_the_product_at_that_epoch(seed, epoch, outer_single):
    rng = np.random.default_rng(seed)
    a, b = some_link(rng, () if outer_single else (4,)), some_link(rng, (4,))
    same((a * b)[epoch], a[epoch] * b[epoch])
    same(a.inv()[epoch], a[epoch].inv())
    assert (a * b)[epoch].single
    same((a * b)[1:3], a[1:3] * b[1:3])


@few
@given(SEEDS)
def test_quaternions_are_canonical_and_lose_nothing(seed):
    rotation = Rotation.random(5, random_state=np.random.default_rng(seed))
    quaternion = quaternion_xyzw(rotation)
    assert np.all(quaternion[:, 3] >= 0)
    np.testing.assert_allclose((Rotation.from_quat(quaternion) * rotation.inv()).magnitude(), 0.0, atol=1e-14)


# ------------------------------------------------------------------------------------------------------ rates


def moving(rng):
    """Return a function of time that gives a link whose rates are those of its pose, worked out by hand."""
    p0, v0, a0, axis, axis_b = rng.normal(size=(5, 3))
    start = Rotation.random(random_state=rng)

    def at(time):
        inner = Rotation.from_rotvec(axis * time)
        turn = start * Rotation.from_rotvec(axis_b * time) * inner
        rate = inner.inv().apply(axis_b) + axis  # body rates add from the inside out
        return Link(pose(p0 + v0 * time + a0 * time**2 / 2, turn), v0 + a0 * time, rate)

    return at


def differenced(at, time, h=1e-4):
    before, after = at(time - h).pose, at(time + h).pose
    velocity = (after.translation - before.translation) / (2 * h)
    return velocity, (before.rotation.inv() * after.rotation).as_rotvec() / (2 * h)


@few
@given(SEEDS, st.integers(1, 4), st.lists(st.booleans(), min_size=4, max_size=4))
def test_rates_of_chains_are_those_of_their_poses(seed, count, inverted):
    rng = np.random.default_rng(seed)
    movers = [moving(rng) for _ in range(count)]

    def chain(time):
        total = Link.still()
        for at, turned in zip(movers, inverted, strict=False):
            total = total * (at(time).inv() if turned else at(time))
        return total

    link = chain(0.3)
    velocity, rate = differenced(chain, 0.3)
    # The central difference errs by h^2 / 6 of a third derivative: rates of up to 4 links of 2 axes of 3 rad/s make
    # (20 rad/s)^3 of 20 m, 2e5, and eps / h of 20 m, 4e-11.
    np.testing.assert_allclose(link.velocity_m_s, velocity, atol=1e-4 * 3)
    np.testing.assert_allclose(link.angular_velocity_rad_s, rate, atol=1e-4)


@few
@given(SEEDS)
def test_a_relative_velocity_in_turning_axes_holds_the_transport_term(seed):
    """A point at rest in space, seen from axes that turn with w, moves at -w x r."""
    rng = np.random.default_rng(seed)
    w, r = rng.normal(size=(2, 3))
    turning = Link(RigidTransform.identity(), np.zeros(3), w)
    fixed = Link.still(pose(r))
    tree = PoseTree({"turning": ROOT, "fixed": ROOT}, {"turning": turning, "fixed": fixed})
    np.testing.assert_allclose(tree.link("turning", "fixed").velocity_m_s, -np.cross(w, r), atol=1e-14)
    np.testing.assert_allclose(tree.link("turning", "fixed").angular_velocity_rad_s, -w, atol=1e-15)


# ------------------------------------------------------------------------------------------------------- the tree

NAMES = ["a", "b", "c", "d", "e"]


@st.composite
def trees(draw):
    """Draw a tree of five axes, each hung from the root or from one before it, some links single, some batched."""
    rng = np.random.default_rng(draw(SEEDS))
    parents, links = {}, {}
    for k, name in enumerate(NAMES):
        parents[name] = draw(st.sampled_from([ROOT, *NAMES[:k]]))
        links[name] = some_link(rng, (4,) if draw(st.booleans()) else ())
    return PoseTree(parents, links)


ANY = st.sampled_from([ROOT, *NAMES])


@few
@given(trees(), ANY, ANY, ANY)
def test_poses_of_a_tree_compose_along_any_way(tree, a, b, c):
    same(tree.link(a, b) * tree.link(b, c), tree.link(a, c))
    same(tree.link(a, b).inv(), tree.link(b, a))
    same(tree.link(a, a), Link.still())


@few
@given(trees(), ANY, ANY, st.integers(0, 3))
def test_a_tree_at_an_epoch_gives_the_links_of_that_epoch(tree, a, b, epoch):
    same(tree.at(epoch).link(a, b), tree.link(a, b)[epoch])
    assert tree.at(epoch).link(a, b).single
    np.testing.assert_allclose(tree.pose(a, b).as_matrix(), tree.link(a, b).pose.as_matrix(), atol=1e-8)


@few
@given(trees(), st.sampled_from(NAMES))
def test_a_link_of_the_tree_is_the_pose_in_its_parent(tree, name):
    same(tree.link(tree.parent(name), name), tree[name])


def test_neighbours_far_from_the_root_never_meet_its_large_numbers():
    far = Link.still(pose([4.2e7, 1.1e7, -3e6]))
    near = Link.still(pose([0.1, 0.2, 0.3]))
    tree = PoseTree({"chief": ROOT, "deputy": "chief"}, {"chief": far, "deputy": near})
    assert np.array_equal(tree.pose("chief", "deputy").translation, [0.1, 0.2, 0.3])  # to the bit: no 7 nm at GEO


def test_an_unknown_name_is_refused_with_the_nearest():
    tree = PoseTree({"tdrs": ROOT}, {"tdrs": Link.still()})
    with pytest.raises(ScenarioError, match="did you mean 'tdrs'"):
        tree.pose(ROOT, "tdrx")
