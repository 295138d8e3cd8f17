"""Estimate class and pose with PointNet, and refine the pose by ICP against the model's mesh.

PointNet gets 128 returns relative to their mean. For each model it predicts four rotations with scores, as the first two
columns of a matrix (Zhou et al. 2019, "On the continuity of rotation representations"), and the position of the origin. The
loss is that of the best of the four, over the symmetry of the model. ICP starts from each of the four, and the pose with the
least misfit is taken. With `--search`, ICP also starts from 96 attitudes that cover all rotations evenly, which takes two
seconds for each frame.

`python examples/learning/pose.py FOLDER --search -o pose.npz`; the network's best rotation as it stands goes to
`pose_before_icp.npz`. With `--no-icp`, there is that file only.

With `--sensor camera`, the points are the bright pixels of a camera's image, in units of the rms radius of their group, so
that the network sees shape only. The logarithm of that radius in metres is predicted, and gives the range. There is no ICP,
which needs points in space. With `--sensor both`, the network gets 64 returns, and 64 bright pixels at the range of the
returns, with a flag for the sensor. `--runs 5` writes five files each.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from arguments import parse, run
from frames import Returns, cloud, divide, load_returns
from images import CAMERA, load_bright_points, load_camera_poses
from networks import PointNet
from predictions import accuracy, write
from pytorch import torch
from scipy.spatial.transform import RigidTransform, Rotation
from training import fit, prepare_torch

import rso_lidar as rl
from rso_lidar.records import rotation_error_rad
from rso_lidar.scene import load_mesh
from rso_lidar.scene import model as find_model
from rso_lidar.track import Alignment, SampledMesh, acquire, align, sample_mesh
from rso_lidar.track.pose.icp import find_outline, misfit_m
from rso_lidar.units import DEG

POINTS, GUESSES = 128, 4
ICP_POINTS = 600
SIZE_M = 10.0  # a craft of this size has coordinates of about 1
NOMINAL_M = 1000.0  # range at which the bright pixels of a camera are put
FARTHEST = 4.0  # units from the mean of the points to the origin of a craft; farther, the points are another body's
SMALLEST_RAD = 2e-5  # least rms radius of a group in an image: a tenth of a pixel


@dataclass(frozen=True)
class Sight:
    """What a network sees of n frames: the returns of the lidar, the bright pixels of the camera, or both.

    `position_m` (n, 3) and `rotation` (n, 3, 3) are the true pose in the axes of the sensor, the lidar's for both.
    """

    lidar: Returns | None
    camera: Returns | None
    position_m: np.ndarray
    rotation: np.ndarray

    @property
    def returns(self) -> Returns:
        """The points that decide which frames can be learned from."""
        out = self.camera if self.lidar is None else self.lidar
        assert out is not None
        return out

    @property
    def features(self) -> int:
        """Numbers of each point."""
        return 4 if self.lidar is None or self.camera is None else 5

    def clouds(self, frames: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return points (frame, point, feature), their means (frame, 3) [m], and the unit of length (frame) [m].

        Parameters
        ----------
        frames : numbers of those to take.
        rng : draws points.
        """
        size = POINTS if self.features == 4 else POINTS // 2
        points, middle = cloud(self.returns, frames, size, rng)
        unit = np.full(len(frames), SIZE_M)
        if self.lidar is None:
            point_m = [self.returns.point_m[self.returns.of(k)].astype(float) for k in frames]
            radius = [np.sqrt(one.var(axis=0).sum()) if len(one) else 0.0 for one in point_m]
            unit = np.maximum(radius, SMALLEST_RAD * NOMINAL_M)
            points[..., :3] *= (SIZE_M / unit)[:, None, None]
        elif self.camera is not None:
            bright, at = cloud(self.camera, frames, size, rng)
            seen, empty = self.camera.count[frames] > 0, self.returns.count[frames] == 0
            middle[empty] = at[empty]
            bright[..., :3] += ((at - middle) / SIZE_M)[:, None]
            points, bright = (
                np.pad(one, ((0, 0), (0, 0), (0, 1)), constant_values=k) for k, one in enumerate((points, bright))
            )
            points[empty], bright[~seen] = bright[empty], points[~seen]
            points = np.concatenate([points, bright], axis=1).astype(np.float32)
        return points, middle, unit

    def encode(self, frames: np.ndarray, middle: np.ndarray, unit: np.ndarray) -> np.ndarray:
        """Return three numbers that tell the position of each frame (frame, 3).

        By lidar, from the mean of the points in units. By camera, the same across the line of sight, and the logarithm of
        the unit at the range of the craft over 10 m.

        Parameters
        ----------
        frames : numbers of the frames.
        middle, unit : result of `clouds`.
        """
        position = self.position_m[frames]
        if self.lidar is not None:
            return (position - middle) / unit[:, None]
        times = np.linalg.norm(position, axis=1) / NOMINAL_M
        out = (position / times[:, None] - middle) / unit[:, None]
        out[:, 2] = np.log(times * unit / SIZE_M)
        return out

    def is_craft(self) -> np.ndarray:
        """Return the frames (n) whose points are those of the craft, not those of clutter or noise, by its true position."""
        out = np.zeros(len(self.returns), bool)
        for k in np.flatnonzero(self.returns.has_craft):
            off = self.returns.point_m[self.returns.of(k)].astype(float)
            position = self.position_m[k]
            if self.lidar is None:
                position = position * NOMINAL_M / np.linalg.norm(position)
            away = np.linalg.norm(off.mean(axis=0) - position)
            size = SIZE_M if self.lidar is not None else max(np.sqrt(off.var(axis=0).sum()), SMALLEST_RAD * NOMINAL_M)
            out[k] = away < FARTHEST * size
        return out

    def decode(self, code: np.ndarray, middle: np.ndarray, unit: np.ndarray) -> np.ndarray:
        """Return positions (frame, 3) [m] in the axes of the sensor; the inverse of `encode`.

        Parameters
        ----------
        code : three numbers (frame, 3).
        middle, unit : result of `clouds`.
        """
        if self.lidar is not None:
            return middle + unit[:, None] * code
        toward = middle + unit[:, None] * code * [1.0, 1.0, 0.0]
        far = np.exp(code[:, 2]) * SIZE_M / unit * NOMINAL_M
        return toward * (far / np.maximum(np.linalg.norm(toward, axis=1), 1.0))[:, None]


