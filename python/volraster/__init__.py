"""Direct volume rendering on Vulkan, every technique checked against a float64 reference.

    import numpy as np, volraster
    image = volraster.render(np.load("head.npy"), spacing=(0.7, 0.7, 2), transfer={"preset": "ct-bone"})
    image.save("head.png")
    truth = volraster.reference(np.load("head.npy"), spacing=(0.7, 0.7, 2), transfer={"preset": "ct-bone"})
    image.errors(truth)["rmse"]

A scene is data (an array, a `Mesh`, `Points`, or the name of a data file) and keywords: `transfer`, `camera`, `mode`,
`lighting`, `kernels`, `clip`, `opaque`, `background` and `technique`, each with the value that the key of a scene file
has (docs/SCENES.md), as dictionaries, lists, numbers and strings. What is left out is chosen from the data.

Wrong input raises `ValueError`, what the device lacks `RuntimeError`. The device is the best one, or that whose name
contains the environment variable `VOLRASTER_DEVICE`.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import _native

__all__ = ["Image", "Mesh", "Points", "Scene", "device", "reference", "render", "techniques"]


@dataclass
class Mesh:
    """Tetrahedra with a scalar at each point or for each cell.

    points: (n, 3) places in world units. cells: (m, 4) numbers of points. scalars: n or m of them. Where n equals m,
    they are those of points unless `at_cells` is true. Scalars are rounded to float32; cells without volume are left out.
    """

    points: Any
    cells: Any
    scalars: Any
    at_cells: bool | None = None

    def _scene(self, document: str):
        points = _rows("points", self.points, 3, np.float64)
        cells = _numbers("cells", self.cells)
        if cells.ndim != 2 or cells.shape[1] != 4 or not np.issubdtype(cells.dtype, np.integer):
            raise ValueError(f"cells: {cells.shape} of {cells.dtype}: must be rows of 4 whole numbers")
        if cells.size and not (cells.min() >= 0 and cells.max() < len(points)):
            raise ValueError(f"cells: {cells.min()} to {cells.max()}: must be numbers of {len(points)} points")
        scalars = _row("scalars", self.scalars)
        at_cells = self.at_cells
        if at_cells is None:
            at_cells = len(scalars) == len(cells) and len(scalars) != len(points)
        return _native.Scene.of_mesh(points, np.ascontiguousarray(cells, np.uint32), scalars, at_cells, document)


@dataclass
class Points:
    """Kernels at scattered places.

    centres: (n, 3) in world units. scalars, weights: n of each, or None for 1. radius: the support radius of all kernels
    or of each; covariances: (n, 6) xx, xy, xz, yy, yz, zz, instead of it; without both the radius is estimated from the
    spacing. The keyword `kernels` of a scene sets their shape and model.
    """

    centres: Any
    scalars: Any = None
    radius: Any = None
    covariances: Any = None
    weights: Any = None

    def _scene(self, document: str):
        centres = _rows("centres", self.centres, 3, np.float64)
        if self.radius is not None and self.covariances is not None:
            raise ValueError("points: must have radius or covariances, not both")
        radii = covariances = None
        if self.radius is not None:
            radii = np.ascontiguousarray(np.broadcast_to(_numbers("radius", self.radius), len(centres)), np.float32)
        if self.covariances is not None:
            covariances = _rows("covariances", self.covariances, 6, np.float32)
        scalars, weights = (
            None if row is None else _row(name, row) for name, row in (("scalars", self.scalars), ("weights", self.weights))
        )
        return _native.Scene.of_points(centres, scalars, weights, radii, covariances, document)


@dataclass(eq=False)
class Image:
    """A drawn image. Jupyter shows it.

    rgba: (rows, columns, 4) float32, premultiplied linear red, green, blue and opacity, top row first.
    technique: the technique with the options that differ from their defaults. ms: of a frame, from recording to its end;
    gpu_ms: on the device, None where that has no timestamps. counters: of the plan. background: of `save` and Jupyter.
    """

    rgba: np.ndarray
    technique: str = ""
    ms: float = float("nan")
    gpu_ms: float | None = None
    counters: dict[str, int] = field(default_factory=dict)
    background: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    def __array__(self, dtype=None, copy=None):
        return np.array(self.rgba, dtype=dtype, copy=bool(copy)) if copy else np.asarray(self.rgba, dtype=dtype)

    def __repr__(self) -> str:
        rows, columns, _ = self.rgba.shape
        return f"<volraster image {columns} x {rows}, {self.technique}, {self.ms:.2f} ms>"

    def errors(self, truth: np.ndarray) -> dict[str, float]:
        """Compares the four channels with a truth of the same shape, such as `reference` returns.

        The keys are rmse, max, bias (positive where the image is too bright), p99, p99.9 and above_1_255, the share of
        pixels that are off by more than 1/255.
        """
        names = ("rmse", "max", "bias", "p99", "p99.9", "above_1_255")
        truth = np.ascontiguousarray(truth, np.float64)
        return dict(zip(names, _native.errors(np.ascontiguousarray(self.rgba, np.float32), truth)))

    def srgb8(self) -> np.ndarray:
        """Returns (rows, columns, 3) uint8: sRGB over the background; with straight alpha as a fourth where that is not opaque."""
        flat = _native.srgb8(np.ascontiguousarray(self.rgba, np.float32), self.background)
        return np.frombuffer(bytes(flat), np.uint8).reshape(*self.rgba.shape[:2], -1)

    def save(self, path: str | os.PathLike) -> None:
        """Writes a PNG over the background, or an EXR with all numbers, by the ending of the name."""
        _native.write_image(os.fspath(path), np.ascontiguousarray(self.rgba, np.float32), self.background)

    def _repr_png_(self) -> bytes:
        return bytes(_native.png(np.ascontiguousarray(self.rgba, np.float32), self.background))


class Scene:
    """Data with all that an image needs. The first image takes the data to the device, where it stays.

    data: an array [z, y, x] of scalars, a `Mesh`, `Points`, or the name of a data file. spacing: world units from sample
    to sample of an array along x (its last axis), y and z, or one number; origin: the place of sample [0, 0, 0]. Arrays
    of uint8, uint16, int16 and float32 are taken as they are, others are rounded to float32; NaN is vacuum. keywords: see
    `help(volraster)`.
    """

    def __init__(self, data, *, spacing=None, origin=None, **keywords):
        document = json.dumps(keywords, default=_plain)
        if isinstance(data, (Mesh, Points, str, os.PathLike)) and (spacing, origin) != (None, None):
            raise ValueError("spacing and origin: are those of arrays")
        if isinstance(data, (Mesh, Points)):
            self._native = data._scene(document)
        elif isinstance(data, (str, os.PathLike)):
            self._native = _native.Scene.of_file(os.fspath(data), document)
        else:
            spacing, origin = (
                np.broadcast_to(_numbers(name, given), 3).astype(np.float64).tolist()
                for name, given in (("spacing", 1 if spacing is None else spacing), ("origin", 0 if origin is None else origin))
            )
            self._native = _native.Scene.of_grid(_samples(data), spacing, origin, document)

    @classmethod
    def load(cls, path: str | os.PathLike) -> "Scene":
        """Reads a scene file, or a data file for which everything else is chosen."""
        scene = cls.__new__(cls)
        scene._native = _native.Scene.of_file(os.fspath(path), None)
        return scene

    @property
    def kind(self) -> str:
        """The kind of its data: grid, mesh, points or gaussians."""
        return self._native.kind

    @property
    def range(self) -> tuple[float, float]:
        """The least and the greatest finite scalar."""
        return tuple(self._native.range)

    @property
    def techniques(self) -> list[str]:
        """The techniques that draw the scene."""
        return self._native.techniques()

    @property
    def size(self) -> tuple[int, int]:
        """The width and height of its images, in pixels, where no size is given."""
        return tuple(self._native.image[0])

    def camera(self, size: tuple[int, int] | None = None) -> dict[str, Any]:
        """Returns the camera of an image size, as `render` takes it: the scene's own, or the one that is chosen."""
        eye, target, up, fov, half_height = self._native.camera(self._size(size))
        lens = {"fov_y_deg": fov} if half_height is None else {"half_height": half_height}
        return {"eye": tuple(eye), "target": tuple(target), "up": tuple(up), **lens}

    def render(self, technique=None, *, camera=None, size=None, max_error=None, budget_ms=None) -> Image:
        """Draws an image on the device; the second of two frames is timed.

        technique: NAME or NAME:key=value,..., such as "slabs:step=0.5"; left out: that of the scene, else the default of
        its data. max_error: chooses the fastest technique whose root mean square error against the reference is not
        greater. budget_ms: chooses the most accurate one whose frames take no longer. camera: instead of the scene's.
        size: width and height in pixels.
        """
        if sum(given is not None for given in (technique, max_error, budget_ms)) > 1:
            raise ValueError("render: takes one of technique, max_error and budget_ms")
        rgba, (name, ms, gpu_ms, counters) = self._native.render(
            _camera(camera), self._size(size), technique, max_error, budget_ms
        )
        return Image(rgba, name, ms, gpu_ms, dict(counters), tuple(self._native.image[1]))

    def reference(self, *, camera=None, size=None, samples: int = 1) -> np.ndarray:
        """Computes the image in float64 on the CPU, accurate to 1e-9: (rows, columns, 4) as `Image.rgba`.

        samples: rays along each side of a pixel, averaged; 1 is its centre, which techniques sample.
        """
        return self._native.reference(_camera(camera), self._size(size), samples)

    def _size(self, size) -> tuple[int, int]:
        width, height = self.size if size is None else size
        return int(width), int(height)


