//! Suites: lists of scenes with the sweeps that are measured on each.

use super::scenes::{MORE_SCENES, SCENES, SIZE, SMALL, SMOKE_SCENES, StandardScene};
use super::sweeps::{SMOKE, STANDARD, Sweep};
use crate::cli::input::Size;

/// A list of scenes with the sweeps that are measured on each.
#[derive(Debug)]
pub(super) struct Suite {
    pub(super) name: &'static str,
    /// Lists of scenes, measured in this order.
    scenes: &'static [&'static [StandardScene]],
    pub(super) sweeps: &'static [Sweep],
    pub(super) size: Size,
    /// Timed frames per case.
    pub(super) frames: usize,
}

/// All suites.
pub(super) const SUITES: &[Suite] = &[
    Suite { name: "smoke", scenes: &[SMOKE_SCENES], sweeps: SMOKE, size: SMALL, frames: 5 },
    Suite { name: "standard", scenes: &[SCENES], sweeps: STANDARD, size: SIZE, frames: 9 },
    Suite { name: "full", scenes: &[SCENES, MORE_SCENES], sweeps: STANDARD, size: SIZE, frames: 15 },
];

impl Suite {
    /// Returns the scenes.
    pub(super) fn scenes(&self) -> impl Iterator<Item = &'static StandardScene> {
        self.scenes.iter().copied().flatten()
    }
}

#[cfg(test)]
mod tests {
    use volraster::scene::{Data, KernelSize};
    use volraster::technique::Method::{SplatEwa, SplatSheets};

    use super::super::scenes::Shape::{self, Cubes, Gaussians, Points, Samples};
    use super::super::scenes::{GAUSSIANS, UNIT};
    use super::super::sweeps::{DATA, SIZES, SPLATS, Setting, settings};
    use super::*;
    use crate::cli::input;

    #[test]
    fn splats_are_tried_where_they_are_reasonable() {
        let settings = settings(STANDARD).unwrap();
        let of = |shape: Shape| {
            let scene = StandardScene { shape, ..SCENES[3] }.load().unwrap();
            let own = settings.iter().filter(|setting| setting.is_for(&scene));
            own.map(|setting| (setting.technique.method(), input::options_text(&setting.technique)))
                .filter(|(method, _)| SPLATS.contains(method))
                .collect::<Vec<_>>()
        };
        let small = of(Samples(8, "f32", UNIT));
        assert!(small.len() > 3 && small.iter().all(|(method, _)| *method == SplatSheets), "{small:?}");
        assert_eq!(of(Samples(65, "f32", UNIT)), []);
        for shape in [Gaussians(65), Points(9, 0.1)] {
            let all = of(shape);
            assert!(all.contains(&(SplatEwa, "order=center,footprint=ewa".into())), "{all:?}");
            assert!(all.contains(&(SplatSheets, "sheets=axis".into())), "{all:?}");
        }
    }

    #[test]
    fn the_standard_scenes_are_valid() {
        for suite in SUITES {
            let mut names: Vec<&str> = suite.scenes().map(|scene| scene.name).collect();
            let count = names.len();
            assert!(count >= 3, "{}", suite.name);
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), count, "{}", suite.name);
        }
        for scene in [SCENES, MORE_SCENES, SMOKE_SCENES].concat() {
            assert_eq!(scene.views(SIZE).unwrap().len(), scene.views);
            let small = match scene.shape {
                Samples(_, kind, range) => Samples(4, kind, range),
                Gaussians(_) => Gaussians(4),
                Cubes(_) => Cubes(2),
                Points(_, radius) => Points(20, radius),
            };
            let loaded = StandardScene { shape: small, ..scene }.load().unwrap();
            match (scene.shape, &loaded.data) {
                (Samples(_, kind, _), Data::Grid(grid)) => assert_eq!(grid.samples().type_name(), kind),
                (Cubes(_), Data::Mesh(mesh)) => assert_eq!(mesh.cells().len(), 40),
                (Gaussians(_), Data::Grid(_)) => assert_eq!(loaded.kernels, Some(GAUSSIANS)),
                (Points(_, radius), Data::Points(points)) => {
                    assert_eq!(points.size(), &KernelSize::Radius(radius));
                    assert_eq!(points.centres().len(), 20);
                }
                _ => panic!("{}: another kind of data", scene.name),
            }
            assert!(input::drawn(&loaded).is_ok(), "{}", scene.name);
            // Every sweep list has settings for every scene.
            for sweeps in [STANDARD, SMOKE, SIZES, DATA] {
                let settings = settings(sweeps).unwrap();
                let own: Vec<&Setting> = settings.iter().filter(|setting| setting.is_for(&loaded)).collect();
                assert!(own.len() >= 2, "{}", scene.name);
                let splats =
                    own.iter().filter(|setting| SPLATS.contains(&setting.technique.method())).count();
                let has_kernels = matches!(scene.shape, Gaussians(_) | Points(..));
                assert_eq!(splats == own.len(), has_kernels, "{}", scene.name);
            }
            let [lo, hi] = loaded.transfer.domain();
            let range = scene.range();
            assert!(lo >= range[0] && hi <= range[1] && hi > lo, "{}", scene.name);
        }
    }
}
