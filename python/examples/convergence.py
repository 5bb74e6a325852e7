"""CT of a tooth, read from raw bytes: halving the step divides the error of slices and slabs by about four."""

import sys

import numpy as np
import volraster

data, picture = sys.argv[1:]
tooth = np.fromfile(f"{data}/structured/tooth/tooth.raw", ">u2").reshape(161, 94, 103)
# From air to enamel; smooth, so that the step alone makes the error.
low, high = np.percentile(tooth, (60, 99.9))
knots = [[low, 0.1, 0.2, 0.5, 0.0], [0.5 * (low + high), 0.8, 0.7, 0.5, 0.02], [high, 1.0, 1.0, 0.9, 0.08]]
scene = volraster.Scene(tooth, transfer=knots, image={"width": 240, "height": 320})
truth = scene.reference()
for technique in ("slices-3d", "slabs"):
    errors = [scene.render(f"{technique}:step={step},filter=exact").errors(truth)["rmse"] for step in (2, 1, 0.5, 0.25)]
    orders = [np.log2(coarse / fine) for coarse, fine in zip(errors, errors[1:])]
    print(f"{technique:10}", *(f"{error:.1e}" for error in errors), " orders", *(f"{order:.1f}" for order in orders))
scene.render("slabs:step=0.25").save(picture)
