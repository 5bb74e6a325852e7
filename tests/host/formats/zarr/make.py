"""Writes the images in this folder with the packages zarr (3.1) and numcodecs: an independent writer. Run: python3 make.py"""

import shutil
from pathlib import Path

import numcodecs
import numpy as np
import zarr
from zarr.codecs import BloscCodec, BytesCodec, GzipCodec, ZstdCodec

HERE = Path(__file__).parent
X, Y, Z = 24, 16, 16


def whole():
    z, y, x = np.mgrid[0:Z, 0:Y, 0:X]
    return 2 * x + 3 * y + (z * z) // 2


def levels(finest):
    """Five levels, each the mean of eight samples, rounded down."""
    all = [finest]
    for _ in range(4):
        fine = all[-1]
        parts = [fine[..., a::2, b::2, c::2] for a in (0, 1) for b in (0, 1) for c in (0, 1)]
        least = [min(part.shape[axis] for part in parts) for axis in (-3, -2, -1)]
        parts = [part[..., : least[0], : least[1], : least[2]] for part in parts]
        total = sum(part.astype(np.int64) for part in parts)
        all.append(total // 8)
    return all


def axes(lead):
    kinds = {"t": "time", "c": "channel"}
    listed = [{"name": name, "type": kinds[name]} for name in lead]
    return listed + [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]


def multiscales(lead, origin):
    """Each level is twice as coarse; its first sample is the middle of the eight."""
    scale = [1.0] * len(lead)
    at = [0.0] * len(lead)
    datasets = []
    for i in range(5):
        step = 2.0**i
        middle = (step - 1) / 2
        own = [0.5 * step, 0.25 * step, 0.2 * step]
        place = [o + middle * s for o, s in zip(origin, [0.5, 0.25, 0.2])]
        steps = [{"type": "scale", "scale": scale + own}]
        if any(place):
            steps.append({"type": "translation", "translation": at + place})
        datasets.append({"path": str(i), "coordinateTransformations": steps})
    return {"axes": axes(lead), "datasets": datasets, "name": "made"}


def image(name, version, lead, finest, dtype, origin=(0, 0, 0), more=None, **options):
    folder = HERE / name
    shutil.rmtree(folder, ignore_errors=True)
    group = zarr.create_group(folder, zarr_format=version)
    scales = multiscales(lead, origin)
    if version == 2:
        group.attrs.update({"multiscales": [{"version": "0.4", **scales}], **(more or {})})
    else:
        group.attrs.update({"ome": {"version": "0.5", "multiscales": [scales], **(more or {})}})
    for i, level in enumerate(levels(finest)):
        options["chunks"] = (1,) * len(lead) + (8, 8, 8)
        if "shards" in options:
            options["shards"] = (1,) * len(lead) + (16, 16, 16)
        if version == 3:
            options["dimension_names"] = [*lead, "z", "y", "x"]
        array = group.create_array(str(i), shape=level.shape, dtype=dtype, **options)
        array[...] = level.astype(dtype)


v2 = {"compressors": numcodecs.Blosc(cname="lz4", clevel=5, shuffle=1), "chunk_key_encoding": {"name": "v2", "separator": "/"}}
image("blosc-v2.zarr", 2, "", whole(), "uint8", **v2)
labels = {"omero": {"channels": [{"label": "nuclei"}, {"label": "membrane"}]}}
two = np.stack([whole(), 1000 - whole()])
image("shards-v3.zarr", 3, "c", two, "uint16", (3, 2, 1), labels, shards=True, compressors=ZstdCodec(level=9))
image("gzip-v3.zarr", 3, "t", np.stack([whole(), whole() + 7]), "float32", compressors=GzipCodec(level=9))

plain = HERE / "plain-v2.zarr"
shutil.rmtree(plain, ignore_errors=True)
array = zarr.create_array(
    plain, shape=(Z, Y, X), chunks=(10, 10, 10), dtype=">i2", zarr_format=2, order="F",
    compressors=numcodecs.Zlib(level=9), fill_value=-5,
)
array[:10] = -whole()[:10]
