"""CT of an engine by every technique for grids: errors against the float64 reference, and times."""

import sys

import volraster

data, picture = sys.argv[1:]
scene = volraster.Scene(f"{data}/structured/engine.nii.gz", transfer={"preset": "grey"}, image={"width": 320, "height": 240})
truth = scene.reference()
print(volraster.device()["name"])
for technique in ("slices-2d", "slices-3d", "slabs", "shear-warp", "raycast"):
    image = scene.render(technique)
    errors = image.errors(truth)
    print(f"{technique:12} rmse {errors['rmse']:.1e}  max {errors['max']:.1e}  {image.ms:7.2f} ms")
scene.render("slabs:step=0.5").save(picture)