def render(data, technique=None, *, size=None, max_error=None, budget_ms=None, **scene) -> Image:
    """Draws data once: `Scene(data, **scene).render(technique, ...)`. Keep a `Scene` to draw several images."""
    return Scene(data, **scene).render(technique, size=size, max_error=max_error, budget_ms=budget_ms)


def reference(data, *, size=None, samples: int = 1, **scene) -> np.ndarray:
    """Computes the image of data in float64: `Scene(data, **scene).reference(...)`."""
    return Scene(data, **scene).reference(size=size, samples=samples)


def device() -> dict[str, str]:
    """Opens the device, and returns its name, its driver and its version of Vulkan."""
    return dict(zip(("name", "driver", "vulkan"), _native.device()))


def techniques() -> dict[str, dict[str, tuple[str, str]]]:
    """Returns for each technique its options, each with allowed values and default."""
    return {name: {key: (values, default) for key, values, default in options} for name, options in _native.techniques()}


def _numbers(name: str, given) -> np.ndarray:
    numbers = np.asarray(given)
    if numbers.dtype.kind not in "biuf":
        raise ValueError(f"{name}: {numbers.dtype}: must be numbers")
    return numbers


def _row(name: str, given) -> np.ndarray:
    row = _numbers(name, given)
    if row.ndim != 1:
        raise ValueError(f"{name}: {row.shape}: must have one axis")
    return np.ascontiguousarray(row, np.float32)