def load_sight(folder: str, split: str, sensor: str, most: int | None) -> tuple[Sight, Returns]:
    """Load what a network sees of a split, and the returns of the lidar, whose columns are the truth.

    Parameters
    ----------
    folder : of the dataset.
    split : its name.
    sensor : lidar, camera or both.
    most : greatest number of frames; all if None.
    """
    returns = load_returns(folder, split, most=most)
    columns, camera = returns.columns, None
    if sensor != "lidar":
        far = np.array([
            np.linalg.norm(returns.point_m[returns.of(k)], axis=1).mean() if n and sensor == "both" else NOMINAL_M
            for k, n in enumerate(returns.count)
        ])  # fmt: skip
        camera = load_bright_points(folder, split, CAMERA, far, most)
    if sensor == "camera":
        columns = load_camera_poses(folder, split, CAMERA, most)
    quaternion = np.where(returns.columns["class_id"][:, None] >= 0, columns["quaternion_xyzw"], [0.0, 0.0, 0.0, 1.0])
    rotation = Rotation.from_quat(quaternion).as_matrix()
    return Sight(None if sensor == "camera" else returns, camera, columns["position_m"], rotation), returns


class PoseNetwork(torch.nn.Module):
    """Points (n, point, feature) to logits and places of the models, and rotations (n, model, guess, 3, 3) with logits."""

    def __init__(self, models: int, features: int) -> None:
        super().__init__()
        self.models = models
        self.net = PointNet(features, models * (1 + 7 * GUESSES + 3), width=256)

    def forward(self, points: torch.Tensor) -> tuple[torch.Tensor, ...]:
        out = self.net(points).reshape(len(points), self.models, -1)
        logits, origin, guesses = out[..., 0], out[..., 1:4], out[..., 4:].reshape(*out.shape[:2], GUESSES, 7)
        first = torch.nn.functional.normalize(guesses[..., :3], dim=-1)
        second = guesses[..., 3:6] - (first * guesses[..., 3:6]).sum(-1, keepdim=True) * first
        second = torch.nn.functional.normalize(second, dim=-1)
        rotation = torch.stack([first, second, torch.linalg.cross(first, second)], dim=-1)
        return logits, rotation, guesses[..., 6], origin


