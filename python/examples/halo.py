"""A halo of dark matter: the places of its particles, each a Gaussian whose extinction adds to that of the others."""

import sys

import numpy as np
import volraster

data, picture = sys.argv[1:]
centres = np.load(f"{data}/particles/dark_matter_halo.npy")
# Every particle has the same mass: a narrower kernel is denser.
distance = np.linalg.norm(centres - np.median(centres, axis=0), axis=1)
points = volraster.Points(centres, scalars=distance, radius=0.05 + 0.1 * distance)
scene = volraster.Scene(points, image={"width": 160, "height": 160})
truth = scene.reference()
for technique in ("splat-ewa", "splat-ewa:footprint=ewa", "splat-sheets"):
    image = scene.render(technique)
    print(f"{image.technique:24} rmse {image.errors(truth)['rmse']:.1e}  {image.ms:7.2f} ms")
image.save(picture)
