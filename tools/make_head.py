#!/usr/bin/env python3
"""Writes assets/head.nrrd from VolPack's brainsmall.den (see assets/README.md).

    tools/make_head.py brainsmall.den assets/head.nrrd

The input is checked against a known checksum. The gzip stream carries no name and no time stamp, so
the same zlib gives the same bytes, and any zlib the same voxels.
"""

import gzip
import hashlib
import io
import sys

HEADER_BYTES = 62
SIZES = (128, 128, 84)  # x fastest
INPUT_SHA256 = "eebfa050a1775f556718c2c9716cb624bc2270392e82176b1ce4812b36d4f286"

# Index x runs to posterior, y to inferior, z to the subject's right (README: how far that is
# known). Voxels are cubes of unknown size, so a voxel edge is the unit of length and the file names no
# unit. The origin puts the centre of the volume at (0, 0, 0).
NRRD_HEADER = """\
NRRD0004
# MRI of a human head, skull partly removed; see README.md and LICENSE-head.txt beside this file
type: unsigned char
dimension: 3
space: right-anterior-superior
sizes: 128 128 84
space directions: (0,-1,0) (0,0,-1) (1,0,0)
kinds: domain domain domain
encoding: gzip
space origin: (-41.5,63.5,63.5)

"""


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit("usage: make_head.py brainsmall.den OUT.nrrd")
    with open(sys.argv[1], "rb") as file:
        data = file.read()
    if hashlib.sha256(data).hexdigest() != INPUT_SHA256:
        sys.exit(f"{sys.argv[1]}: not the brainsmall.den this script was written for")
    voxels = data[HEADER_BYTES:]
    assert len(voxels) == SIZES[0] * SIZES[1] * SIZES[2]

    packed = io.BytesIO()
    with gzip.GzipFile(filename="", mode="wb", compresslevel=9, fileobj=packed, mtime=0) as stream:
        stream.write(voxels)
    with open(sys.argv[2], "wb") as file:
        file.write(NRRD_HEADER.encode("ascii"))
        file.write(packed.getvalue())


if __name__ == "__main__":
    main()
