"""The density of the flow past a blunt fin, on tetrahedra: HAVS and projected tetrahedra."""

import sys

import volraster

data, picture = sys.argv[1:]
scene = volraster.Scene(f"{data}/unstructured/bluntfin_tets.vtu", image={"width": 320, "height": 240})
truth = scene.reference()
for technique in ("havs", "havs:k=2,repair=none", "projected-tets", "abuffer"):
    image = scene.render(technique)
    print(f"{image.technique:22} rmse {image.errors(truth)['rmse']:.1e}  {image.ms:7.2f} ms")
scene.render("havs").save(picture)
