"""Estimate class and pose with PointNet, and refine the pose by ICP against the model's mesh.

PointNet gets 128 returns relative to their mean. For each model it predicts four rotations with scores, as the first two
columns of a matrix (Zhou et al. 2019, "On the continuity of rotation representations"), and the position of the origin. The
loss is that of the best of the four, over the symmetry of the model. ICP starts from each of the four, and the pose with the
least misfit is taken. With `--search`, ICP also starts from 96 attitudes that cover all rotations evenly, which takes two
seconds for each frame.

`python examples/learning/pose.py FOLDER --search -o pose.npz`; the network's best rotation as it stands goes to
`pose_before_icp.npz`. With `--no-icp`, there is that file only.
"""

from pathlib import Path
from typing import Any

import numpy as np
from arguments import parse, run
from frames import Returns, cloud, divide, load_returns
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


class PoseNetwork(torch.nn.Module):
    """Points (n, point, 4) to logits and origins of the models, and rotations (n, model, guess, 3, 3) with their logits."""

    def __init__(self, models: int) -> None:
        super().__init__()
        self.models = models
        self.net = PointNet(4, models * (1 + 7 * GUESSES + 3), width=256)

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


def train(returns: Returns, symmetries: Any, epochs: int, seed: int) -> PoseNetwork:
    """Train on frames with returns of a craft; each is turned at random about the line of sight, and so is its pose.

    Parameters
    ----------
    returns : of the training split.
    symmetries : of the models.
    epochs, seed : of the training.
    """
    network = PoseNetwork(len(symmetries))
    group, projection = symmetry_matrices(symmetries)
    to_train, held_out = divide(returns, seed, returns.has_craft)
    model = torch.as_tensor(returns.columns["model_id"].astype(np.int64))
    turned = np.where(returns.has_craft[:, None], returns.columns["quaternion_xyzw"], [0.0, 0.0, 0.0, 1.0])
    rotation = Rotation.from_quat(turned).as_matrix()
    position = returns.columns["position_m"]

    def loss(frames: np.ndarray, rng: np.random.Generator, turn: bool = True) -> torch.Tensor:
        points, middle = cloud(returns, frames, POINTS, rng)
        angle = rng.uniform(0.0, 2.0 * np.pi, len(frames)) * turn
        roll = Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0]).as_matrix()
        points[..., :3] = np.einsum("nij,npj->npi", roll, points[..., :3])
        true = torch.tensor(roll @ rotation[frames], dtype=torch.float32)
        offset = np.einsum("nij,nj->ni", roll, position[frames] - middle) / 10.0
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
def predict(network: PoseNetwork, returns: Returns) -> tuple[np.ndarray, ...]:
    """Return probabilities (frame, model), and of the likeliest model rotations (frame, guess, 3, 3) and origin."""
    rng = np.random.default_rng(0)
    out: list[tuple[np.ndarray, ...]] = []
    for frames in np.array_split(np.arange(len(returns)), 1 + len(returns) // 256):
        points, middle = cloud(returns, frames, POINTS, rng)
        logits, rotation, scores, origin = network(torch.as_tensor(points))
        row, of = torch.arange(len(frames)), logits.argmax(dim=1)
        order = scores[row, of].argsort(dim=1, descending=True)
        out.append((
            logits.softmax(dim=1).numpy(),
            rotation[row, of][row[:, None], order].numpy(),
            middle + 10.0 * origin[row, of].numpy(),
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


def main() -> None:
    options = prepare_torch(parse(__doc__, epochs=100, flags=("no_icp", "search")))
    data = rl.dataset.open(options.dataset)
    returns = load_returns(options.dataset, "train", most=options.most)
    test = load_returns(options.dataset, "test", most=options.most)
    network = train(returns, data.symmetries, options.epochs, options.seed)
    probability, rotations, origin = predict(network, test)
    class_of = np.zeros((len(data.models), len(data.classes)), np.float32)
    class_of[returns.columns["model_id"][returns.has_craft], returns.columns["class_id"][returns.has_craft]] = 1.0
    scores = probability @ class_of
    print(accuracy(test, scores))
    quaternion, position = Rotation.from_matrix(rotations[:, 0]).as_quat(canonical=True), origin
    tabulate(test, data.models, data.symmetries, quaternion, position)
    path = Path(options.output)
    before = str(path.with_stem(f"{path.stem}_before_icp"))
    write(before, options.dataset, test, scores=scores, position_m=position, quaternion_xyzw=quaternion)
    if not options.no_icp:
        position = position.copy()
        meshes, searched = load_meshes(data.models), 0
        half_field_rad = np.arctan((test.columns["intrinsics_px"][:, 2] + 0.5) / test.columns["intrinsics_px"][:, 0])
        for k in np.flatnonzero(test.count >= 6):
            point_m, mesh = test.point_m[test.of(k)].astype(float), meshes[probability[k].argmax()]
            some = point_m[:: max(1, len(point_m) // ICP_POINTS)]
            half = float(half_field_rad[k])
            found, misfit = refine(some, mesh, rotations[k], origin[k], half)
            if options.search:
                other = acquire(some, mesh, count=4, half_field_rad=half)[0]
                if misfit_m(other.pose, mesh, some, find_outline(some), half) < misfit:
                    found, searched = other, searched + 1
            quaternion[k], position[k] = found.pose.rotation.as_quat(canonical=True), found.pose.translation
        print(f"after ICP; in {searched} of {len(test)} frames the search found the better fit")
        tabulate(test, data.models, data.symmetries, quaternion, position)
        write(options.output, options.dataset, test, scores=scores, position_m=position, quaternion_xyzw=quaternion)


if __name__ == "__main__":
    run(main)
