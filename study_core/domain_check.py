"""The checker that every domain plug-in is run through, built-in or not.

    check_domain(my_domain, np.random.default_rng(0))

It passes silently, or raises `DomainError` at the first breach: what was expected, what came, what to do.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float

from study_core.distinctness import visible_paths
from study_core.domain import Domain
from study_core.errors import DomainError
from study_core.scene import Mesh, Scene, Track

_N_TRAJECTORIES = 6
_N_RANDOM_WEIGHTS = 3

# Batched and one by one may differ in the order of their sums, not by more.
_SAME = 1e-10

# Central differences are good to about 1e-8 for smooth features of size 1; a wrong gradient is off by far more.
_RELATIVE_STEP = 1e-6
_GRADIENT_TOLERANCE = 1e-5

_VERSIONED = re.compile(r".+-v\d+")
_HEX_COLOUR = re.compile(r"#[0-9a-fA-F]{6}([0-9a-fA-F]{2})?")

_MEMBERS = (
    "id",
    "feature_names",
    "feature_labels",
    "rich_feature_names",
    "network_input_names",
    "control_lower",
    "control_upper",
    "rollout",
    "features",
    "rich_features",
    "network_inputs",
    "reward_and_gradient",
    "scene",
)

_T = TypeVar("_T")


def check_domain(domain: object, rng: np.random.Generator) -> None:
    """Verifies the contract of `study_core.domain.Domain`.

    Checks attributes and shapes; that every method is finite, deterministic, leaves its inputs alone and gives a
    batch what it gives one trajectory; that the reward is w . Phi and its gradient agrees with central differences;
    that the scene can be drawn; and that the bodies of any two drives can be compared.

    Args:
        domain: The plug-in.
        rng: Draws the controls and weights that it is tried on.

    Raises:
        DomainError: The first breach found, with the name of the attribute or method.
    """
    checked = _check_attributes(domain)
    lower, upper = checked.control_lower, checked.control_upper
    # Strictly inside the bounds, where central differences are defined.
    controls = lower + (upper - lower) * rng.uniform(0.05, 0.95, (_N_TRAJECTORIES, len(lower)))
    states = _check_rollout(checked, controls)
    _check_features(checked, states)
    _check_rewards(checked, controls, rng)
    # The corners of the bounds are legal too.
    for drive in (*controls, lower, upper):
        _check_scene(checked, drive)
    visible_paths(checked, controls)


def _check_attributes(domain: object) -> Domain:
    if not isinstance(domain, Domain):
        missing = [name for name in _MEMBERS if not hasattr(domain, name)]
        raise DomainError(f"Expected a domain; {domain!r} lacks: {', '.join(missing)}. Add what is missing.")
    if not isinstance(domain.id, str) or not _VERSIONED.fullmatch(domain.id):
        raise DomainError(
            f"Expected an `id` that ends in a version, such as driving-v1, got {domain.id!r}. Add one."
        )
    for attribute in ("feature_names", "feature_labels", "rich_feature_names", "network_input_names"):
        _check_names(attribute, getattr(domain, attribute))
    for attribute in ("control_lower", "control_upper"):
        _check_array(f"`{attribute}`", getattr(domain, attribute), (None,))
    lower, upper = domain.control_lower, domain.control_upper
    if lower.shape != upper.shape or len(lower) == 0 or not (lower < upper).all():
        raise DomainError(
            f"Expected `control_lower` below `control_upper` for each control, got {lower} and {upper}. "
            "Give each control a range."
        )
    return domain


def _check_names(attribute: str, names: Any) -> None:
    are_names = isinstance(names, tuple) and all(isinstance(name, str) and name for name in names)
    if not are_names or not names or len(set(names)) != len(names):
        raise DomainError(
            f"Expected `{attribute}` to be a tuple of different names, got {names!r}. Name each once."
        )


def _check_array(what: str, values: Any, shape: tuple[int | None, ...]) -> None:
    """Checks dtype, shape (None is any size) and finiteness."""
    if not isinstance(values, np.ndarray) or values.dtype != np.float64:
        came = values.dtype if isinstance(values, np.ndarray) else type(values).__name__
        raise DomainError(f"Expected {what} to be an array of float64, got {came}. Convert it.")
    is_shape = len(values.shape) == len(shape) and all(
        wanted is None or size == wanted for size, wanted in zip(values.shape, shape, strict=True)
    )
    if not is_shape:
        wanted_text = ", ".join("any" if size is None else str(size) for size in shape)
        raise DomainError(
            f"Expected {what} of shape ({wanted_text}), got {values.shape}. Change one or the other."
        )
    if not np.isfinite(values).all():
        raise DomainError(
            f"Expected {what} to be finite, got NaN or infinity. Keep it finite within the bounds."
        )


def _called(what: str, method: Callable[..., _T], *inputs: np.ndarray) -> _T:
    """Returns what a method gives for copies of its inputs, which it must not modify."""
    copies = [values.copy() for values in inputs]
    try:
        result = method(*copies)
    # A plug-in may raise anything; its author wants to know from which method.
    except Exception as error:
        raise DomainError(
            f"Expected `{what}` to return, but it raised {error!r}. Make it accept these inputs."
        ) from error
    if any(not np.array_equal(copy, values) for copy, values in zip(copies, inputs, strict=True)):
        raise DomainError(
            f"Expected `{what}` to leave its inputs alone, but it changed them. Work on a copy."
        )
    return result


def _check_batched(
    what: str,
    method: Callable[..., np.ndarray],
    inputs: tuple[np.ndarray, ...],
    shape: tuple[int | None, ...],
) -> np.ndarray:
    """Checks one method's array: shape, determinism, and that a batch is the same as one by one; returns it."""
    n = len(inputs[0])
    result = _called(what, method, *inputs)
    _check_array(f"the result of `{what}`", result, (n, *shape))
    kept = result.copy()
    one_by_one = []
    for i in range(n):
        single = _called(what, method, *(values[i : i + 1] for values in inputs))
        _check_array(f"the result of `{what}` for one trajectory", single, (1, *kept.shape[1:]))
        one_by_one.append(single.copy())
    _called(what, method, *(values[::-1] for values in inputs))
    if not np.array_equal(result, kept):
        raise DomainError(
            f"Expected `{what}` to return a new array, but a later call changed it. Return a copy."
        )
    if not np.array_equal(_called(what, method, *inputs), kept):
        raise DomainError(
            f"Expected `{what}` to be deterministic; the same inputs gave another result. Remove chance and state."
        )
    worst = float(np.abs(np.concatenate(one_by_one) - kept).max(initial=0.0))
    if worst > _SAME * max(1.0, float(np.abs(kept).max())):
        raise DomainError(
            f"Expected `{what}` to give each trajectory of a batch what it gives that trajectory alone; they differ by "
            f"{worst:.1e}. Keep the rows independent."
        )
    return kept