def symmetry_matrices(symmetries: Any) -> tuple[torch.Tensor, torch.Tensor]:
    """Return for each model rotations (model, element, 3, 3) under which it looks the same, and a projection (model, 3, 3).

    The projection is the identity, or keeps only the axis of a body of revolution.
    """
    groups, projections = [np.eye(3)[None] for _ in symmetries], [np.eye(3) for _ in symmetries]
    for k, one in enumerate(symmetries):
        if one is not None:
            groups[k] = Rotation.from_quat(one.rotations_xyzw(180.0)).as_matrix()
            axis = one.basis[2]
            projections[k] = np.outer(axis, axis) if one.fold == 0 else np.eye(3)
    most = max(len(group) for group in groups)
    filled = np.stack([np.concatenate([group, np.repeat(group[:1], most - len(group), axis=0)]) for group in groups])
    return torch.tensor(filled, dtype=torch.float32), torch.tensor(np.stack(projections), dtype=torch.float32)


def rotation_loss(
    found: torch.Tensor, true: torch.Tensor, group: torch.Tensor, projection: torch.Tensor
) -> torch.Tensor:
    """Return squared distances (n, guess) of rotations, the least over a symmetry.

    Parameters
    ----------
    found, true : rotations (n, guess, 3, 3) and (n, 3, 3).
    group, projection : of the model of each, (n, element, 3, 3) and (n, 3, 3).
    """
    wanted = true[:, None] @ group @ projection[:, None]
    off = (found @ projection[:, None])[:, :, None] - wanted[:, None]
    return off.square().sum(dim=(-1, -2)).amin(dim=2)


