"""Directions drawn from lobes in NumPy: the oracle of `rso_lidar.scene.materials.lobe`."""

import math

import numpy as np


def across(axis):
    """Return two unit vectors (xyz, path) across unit vectors (xyz, path): Duff et al., JCGT 2017."""
    x, y, z = axis
    sign = np.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.stack([1.0 + sign * x * x * a, sign * b, -sign * x]), np.stack([b, sign + y * y * a, -y])


def mirrored(direction, about):
    """Return the mirror images of directions (xyz, path) about axes (xyz, path)."""
    return 2.0 * (direction * about).sum(axis=0) * about - direction


def draw_directions(uniform, lobe, base, normal, viewer):
    """Return a direction (xyz, path) for each path, as the kernel does."""
    u, v, choice = uniform
    share, exponent, roughness = lobe.T
    of_lobe, of_mirror = choice < share, exponent >= 0.0
    axis = np.where(of_lobe, np.where(of_mirror, mirrored(viewer, normal), normal), base)
    of_half = np.sqrt((1.0 - u) / (1.0 + (roughness**2 - 1.0) * u))
    of_exponent = (1.0 - u) ** (1.0 / (np.maximum(exponent, 0.0) + 1.0))
    cosine = np.where(of_lobe, np.where(of_mirror, of_exponent, of_half), np.sqrt(1.0 - u))
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    one, other = across(axis)
    drawn = sine * (np.cos(2.0 * math.pi * v) * one + np.sin(2.0 * math.pi * v) * other) + cosine * axis
    return np.where(of_lobe & ~of_mirror, mirrored(viewer, drawn), drawn)


def direction_density(direction, lobe, base, normal, viewer):
    """Return the density (path) [1/sr] of directions (xyz, path)."""
    share, exponent, roughness = lobe.T
    by_cosine = np.maximum((base * direction).sum(axis=0), 0.0) / math.pi
    cos_mirror = np.maximum((direction * mirrored(viewer, normal)).sum(axis=0), 0.0)
    n = np.maximum(exponent, 0.0)
    by_exponent = np.where(cos_mirror > 0.0, (n + 1.0) / (2.0 * math.pi) * cos_mirror**n, 0.0)
    half = direction + viewer
    half = half / np.maximum(np.linalg.norm(half, axis=0), 1e-15)
    cos_half, cos_facet = (normal * half).sum(axis=0), (viewer * half).sum(axis=0)
    facets = roughness**2 / (math.pi * (1.0 - (1.0 - roughness**2) * cos_half**2) ** 2)
    by_half = np.where(cos_half > 0.0, facets * cos_half / (4.0 * np.maximum(cos_facet, 5e-16)), 0.0)
    return (1.0 - share) * by_cosine + share * np.where(exponent >= 0.0, by_exponent, by_half)