def _check_rollout(domain: Domain, controls: np.ndarray) -> np.ndarray:
    states = _check_batched("rollout", domain.rollout, (controls,), (None, None))
    if 0 in states.shape:
        raise DomainError(
            f"Expected `rollout` to return at least one step and state, got shape {states.shape}. Add one."
        )
    return states


def _check_features(domain: Domain, states: np.ndarray) -> None:
    n_steps = states.shape[1]
    _check_batched("features", domain.features, (states,), (len(domain.feature_names),))
    if len(domain.feature_labels) != len(domain.feature_names):
        raise DomainError(
            f"Expected `feature_labels` to have one label for each of {len(domain.feature_names)} features, got "
            f"{len(domain.feature_labels)}. Say in a few words what each is."
        )
    _check_batched("rich_features", domain.rich_features, (states,), (len(domain.rich_feature_names),))
    _check_batched(
        "network_inputs", domain.network_inputs, (states,), (n_steps, len(domain.network_input_names))
    )


def _check_rewards(domain: Domain, controls: np.ndarray, rng: np.random.Generator) -> None:
    """Checks reward and gradient under each feature alone and under random mixtures, every row with its own weights."""
    n_features = len(domain.feature_names)
    weights = np.vstack([np.eye(n_features), rng.uniform(0.1, 1.0, (_N_RANDOM_WEIGHTS, n_features))])
    n_weights = len(weights)
    all_controls = np.tile(controls, (n_weights, 1))
    all_weights = np.repeat(weights, len(controls), axis=0)
    inputs = (all_controls, all_weights)
    _check_pair(_called("reward_and_gradient", domain.reward_and_gradient, *inputs))
    rewards = _check_batched(
        "reward_and_gradient", lambda *given: domain.reward_and_gradient(*given)[0], inputs, ()
    )
    gradients = _check_batched(
        "reward_and_gradient",
        lambda *given: domain.reward_and_gradient(*given)[1],
        inputs,
        (controls.shape[1],),
    )
    expected = (domain.features(domain.rollout(all_controls)) * all_weights).sum(axis=1)
    worst = float(np.abs(rewards - expected).max())
    if worst > _SAME * max(1.0, float(np.abs(expected).max())):
        raise DomainError(
            f"Expected the reward of `reward_and_gradient` to be w . features(rollout(controls)); it is off by "
            f"{worst:.1e}. Compute both from the same formulas."
        )
    differences = np.repeat(_central_differences(domain, controls)[None], n_weights, axis=0)
    slopes = (differences.reshape(-1, *differences.shape[2:]) @ all_weights[:, :, None])[:, :, 0]
    _check_gradient(gradients, slopes)


