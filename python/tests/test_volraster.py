"""Tests of the package: images against the reference and against the program's, conversion of arrays, errors."""

import os
import pathlib
import struct
import subprocess
import zlib

import numpy as np
import pytest
import volraster

FOG = {"preset": "fog", "range": [0, 1], "tau_scale": 1}
SIZE = (48, 36)


def ball(shape=(14, 16, 18)):
    """A smooth ball, [z, y, x], of other length along each axis."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in shape), indexing="ij")
    return np.exp(-2 * (x * x + y * y + z * z)).astype(np.float32)


def test_an_image_is_near_the_reference():
    scene = volraster.Scene(ball(), spacing=0.125, origin=(-1, -1, -1), transfer=FOG)
    truth = scene.reference(size=SIZE)
    assert truth.shape == (36, 48, 4) and truth.dtype == np.float64 and truth[..., 3].max() > 0.3
    image = scene.render("slices-3d:step=0.25", size=SIZE)
    assert image.rgba.shape == truth.shape and image.rgba.dtype == np.float32
    errors = image.errors(truth)
    assert errors["rmse"] == pytest.approx(np.sqrt(np.mean((image.rgba - truth) ** 2)), rel=1e-6)
    assert 0 < errors["rmse"] < 1e-3 and errors["max"] < 1e-2 and image.ms > 0
    assert image.technique == "slices-3d:step=0.25" and image.counters["slices"] > 10
    # A coarser step is worse.
    assert scene.render("slices-3d:step=4", size=SIZE).errors(truth)["rmse"] > 4 * errors["rmse"]


def test_axes_are_z_y_x_and_spacing_x_y_z():
    volume = np.zeros((8, 8, 8), np.float32)
    volume[:, :, 4:] = 1.0
    camera = {"eye": (3.5, 3.5, 30), "target": (3.5, 3.5, 3.5), "up": (0, 1, 0), "half_height": 8}
    opacity = volraster.render(volume, transfer=FOG, camera=camera, size=SIZE).rgba[..., 3]
    assert opacity[:, 24:].sum() > 7 * opacity[:, :24].sum() > 0
    # Twice as long along y.
    tall = volraster.render(volume, transfer=FOG, camera=camera, size=SIZE, spacing=(1, 2, 1), origin=(0, -3.5, 0)).rgba[..., 3]
    rows, tall_rows = ((image.max(axis=1) > 0).sum() for image in (opacity, tall))
    assert abs(tall_rows - 2 * rows) <= 2


@pytest.mark.parametrize("kind", ["u1", "<u2", ">u2", "<i2", "i4", "f4", ">f8", "?"])
def test_arrays_of_every_type_are_the_same_samples(kind):
    whole = (ball() > 0.5).astype(np.float32)
    wanted = volraster.reference(whole, transfer=FOG, size=SIZE)
    assert np.array_equal(volraster.reference(whole.astype(kind), transfer=FOG, size=SIZE), wanted)
    # Nor does their order in memory matter.
    turned = np.asfortranarray(whole.astype(kind))[::-1]
    assert np.array_equal(volraster.reference(turned, transfer=FOG, size=SIZE), volraster.reference(whole[::-1], transfer=FOG, size=SIZE))


def cube(n):
    """The points of a grid of n cubes along each axis of [-1, 1], and five tetrahedra for each cube."""
    line = np.linspace(-1, 1, n + 1)
    points = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)
    number = lambda i, j, k: (i * (n + 1) + j) * (n + 1) + k
    cells = []
    for i, j, k in np.ndindex(n, n, n):
        v = [number(i + a, j + b, k + c) for a in (0, 1) for b in (0, 1) for c in (0, 1)]
        even = [(0, 3, 5, 6), (1, 0, 3, 5), (2, 0, 3, 6), (4, 0, 5, 6), (7, 3, 5, 6)]
        odd = [(1, 2, 4, 7), (0, 1, 2, 4), (3, 1, 2, 7), (5, 1, 4, 7), (6, 2, 4, 7)]
        cells += [[v[a] for a in cell] for cell in (odd if (i + j + k) % 2 else even)]
    return points, np.array(cells)


@pytest.mark.parametrize("at_cells", [False, True])
def test_meshes_have_scalars_at_points_or_cells(at_cells):
    points, cells = cube(4)
    places = points[cells].mean(axis=1) if at_cells else points
    mesh = volraster.Mesh(points, cells, np.exp(-2 * (places**2).sum(axis=1)))
    scene = volraster.Scene(mesh, transfer=FOG)
    assert scene.kind == "mesh" and {"havs", "projected-tets"} <= set(scene.techniques)
    truth = scene.reference(size=SIZE)
    assert truth[..., 3].max() > 0.3
    for technique in ("havs", "projected-tets"):
        assert scene.render(technique, size=SIZE).errors(truth)["rmse"] < 1e-5


@pytest.mark.parametrize("size", [{}, {"radius": 0.4}, {"radius": "rows"}, {"covariances": "rows"}])
def test_points_have_kernels(size):
    rng = np.random.default_rng(3)
    centres = rng.uniform(-1, 1, (200, 3))
    rows = {"radius": np.full(200, 0.4), "covariances": np.tile((0.02, 0.0, 0.001, 0.01, 0.0, 0.03), (200, 1))}
    size = {key: rows[key] if isinstance(value, str) else value for key, value in size.items()}
    scene = volraster.Scene(volraster.Points(centres, rng.random(200), **size), transfer=FOG)
    truth = scene.reference(size=SIZE)
    assert scene.kind == "points" and truth[..., 3].max() > 0.05
    assert scene.render("splat-ewa", size=SIZE).errors(truth)["rmse"] < 3e-2


def test_kernels_and_modes_are_those_of_scene_files():
    assert volraster.Scene(ball(), kernels={"kernel": "tent"}, transfer=FOG).techniques == ["splat-sheets"]
    greatest = volraster.reference(ball(), transfer={"preset": "mip"}, size=SIZE)
    assert not np.allclose(greatest, volraster.reference(ball(), transfer=FOG, size=SIZE), atol=0.1)


def test_an_error_or_a_budget_chooses_the_technique():
    scene = volraster.Scene(ball(), transfer=FOG)
    truth = scene.reference(size=SIZE)
    fine = scene.render(size=SIZE, max_error=2e-4)
    assert fine.errors(truth)["rmse"] < 4e-4
    assert volraster.render(ball(), transfer=FOG, size=SIZE, budget_ms=1e4).errors(truth)["rmse"] < 1e-3


@pytest.mark.skipif("VOLRASTER_PROGRAM" not in os.environ, reason="VOLRASTER_PROGRAM names no program")
@pytest.mark.parametrize("technique", ["slices-3d:step=0.5", "slabs", "raycast:integrator=exact"])
def test_images_are_those_of_the_program(tmp_path, technique):
    scene = pathlib.Path(__file__).parents[2] / "assets" / "head.json"
    subprocess.run(
        [os.environ["VOLRASTER_PROGRAM"], "render", scene, "--technique", technique, "--size", "64x48", "-o", tmp_path / "program.exr"],
        check=True,
        capture_output=True,
    )
    volraster.Scene.load(scene).render(technique, size=(64, 48)).save(tmp_path / "package.exr")
    assert (tmp_path / "package.exr").read_bytes() == (tmp_path / "program.exr").read_bytes()


def test_cameras_are_dictionaries():
    scene = volraster.Scene(ball(), transfer=FOG)
    camera = scene.camera(SIZE)
    assert np.array_equal(scene.render(camera=camera, size=SIZE).rgba, scene.render(size=SIZE).rgba)
    camera["eye"] = np.asarray(camera["eye"]) * 1.5
    assert not np.array_equal(scene.render(camera=camera, size=SIZE).rgba, scene.render(size=SIZE).rgba)


def decoded(png, channels):
    """The pixels of a PNG of 8 bits, by the filters of its specification."""
    columns, rows = struct.unpack(">II", png[16:24])
    assert png[25] == {3: 2, 4: 6}[channels]
    data, place = b"", 8
    while place < len(png):
        length, kind = struct.unpack(">I4s", png[place : place + 8])
        data += png[place + 8 : place + 8 + length] if kind == b"IDAT" else b""
        place += 12 + length
    lines = np.frombuffer(zlib.decompress(data), np.uint8).reshape(rows, -1)
    out = np.zeros((rows + 1, columns + 1, channels), int)  # with zeros above and to the left
    for y, line in enumerate(lines, 1):
        for x, stored in enumerate(line[1:].reshape(columns, channels), 1):
            left, up, corner = out[y, x - 1], out[y - 1, x], out[y - 1, x - 1]
            distances = [abs(left + up - corner - near) for near in (left, up, corner)]
            paeth = np.choose(np.argmin(distances, axis=0), (left, up, corner))
            out[y, x] = (stored + (0, left, up, (left + up) // 2, paeth)[line[0]]) % 256
    return out[1:, 1:].astype(np.uint8)


def test_images_are_shown_over_an_opaque_background():
    image = volraster.render(ball(), transfer=FOG, size=SIZE)
    assert image.background[3] == 1 and image.srgb8().shape == (36, 48, 3)
    assert np.array_equal(decoded(image._repr_png_(), 3), image.srgb8())


def test_images_are_shown_and_saved(tmp_path):
    image = volraster.render(ball(), transfer=FOG, size=SIZE, background=(0, 0, 0, 0))
    png = image._repr_png_()
    assert png.startswith(b"\x89PNG") and struct.unpack(">II", png[16:24]) == SIZE
    shown = decoded(png, 4)
    assert np.array_equal(shown, image.srgb8())
    assert np.abs(shown[..., 3] / 255 - image.rgba[..., 3]).max() <= 0.5 / 255 + 1e-6
    for name in ("image.png", "image.exr"):
        image.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 100
    assert (tmp_path / "image.png").read_bytes() == png
    assert np.array_equal(np.asarray(image), image.rgba) and "48 x 36" in repr(image)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: volraster.Scene(np.zeros((4, 4))), "data"),
        (lambda: volraster.Scene(np.zeros((4, 4, 4), complex)), "numbers"),
        (lambda: volraster.Scene(np.zeros((1, 4, 4))), "at least"),
        (lambda: volraster.Scene(ball(), spacing=(1, 2)), "broadcast"),
        (lambda: volraster.Scene(ball(), spacing=-1), "spacing"),
        (lambda: volraster.Scene(ball(), transfer={"preset": "mud"}), "mud"),
        (lambda: volraster.Scene(ball(), transfr=FOG), "transfr"),
        (lambda: volraster.Scene(ball(), volume={"file": "head.nrrd"}), "volume: the data is given"),
        (lambda: volraster.Scene(ball(), transfer=FOG, mode={1}), "scene: set"),
        (lambda: volraster.Scene("no-such-file.nrrd"), "no-such-file.nrrd"),
        (lambda: volraster.Scene("head.nrrd", spacing=1), "spacing"),
        (lambda: volraster.render(ball(), "slices-4d"), "slices-4d"),
        (lambda: volraster.render(ball(), "slabs", max_error=1e-3), "one of"),
        (lambda: volraster.render(ball(), "havs"), "havs"),
        (lambda: volraster.render(ball(), size=(0, 4)), "0"),
        (lambda: volraster.Scene(ball()).render(camera={"eye": (0, 0, 9)}), "target"),
        (lambda: volraster.Scene(ball()).render(camera={"eyes": (0, 0, 9)}), "eyes"),
        (lambda: volraster.render(ball(), size=SIZE).errors(np.zeros((4, 4, 4))), "4"),
        (lambda: volraster.Scene(volraster.Mesh([[0, 0, 0]], [[0, 0, 0, 1]], [1])), "cells"),
        (lambda: volraster.Scene(volraster.Mesh([[0, 0, 0]], [[0, 0, 0, -1]], [1])), "cells"),
        (lambda: volraster.Scene(volraster.Mesh(*cube(1), [1.0])), "scalars"),
        (lambda: volraster.Scene(volraster.Points(np.zeros((3, 2)))), "rows of 3"),
        (lambda: volraster.Scene(volraster.Points(np.eye(3), radius=1, covariances=np.zeros((3, 6)))), "both"),
    ],
)
def test_wrong_input_is_named(make, words):
    with pytest.raises((ValueError, RuntimeError)) as raised:
        make()
    assert words in str(raised.value) and "\n" not in str(raised.value), raised.value


def test_techniques_and_device_are_listed():
    assert volraster.techniques()["slices-3d"]["step"][1] == "1"
    assert set(volraster.device()) == {"name", "driver", "vulkan"}