def _rows(name: str, given, width: int, dtype) -> np.ndarray:
    rows = _numbers(name, given)
    if rows.ndim != 2 or rows.shape[1] != width:
        raise ValueError(f"{name}: {rows.shape}: must be rows of {width}")
    return np.ascontiguousarray(rows, dtype)


def _samples(given) -> np.ndarray:
    samples = _numbers("data", given)
    if samples.ndim != 3:
        raise ValueError(f"data: {samples.shape}: an array of samples must have three axes, [z, y, x]")
    native = samples.dtype.newbyteorder("=")
    if native not in (np.uint8, np.uint16, np.int16, np.float32):
        native = np.dtype(np.uint8 if native == np.bool_ else np.float32)
    return np.ascontiguousarray(samples, native)


def _camera(given):
    if given is None:
        return None
    keys = ("eye", "target", "up", "fov_y_deg", "half_height")
    for key in given:
        if key not in keys:
            raise ValueError(f"camera: unknown key {key!r}: must be of {', '.join(keys)}")
    for key in keys[:3]:
        if key not in given:
            raise ValueError(f"camera: {key} is missing")
    places = (np.broadcast_to(_numbers(f"camera {key}", given[key]), 3).astype(np.float64).tolist() for key in keys[:3])
    return (*places, given.get("fov_y_deg"), given.get("half_height"))


def _plain(value):
    """Makes JSON of numbers and arrays of numpy, and of paths."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise ValueError(f"scene: {type(value).__name__}: must be dictionaries, lists, numbers and strings")