def _check_pair(result: Any) -> None:
    if not isinstance(result, tuple) or len(result) != 2:
        came = type(result).__name__
        raise DomainError(
            f"Expected `reward_and_gradient` to return rewards and gradients, got one {came}. Return both."
        )


def _check_gradient(gradients: np.ndarray, slopes: np.ndarray) -> None:
    errors = np.abs(gradients - slopes)
    row, control = np.unravel_index(errors.argmax(), errors.shape)
    if errors[row, control] > _GRADIENT_TOLERANCE * max(1.0, float(np.abs(slopes).max())):
        raise DomainError(
            f"Expected the gradient of `reward_and_gradient` in control {control} to be {slopes[row, control]:.6g} "
            f"(central difference), got {gradients[row, control]:.6g}. Derive it again, or differentiate automatically."
        )


def _central_differences(
    domain: Domain, controls: np.ndarray
) -> Float[np.ndarray, "n n_controls n_features"]:
    """Returns the slope of every feature in every control."""
    n, n_controls = controls.shape
    steps = _RELATIVE_STEP * (domain.control_upper - domain.control_lower)
    moved = np.repeat(controls[:, None], n_controls, axis=1)
    ahead, behind = moved + np.diag(steps), moved - np.diag(steps)
    rise = domain.features(domain.rollout(ahead.reshape(-1, n_controls))) - domain.features(
        domain.rollout(behind.reshape(-1, n_controls))
    )
    return rise.reshape(n, n_controls, -1) / (2.0 * steps[:, None])


def _check_scene(domain: Domain, controls: np.ndarray) -> None:
    scene = _called("scene", domain.scene, controls)
    if not isinstance(scene, Scene) or not scene.tracks:
        raise DomainError(
            f"Expected `scene` to return a Scene with at least one track, got {scene!r}. Add a track."
        )
    if not (np.isfinite(scene.dt_s) and scene.dt_s > 0.0):
        raise DomainError(
            f"Expected the scene's `dt_s` to be positive, got {scene.dt_s}. Give the seconds of a frame."
        )
    _check_colour("background", scene.background)
    for track in scene.tracks:
        _check_track(track)
        for mesh in track.body.meshes:
            _check_mesh(f"body '{track.body.name}'", mesh)
    for mesh in scene.ground:
        _check_mesh("ground", mesh)
    lengths = sorted({len(track.positions) for track in scene.tracks})
    if len(lengths) > 1:
        raise DomainError(
            f"Expected all tracks of the scene to have as many frames, got {lengths}. Pad or cut them."
        )
    _check_bounds(scene)
    _check_same_scene(scene, _called("scene", domain.scene, controls))


