//! Images, single pixels and refused input.

use super::*;

#[test]
fn box_filter_is_the_mean_of_its_rays() {
    let scene = marschner_lobb(8);
    let camera = Camera {
        eye: DVec3::new(2.0, 1.5, 3.8),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 42.0 },
    };
    let (coarse, fine) = (View::new(camera, 12, 10).unwrap(), View::new(camera, 24, 20).unwrap());
    let one = ReferenceOptions::default();
    let got = render(&scene, &coarse, &ReferenceOptions { samples: 2 }, None).unwrap();
    let rays = render(&scene, &fine, &one, None).unwrap();
    for y in 0..10 {
        for x in 0..12 {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| rays.pixel(2 * x + i, 2 * y + j));
            same(
                got.pixel(x, y),
                std::array::from_fn(|c| four.iter().map(|p| p[c]).sum::<f64>() / 4.0),
                1e-12,
            );
        }
    }
    // One sample is at the pixel's centre.
    let centre = render(&scene, &coarse, &one, None).unwrap();
    let (o, d) = coarse.ray(DVec2::new(5.5, 4.5));
    same(centre.pixel(5, 4), ray(&scene, o, d, [0.0, f64::INFINITY]).unwrap(), 1e-13);
    assert!(difference(centre.pixel(5, 4), got.pixel(5, 4)) > 1e-4);
    let image = centre.to_image().unwrap();
    assert_eq!((image.width(), image.height()), (12, 10));
    assert_eq!(image.pixel(5, 4), centre.pixel(5, 4).map(num::f32_of));
}

#[test]
fn refuses_bad_options_and_rays_and_reports_every_row() {
    let scene = marschner_lobb(4);
    let camera = Camera {
        eye: DVec3::Z * 4.0,
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Orthographic { half_height: 1.6 },
    };
    let view = View::new(camera, 3, 7).unwrap();
    for samples in [0, 65] {
        let error = render(&scene, &view, &ReferenceOptions { samples }, None).unwrap_err().to_string();
        assert!(error.contains(&format!("{samples}: must be 1 to 64")), "{error}");
    }
    let why = |o, d, range| ray(&scene, o, d, range).unwrap_err().to_string();
    assert!(why(DVec3::NAN, DVec3::X, [0.0, 1.0]).contains("origin"));
    assert!(why(DVec3::ZERO, DVec3::ZERO, [0.0, 1.0]).contains("direction"));
    assert!(why(DVec3::ZERO, DVec3::X, [f64::NAN, 1.0]).contains("range"));
    assert!(ReferenceImage::new(2, 2, vec![[0.0; 4]; 3]).is_err());

    let rows = std::sync::Mutex::new(Vec::new());
    let progress = |done: u32, all: u32| rows.lock().unwrap().push((done, all));
    render(&scene, &view, &ReferenceOptions::default(), Some(&progress)).unwrap();
    let mut rows = rows.into_inner().unwrap();
    rows.sort_unstable();
    assert_eq!(rows, (1..=7).map(|row| (row, 7)).collect::<Vec<_>>());
}

/// Time of the standard image; run with `--release -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement: some seconds in release, minutes otherwise"]
fn measure_time_of_the_standard_image() {
    let camera = Camera {
        eye: DVec3::new(2.0, 1.5, 3.8),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 42.0 },
    };
    let view = View::new(camera, 512, 512).unwrap();
    for n in [128, 256] {
        let scene = marschner_lobb(n);
        let start = std::time::Instant::now();
        let image = render(&scene, &view, &ReferenceOptions::default(), None).unwrap();
        println!(
            "marschner-lobb {n}^3, 512 x 512: {:.2} s, centre {:?}",
            start.elapsed().as_secs_f64(),
            image.pixel(256, 256)
        );
    }
}

/// Single pixels equal those of the image, in any order and number.
#[test]
fn some_pixels_are_those_of_the_image() {
    let transfer = marschner_lobb(2).transfer;
    let mesh = Scene::new(Field::MarschnerLobb.tets(5).unwrap(), transfer);
    for scene in [marschner_lobb(9), mesh] {
        for distance in [1.0, 0.1] {
            let camera = Camera {
                eye: DVec3::new(2.0, 1.5, 3.8) * distance,
                target: DVec3::ZERO,
                up: DVec3::Y,
                projection: Projection::Perspective { fov_y_deg: 42.0 },
            };
            let view = View::new(camera, 23, 17).unwrap();
            let image = render(&scene, &view, &ReferenceOptions::default(), None).unwrap();
            let mut places: Vec<[u32; 2]> = (0..23 * 17).map(|i| [i * 5 % 23, i * 7 % 17]).collect();
            places.push([3, 4]);
            let found = pixels(&scene, &view, &places).unwrap();
            for ([x, y], pixel) in places.into_iter().zip(found) {
                assert_eq!(pixel, image.pixel(x, y), "({x}, {y}) from {distance}");
            }
            let error = pixels(&scene, &view, &[[0, 0], [23, 0]]).unwrap_err().to_string();
            assert!(error.contains("(23, 0): must lie inside 23 x 17"), "{error}");
        }
    }
}
