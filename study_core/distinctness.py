"""How far apart two drives look, in lengths of the body that moves.

Nobody can answer which of two drives is better if they look the same, however different their controls are. What
a viewer sees of a body is where its two ends are, so the distance of two of its poses is the root mean square of
how far its front and how far its rear lie apart; the difference of two drives is the root mean square of that over
time, of whichever body differs most. Nothing here is about driving: the poses are those of the domain's scene.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from study_core import distinctness_kernels as kernels
from study_core.domain import Domain
from study_core.errors import DomainError
from study_core.scene import Body, Track


def visible_paths(
    domain: Domain, controls: Float[np.ndarray, "n n_controls"]
) -> Float[np.ndarray, "n n_bodies n_coordinates"]:
    """Returns what a viewer sees of each drive, in coordinates whose Euclidean distance is the visible difference.

    A frame's coordinates are the body's position in body lengths and half the unit vector along it, all divided by the
    root of the number of frames: the mean over front and rear of squared distances is |dp|^2 + (length / 2)^2 |du|^2.

    Args:
        domain: Draws the drives.
        controls: One drive a row.

    Returns:
        float32, which resolves a millionth of a body length.

    Raises:
        DomainError: Two drives have other numbers of bodies or frames, or a body has no size.
    """
    scenes = [domain.scene(row) for row in controls]
    paths = [np.stack([_coordinates(track) for track in scene.tracks]) for scene in scenes]
    shapes = {path.shape for path in paths}
    if len(shapes) > 1:
        raise DomainError(
            f"Expected every scene of '{domain.id}' to have as many tracks and frames, got several: "
            "draw the same bodies for the same time whatever the controls are."
        )
    return np.array(paths, dtype=np.float32)


def visible_difference(
    paths_a: Float[np.ndarray, "n n_bodies n_coordinates"],
    paths_b: Float[np.ndarray, "n n_bodies n_coordinates"],
) -> Float[np.ndarray, " n"]:
    """Returns how far apart drives look, in body lengths: root mean square over time, of the body that differs most.

    Args:
        paths_a: One drive a row, from `visible_paths`.
        paths_b: The drive to compare with each.
    """
    apart = paths_a - paths_b
    squares = np.einsum("nbk,nbk->nb", apart, apart).max(axis=1)
    return np.sqrt(squares, dtype=np.float64)


def distinct_rows(
    paths: Float[np.ndarray, "n n_bodies n_coordinates"], least_difference: float
) -> Int[np.ndarray, " n_distinct"]:
    """Returns the rows of the drives that look different from every earlier drive returned, in order.

    Args:
        paths: From `visible_paths`.
        least_difference: In body lengths; drives no further apart look the same.
    """
    return kernels.distinct_rows(paths, least_difference)


def _coordinates(track: Track) -> Float[np.ndarray, " n_coordinates"]:
    half_ends = 0.5 * np.column_stack([-np.sin(track.yaws_rad), np.cos(track.yaws_rad)])
    frames = np.column_stack([track.positions / _length(track.body), half_ends])
    return frames.ravel() / np.sqrt(len(frames))


def _length(body: Body) -> float:
    """Returns the largest extent of all that is drawn of a body."""
    corners = np.concatenate([np.empty((0, 3)), *(mesh.vertices for mesh in body.meshes)])
    length = float(np.ptp(corners, axis=0).max()) if len(corners) else 0.0
    if length == 0.0:
        raise DomainError(f"Expected body '{body.name}' to have a size, got none. Give it a mesh.")
    return length