def _check_track(track: Track) -> None:
    what = f"of track '{track.body.name}'"
    _check_array(f"the positions {what}", track.positions, (None, 3))
    _check_array(f"the yaws {what}", track.yaws_rad, (len(track.positions),))
    if len(track.positions) == 0:
        raise DomainError(f"Expected at least one frame {what}, got none. Include the start.")


def _check_mesh(where: str, mesh: Mesh) -> None:
    _check_colour(where, mesh.colour)
    _check_array(f"the vertices of a mesh of the {where}", mesh.vertices, (None, 3))
    triangles, n_vertices = mesh.triangles, len(mesh.vertices)
    is_shape = triangles.ndim == 2 and triangles.shape[1] == 3 and np.issubdtype(triangles.dtype, np.integer)
    if not is_shape or (triangles < 0).any() or (triangles >= n_vertices).any():
        raise DomainError(
            f"Expected the triangles of a mesh of the {where} to be rows of 3 indices below {n_vertices}. "
            "Mend the mesh."
        )


def _check_colour(where: str, colour: Any) -> None:
    if not isinstance(colour, str) or not _HEX_COLOUR.fullmatch(colour):
        raise DomainError(
            f"Expected the colour of the {where} in hex, such as #1f5fd0, got {colour!r}. Write it so."
        )


def _check_bounds(scene: Scene) -> None:
    bounds = scene.bounds
    edges = np.array([bounds.x_min, bounds.x_max, bounds.y_min, bounds.y_max])
    if not np.isfinite(edges).all() or bounds.x_min >= bounds.x_max or bounds.y_min >= bounds.y_max:
        raise DomainError(
            f"Expected finite bounds of some size, got {bounds}. Order them as minimum, maximum."
        )
    for track in scene.tracks:
        x, y = _reach(track)
        if (
            x.min() < bounds.x_min
            or x.max() > bounds.x_max
            or y.min() < bounds.y_min
            or y.max() > bounds.y_max
        ):
            raise DomainError(
                f"Expected the scene's bounds to hold all of '{track.body.name}' at every frame, got {bounds}. "
                "Widen them."
            )


def _reach(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """Returns x and y of the body's origin and of all its corners at every frame, each `(n_frames, n_points)`."""
    corners = np.vstack([np.zeros((1, 3)), *(mesh.vertices for mesh in track.body.meshes)])
    sine, cosine = np.sin(track.yaws_rad)[:, None], np.cos(track.yaws_rad)[:, None]
    x = track.positions[:, :1] + cosine * corners[:, 0] - sine * corners[:, 1]
    y = track.positions[:, 1:2] + sine * corners[:, 0] + cosine * corners[:, 1]
    return x, y


def _check_same_scene(first: Scene, second: Scene) -> None:
    """What a person is shown is recorded by its hash, so the same drive must look the same."""
    is_same = (
        first.dt_s == second.dt_s
        and first.bounds == second.bounds
        and len(first.tracks) == len(second.tracks)
    )
    for one, other in zip(first.tracks, second.tracks, strict=False):
        is_same = is_same and np.array_equal(one.positions, other.positions)
        is_same = is_same and np.array_equal(one.yaws_rad, other.yaws_rad)
    if not is_same:
        raise DomainError(
            "Expected `scene` to be deterministic; the same drive gave another scene. Remove chance and state."
        )
