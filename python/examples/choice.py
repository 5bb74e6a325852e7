"""CT of a bonsai: the fastest technique for three errors that are asked for."""

import sys

import volraster

data, picture = sys.argv[1:]
scene = volraster.Scene(f"{data}/structured/bonsai.nii.gz", image={"width": 256, "height": 256})
truth = scene.reference()
for wanted in (1e-2, 3e-3, 1e-3):
    image = scene.render(max_error=wanted)
    print(f"at most {wanted:.0e}: {image.errors(truth)['rmse']:.1e} in {image.ms:.1f} ms by {image.technique}")
image.save(picture)