def train(sight: Sight, symmetries: Any, epochs: int, seed: int) -> PoseNetwork:
    """Train on frames with points of a craft; each is turned at random about the line of sight, and so is its pose.

    Parameters
    ----------
    sight : of the training split.
    symmetries : of the models.
    epochs, seed : of the training.
    """
    returns, network = sight.returns, PoseNetwork(len(symmetries), sight.features)
    group, projection = symmetry_matrices(symmetries)
    to_train, held_out = divide(returns, seed, sight.is_craft())
    model = torch.as_tensor(returns.columns["model_id"].astype(np.int64))

    def loss(frames: np.ndarray, rng: np.random.Generator, turn: bool = True) -> torch.Tensor:
        points, middle, unit = sight.clouds(frames, rng)
        angle = rng.uniform(0.0, 2.0 * np.pi, len(frames)) * turn
        roll = Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0]).as_matrix()
        points[..., :3] = np.einsum("nij,npj->npi", roll, points[..., :3])
        true = torch.tensor(roll @ sight.rotation[frames], dtype=torch.float32)
        offset = np.einsum("nij,nj->ni", roll, sight.encode(frames, middle, unit))
        logits, found, scores, origin = network(torch.as_tensor(points))
        of = model[frames]
        row = torch.arange(len(frames))
        distance = rotation_loss(found[row, of], true, group[of], projection[of])
        best = distance.detach().argmin(dim=1)
        nearest = 0.95 * distance[row, best] + 0.05 * distance.mean(dim=1)  # so that each is trained
        return (
            torch.nn.functional.cross_entropy(logits, of)
            + nearest.mean()
            + 0.2 * torch.nn.functional.cross_entropy(scores[row, of], best)
            + torch.nn.functional.smooth_l1_loss(origin[row, of], torch.tensor(offset, dtype=torch.float32), beta=0.1)
        )

    def validate() -> float:
        rng = np.random.default_rng(0)
        return float(
            np.mean([float(loss(some, rng, False)) for some in np.array_split(held_out, 1 + len(held_out) // 256)])
        )

    fit(network, loss, to_train, validate, epochs=epochs, seed=seed, rate=3e-3)
    return network


@torch.no_grad()
def predict(network: PoseNetwork, sight: Sight) -> tuple[np.ndarray, ...]:
    """Return probabilities (frame, model), and of the likeliest model rotations (frame, guess, 3, 3) and position."""
    rng = np.random.default_rng(0)
    out: list[tuple[np.ndarray, ...]] = []
    for frames in np.array_split(np.arange(len(sight.returns)), 1 + len(sight.returns) // 256):
        points, middle, unit = sight.clouds(frames, rng)
        logits, rotation, scores, origin = network(torch.as_tensor(points))
        row, of = torch.arange(len(frames)), logits.argmax(dim=1)
        order = scores[row, of].argsort(dim=1, descending=True)
        out.append((
            logits.softmax(dim=1).numpy(),
            rotation[row, of][row[:, None], order].numpy(),
            sight.decode(origin[row, of].numpy().astype(float), middle, unit),
        ))  # fmt: skip
    return tuple(np.concatenate(part) for part in zip(*out, strict=True))


def refine(
    point_m: np.ndarray, mesh: SampledMesh, rotations: np.ndarray, origin_m: np.ndarray, half_field_rad: float
) -> tuple[Alignment, float]:
    """Refine a pose by ICP from several rotations; return the one with the least misfit, and the misfit [m].

    Parameters
    ----------
    point_m : returns (point, 3) in lidar axes.
    mesh : points of the model.
    rotations : lidar_from_target (guess, 3, 3) to start from.
    origin_m : of the target (3) to start from.
    half_field_rad : half of the field of view; a near craft reaches beyond it.
    """
    outline = find_outline(point_m)
    starts = [RigidTransform.from_components(origin_m, Rotation.from_matrix(one)) for one in rotations]
    found = [align(point_m, mesh, start, steps=40) for start in starts]
    misfits = [misfit_m(one.pose, mesh, point_m, outline, half_field_rad) for one in found]
    best = int(np.argmin(misfits))
    return found[best], misfits[best]


def load_meshes(models: tuple[str, ...]) -> list[SampledMesh]:
    """Load the models of a dataset and sample their surfaces, in body axes."""
    meshes = []
    for name in models:
        entry = find_model(name)
        mesh = load_mesh(entry.path)
        meshes.append(sample_mesh(mesh.vertices[mesh.facets] - np.array(entry.center_of_mass_m)))
    return meshes


def tabulate(
    test: Returns, models: tuple[str, ...], symmetries: Any, quaternion: np.ndarray, position: np.ndarray
) -> None:
    """Print median errors of frames with more than 100 reporting pixels, by model.

    Parameters
    ----------
    test : of the test split.
    models, symmetries : by number.
    quaternion, position : estimates.
    """
    columns = test.columns
    for k, name in enumerate(models):
        some = (columns["model_id"] == k) & (columns["reporting_pixels"] > 100)
        if some.any():
            turned = rotation_error_rad(quaternion[some], columns["quaternion_xyzw"][some], symmetries[k]) / DEG
            away = np.linalg.norm(position[some] - columns["position_m"][some], axis=1)
            print(
                f"{name:12} {some.sum():4} frames over 100 reporting pixels: rotation {np.median(turned):.2f} deg in the"
                f" median, {np.mean(turned < 5.0):.0%} within 5 deg; position {np.median(away):.3f} m"
            )


def refine_all(
    test: Returns,
    meshes: list[SampledMesh],
    model: np.ndarray,
    rotations: np.ndarray,
    origin_m: np.ndarray,
    search: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Refine poses by ICP where there are six returns or more; return quaternions (frame, 4) and positions (frame, 3) [m].

    Parameters
    ----------
    test : returns of the lidar.
    meshes : of the models.
    model : of each frame (frame).
    rotations : to start from (frame, guess, 3, 3), the best first.
    origin_m : to start from (frame, 3).
    search : whether ICP also starts from attitudes that cover all rotations.
    """
    quaternion, position = Rotation.from_matrix(rotations[:, 0]).as_quat(canonical=True), origin_m.copy()
    half_field_rad = np.arctan((test.columns["intrinsics_px"][:, 2] + 0.5) / test.columns["intrinsics_px"][:, 0])
    searched = 0
    for k in np.flatnonzero(test.count >= 6):
        point_m, mesh = test.point_m[test.of(k)].astype(float), meshes[model[k]]
        some = point_m[:: max(1, len(point_m) // ICP_POINTS)]
        half = float(half_field_rad[k])
        found, misfit = refine(some, mesh, rotations[k], origin_m[k], half)
        if search:
            other = acquire(some, mesh, count=4, half_field_rad=half)[0]
            if misfit_m(other.pose, mesh, some, find_outline(some), half) < misfit:
                found, searched = other, searched + 1
        quaternion[k], position[k] = found.pose.rotation.as_quat(canonical=True), found.pose.translation
    print(f"after ICP; in {searched} of {len(test)} frames the search found the better fit")
    return quaternion, position


def find_mount(sight: Sight, returns: Returns) -> RigidTransform:
    """Find the transform to lidar axes from those of the sensor: both have the poses of the same craft."""
    k = int(np.argmax(returns.columns["class_id"] >= 0))
    turn = Rotation.from_quat(returns.columns["quaternion_xyzw"][k]) * Rotation.from_matrix(sight.rotation[k]).inv()
    return RigidTransform.from_components(returns.columns["position_m"][k] - turn.apply(sight.position_m[k]), turn)


def main() -> None:
    sensors = ("lidar", "camera", "both")
    options = prepare_torch(
        parse(__doc__, epochs=100, flags=("no_icp", "search"), runs=True, sensors=sensors, also=False)
    )
    data, path = rl.dataset.open(options.dataset), Path(options.output)
    sight, returns = load_sight(options.dataset, "train", options.sensor, options.most)
    asked, test = load_sight(options.dataset, "test", options.sensor, options.most)
    class_of = np.zeros((len(data.models), len(data.classes)), np.float32)
    known = returns.columns["class_id"] >= 0
    class_of[returns.columns["model_id"][known], returns.columns["class_id"][known]] = 1.0
    meshes = [] if options.no_icp or options.sensor == "camera" else load_meshes(data.models)
    for seed in range(options.seed, options.seed + options.runs):
        torch.manual_seed(seed)
        network = train(sight, data.symmetries, options.epochs, seed)
        probability, rotations, origin = predict(network, asked)
        mount = find_mount(sight, returns)
        rotations, origin = mount.rotation.as_matrix() @ rotations, mount.apply(origin)
        scores = probability @ class_of
        print(accuracy(test, scores))
        quaternion, position = Rotation.from_matrix(rotations[:, 0]).as_quat(canonical=True), origin
        tabulate(test, data.models, data.symmetries, quaternion, position)
        place = path if options.runs == 1 else path.with_stem(f"{path.stem}_{seed}")
        before = str(place.with_stem(f"{place.stem}_before_icp"))
        write(before, options.dataset, test, scores=scores, position_m=position, quaternion_xyzw=quaternion)
        if meshes:
            quaternion, position = refine_all(
                test, meshes, probability.argmax(axis=1), rotations, origin, options.search
            )
            tabulate(test, data.models, data.symmetries, quaternion, position)
            write(str(place), options.dataset, test, scores=scores, position_m=position, quaternion_xyzw=quaternion)


if __name__ == "__main__":
    run(main)
