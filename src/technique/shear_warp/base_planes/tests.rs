use glam::{DMat3, DQuat, DVec2, DVec3};

use crate::num;
use crate::scene::{Camera, Grid, Projection, Samples, View};
use crate::technique::shear_warp::base_plane::BasePlane;
use crate::technique::shear_warp::base_planes::{Capacity, base_planes};
use crate::technique::shear_warp::options::Intermediate;
use crate::technique::shear_warp::region::MOST_SHEAR;

/// Numbers in [0, 1), the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        num::f64_of_u64(self.0 >> 11) / 9_007_199_254_740_992.0
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn below(&mut self, n: u32) -> u32 {
        num::u32_of((self.next() * f64::from(n)).floor())
    }

    /// In the ball of radius 1.
    fn vector(&mut self) -> DVec3 {
        loop {
            let v = DVec3::from_array([0; 3].map(|_| self.between(-1.0, 1.0)));
            if v.length_squared() <= 1.0 {
                return v;
            }
        }
    }
}

fn grid(dims: [u32; 3], spacing: DVec3, direction: DMat3) -> Grid {
    let count = num::index(dims.iter().product());
    let grid = Grid::new(dims, Samples::U8(vec![0; count])).unwrap();
    grid.with_placement(spacing, DVec3::new(0.4, -0.3, 0.7), direction).unwrap()
}

/// Upright, stretched, turned, mirrored and sheared lattices of unlike sizes.
fn lattice(random: &mut Random, kind: u32) -> Grid {
    let dims = [0; 3].map(|_| 2 + random.below(40));
    let spacing = DVec3::from_array([0; 3].map(|_| random.between(0.02, 0.1)));
    let turn =
        DMat3::from_quat(DQuat::from_axis_angle(random.vector().normalize(), random.between(0.0, 6.0)));
    let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    let shear = DMat3::from_cols(
        DVec3::X,
        DVec3::new(random.between(-0.6, 0.6), 1.0, 0.0),
        DVec3::new(random.between(-0.6, 0.6), random.between(-0.6, 0.6), 1.0),
    );
    match kind % 5 {
        0 => grid(dims, DVec3::splat(spacing.x), DMat3::IDENTITY),
        1 => grid(dims, spacing, DMat3::IDENTITY),
        2 => grid(dims, spacing, turn),
        3 => grid(dims, spacing, turn * mirror),
        _ => grid(dims, spacing, turn * mirror * shear),
    }
}

/// An eye at one of `places`: far, near a face, inside, and exactly on a lattice point, a face, an edge or the centre.
fn view_of(random: &mut Random, grid: &Grid, place: u32, parallel: bool) -> View {
    let last = grid.last_index();
    let inside = DVec3::from_array([0; 3].map(|_| random.next())) * last;
    let size = (grid.index_to_world() * last).length();
    let eye = match place {
        0 => grid.centre() + random.vector().normalize() * size * random.between(0.7, 30.0),
        1 => grid.world_of_index(DVec3::new(inside.x, inside.y, last.z + random.between(0.01, 2.0))),
        2 => grid.world_of_index(inside),
        3 => grid.world_of_index(inside.floor()),
        4 => grid.world_of_index(DVec3::new(inside.x, last.y, inside.z)),
        5 => grid.world_of_index(DVec3::new(0.0, inside.y, last.z)),
        // Where one plane just serves, or just does not.
        6 => {
            let [x, y, z] = [0, 1, 2].map(|axis| grid.index_to_world().col(axis) * last[axis] * 0.5);
            let away = z.length() + x.length().max(y.length()) / random.between(1.0, 1.5);
            grid.centre() + z.normalize() * away
        }
        _ => grid.centre(),
    };
    let target = match place {
        0 | 1 | 6 => grid.centre() + random.vector() * size * 0.4,
        _ => eye + random.vector().normalize(),
    };
    let projection = if parallel {
        Projection::Orthographic { half_height: size * random.between(0.1, 0.7) }
    } else {
        Projection::Perspective { fov_y_deg: random.between(5.0, 160.0) }
    };
    let camera = Camera { eye, target, up: random.vector().normalize(), projection };
    View::new(camera, 3 + random.below(30), 3 + random.below(30)).unwrap()
}

/// Length of a ray inside the domain, in units of the domain's size.
fn chord(grid: &Grid, view: &View, pixel: DVec2) -> f64 {
    let (origin, direction) = view.ray(pixel);
    let to_index = grid.index_to_world().inverse();
    let half = grid.last_index() * 0.5;
    let (o, d) = (to_index * (origin - grid.centre()), to_index * direction);
    let mut range = [if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY];
    for axis in 0..3 {
        let (a, b) = ((-half[axis] - o[axis]) / d[axis], (half[axis] - o[axis]) / d[axis]);
        range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
    }
    (range[1] - range[0]) / (grid.index_to_world() * (half * 2.0)).length()
}

/// Whether a pixel, from the image's centre, is a plane's; and whether another may claim it as well.
fn owns(plane: &BasePlane, pixel: DVec2) -> (bool, bool) {
    let s = plane.steepness * pixel.extend(1.0);
    let side = s.y.abs().max(s.z.abs());
    let in_front = (plane.to_texel * pixel.extend(1.0)).z > 0.0;
    let alone = plane.steepness == DMat3::ZERO;
    (in_front && (alone || s.x >= side), !alone && (s.x - side).abs() < 1e-9 * s.abs().max_element())
}

/// Returns the point of a texel's ray at a depth, in the world.
fn on_line(grid: &Grid, plane: &BasePlane, texel: DVec2, z: f64) -> DVec3 {
    // The middle as shaders have it.
    let t = texel - DVec2::from_array(plane.size.map(|side| f64::from(side / 2)));
    let p = plane.q + plane.step_q * t + z * (plane.d + plane.step_d * t);
    let mut index = DVec3::ZERO;
    index[plane.axis] = plane.sign * z;
    index[(plane.axis + 1) % 3] = p.x;
    index[(plane.axis + 2) % 3] = p.y;
    grid.centre() + grid.index_to_world() * index
}

/// Capacity for so many texels, however they lie.
fn of(texels: f64) -> Capacity {
    Capacity { texels, side: 1e9, rows: 1e9 }
}

/// Every pixel that sees the domain belongs to one plane, whose lattice holds its ray exactly, at least one texel from the edge.
/// No shear and no number of texels exceeds its limit.
#[test]
fn every_pixel_s_line_lies_on_one_base_plane() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut seen, mut parted, mut alone, mut worst) = (0, 0, 0, 0.0_f64);
    for turn in 0..2400 {
        let grid = lattice(&mut random, turn);
        let (place, parallel) = (turn / 5 % 8, turn / 40 % 4 == 0);
        let view = view_of(&mut random, &grid, place, parallel);
        let resolution = match turn / 160 % 4 {
            0 => Intermediate::Voxel,
            1 => Intermediate::Auto,
            2 => Intermediate::Pixel(1.0),
            _ => Intermediate::Pixel(random.between(0.3, 3.0)),
        };
        let what = format!("{turn}: {view:?} {resolution:?} {:?} {}", grid.dims(), grid.index_to_world());
        // What a buffer holds, or so few that texels must be coarser.
        let room = if turn % 3 == 0 { 900.0 } else { 1e6 };
        let planes = base_planes(&grid, &view, None, 0.0, resolution, of(room))
            .unwrap_or_else(|error| panic!("{what}: {error}"));
        let normals = crate::technique::grid::slices_2d::planes(&grid).map(|(normal, _)| normal);
        let [width, height] = view.extent().map(f64::from);
        if planes.len() > 1 {
            parted += 1;
        } else {
            alone += u32::from(!parallel && !planes.is_empty());
        }

        let texels: f64 = planes.iter().map(|p| f64::from(p.size[0]) * f64::from(p.size[1])).sum();
        assert!(texels <= room, "{what}: {texels} texels");

        for y in 0..view.extent()[1] {
            for x in 0..view.extent()[0] {
                let pixel = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
                if chord(&grid, &view, pixel) < 1e-7 {
                    continue;
                }
                seen += 1;
                let from_centre = pixel - DVec2::new(width, height) * 0.5;
                let owners: Vec<&BasePlane> =
                    planes.iter().filter(|plane| owns(plane, from_centre).0).collect();
                let tie = planes.iter().any(|plane| owns(plane, from_centre).1);
                assert!(owners.len() == 1 || tie && owners.len() < 4, "{what} {pixel}: {owners:?}");
                let (origin, direction) = view.ray(pixel);
                for plane in owners {
                    let p = plane.to_texel * from_centre.extend(1.0);
                    let texel = p.truncate() / p.z;
                    let size = DVec2::new(f64::from(plane.size[0]), f64::from(plane.size[1]));
                    assert!(
                        texel.cmpge(DVec2::ONE - 1e-6).all() && texel.cmple(size - 2.0 + 1e-6).all(),
                        "{what} {pixel}: texel {texel} of {size}"
                    );

                    // The ray, in lengths of the domain and with the rounding of the eye's distance.
                    let half = 0.5 * grid.last_index()[plane.axis];
                    let [near, far] = [-half, half].map(|z| on_line(&grid, plane, texel, z));
                    let span = grid.index_to_world() * grid.last_index();
                    let scale = span.length() + (origin - grid.centre()).length() + (far - near).length();
                    for point in [near, far] {
                        let off = (point - origin).reject_from_normalized(direction).length() / scale;
                        worst = worst.max(off);
                        assert!(off < 1e-9, "{what} {pixel}: {off:e} off");
                    }
                    let along = (far - near).normalize();
                    assert!(along.dot(direction) > 0.0, "{what} {pixel}: backwards");
                    assert!(along.cross(direction).length() < 1e-9, "{what} {pixel}: {along} {direction}");

                    let [n, u, v] = [0, 1, 2].map(|i| direction.dot(normals[(plane.axis + i) % 3]).abs());
                    let limit = match (planes.len(), parallel) {
                        (1, false) => MOST_SHEAR,
                        // The steepest planes, or the ray's own pyramid.
                        _ => 1.0,
                    };
                    assert!(u.max(v) <= n * limit * (1.0 + 1e-9), "{what} {pixel}: shear {}", u.max(v) / n);

                    if view.is_perspective() {
                        let to_index = grid.index_to_world().inverse();
                        let eye = to_index * (view.camera().eye - grid.centre());
                        let off = plane.near - plane.sign * eye[plane.axis];
                        let scale = eye.length() + grid.last_index().length();
                        assert!(off.abs() < 1e-9 * scale, "{what}: the eye is {off:e} off");
                    } else {
                        assert_eq!(plane.near, f64::NEG_INFINITY);
                    }
                }
            }
        }
    }
    println!("{seen} pixels of {alone} views with one plane and {parted} with several; {worst:.1e} off");
    assert!(seen > 300_000 && alone > 100 && parted > 400, "{seen} {alone} {parted}");
}

/// Along an axis a texel a pixel falls on the pixels' centres: the warp only copies.
#[test]
fn seen_along_an_axis_texels_are_pixels() {
    let grid = grid([9, 12, 10], DVec3::new(0.1, 0.2, 0.15), DMat3::IDENTITY);
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            for (width, height) in [(33, 26), (20, 31), (1, 1)] {
                for projection in [
                    Projection::Orthographic { half_height: 1.3 },
                    Projection::Perspective { fov_y_deg: 37.0 },
                ] {
                    let eye = grid.centre() + DVec3::AXES[axis] * sign * 4.0 + DVec3::new(0.03, -0.02, 0.05);
                    let camera = Camera {
                        eye,
                        target: eye - DVec3::AXES[axis] * sign,
                        up: DVec3::AXES[(axis + 1) % 3],
                        projection,
                    };
                    let view = View::new(camera, width, height).unwrap();
                    let planes =
                        base_planes(&grid, &view, None, 0.0, Intermediate::Pixel(1.0), of(1e6)).unwrap();
                    assert_eq!(planes.len(), 1);
                    let plane = planes[0];
                    assert_eq!((plane.axis, plane.sign), (axis, -sign));
                    // A pixel larger than all that is seen has more texels.
                    assert!(width == 1 || (plane.texels_per_pixel - 1.0).abs() < 1e-9, "{plane:?}");
                    for (x, y) in [(0, 0), (width - 1, 0), (width / 2, height / 2), (0, height - 1)] {
                        let pixel = DVec2::new(f64::from(x), f64::from(y)) + 0.5
                            - DVec2::new(f64::from(width), f64::from(height)) * 0.5;
                        let p = plane.to_texel * pixel.extend(1.0);
                        let texel = p.truncate() / p.z;
                        let off = (texel - texel.round()).abs().max_element();
                        assert!(off < 1e-9, "{camera:?} {width} x {height} {pixel}: {texel}");
                    }
                }
            }
        }
    }
}

/// The plane in use is kept while another leads by less than the hysteresis, and views of nothing have none.
#[test]
fn a_plane_is_kept_and_nothing_has_none() {
    let grid = grid([8, 8, 8], DVec3::splat(0.1), DMat3::IDENTITY);
    let at = |degrees: f64, projection, away: bool| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let offset = DVec3::new(sin, 0.02, cos) * 4.0;
        let eye = grid.centre() + offset;
        let target = if away { eye + offset } else { grid.centre() };
        View::new(Camera { eye, target, up: DVec3::Y, projection }, 16, 16).unwrap()
    };
    let axes = |view: &View, current| -> Vec<usize> {
        let planes = base_planes(&grid, view, current, 0.01, Intermediate::Auto, of(1e6)).unwrap();
        planes.iter().map(|plane| plane.axis).collect()
    };
    for projection in
        [Projection::Orthographic { half_height: 1.3 }, Projection::Perspective { fov_y_deg: 4.0 }]
    {
        // sin 45.3 - cos 45.3 is 0.0074, sin 45.5 - cos 45.5 is 0.0123.
        for (degrees, current, axis) in
            [(45.3, None, 0), (45.3, Some(2), 2), (45.5, Some(2), 0), (44.7, Some(0), 0), (44.5, Some(0), 2)]
        {
            assert_eq!(axes(&at(degrees, projection, false), current), [axis], "{projection:?} {degrees}");
        }
    }
    let perspective = Projection::Perspective { fov_y_deg: 20.0 };
    assert!(axes(&at(30.0, perspective, true), None).is_empty());
}

/// Texels follow what was asked for, and where that is voxels far smaller than pixels, pixels.
#[test]
fn there_are_as_many_texels_as_asked_for() {
    let grid = grid([400, 300, 3], DVec3::splat(0.01), DMat3::IDENTITY);
    let texels = |resolution, half_height, side| {
        let eye = grid.centre() + DVec3::Z * 9.0;
        let projection = Projection::Orthographic { half_height };
        let view =
            View::new(Camera { eye, target: grid.centre(), up: DVec3::Y, projection }, side, side).unwrap();
        let planes = base_planes(&grid, &view, None, 0.0, resolution, of(1e9)).unwrap();
        f64::from(planes[0].size[0]) * f64::from(planes[0].size[1])
    };
    // The image lies inside the domain; margins have no more than 14 texels to a side.
    for side in [0.25, 0.5, 1.0, 3.0, 8.0] {
        let (got, want) = (texels(Intermediate::Pixel(side), 1.4, 100), 100.0 * side);
        assert!(got >= want * want && got <= (want + 14.0) * (want + 14.0), "{side}: {got}");
    }
    // A voxel a texel: 280 x 280 of them in the image, or all.
    for (half_height, want) in [(1.4, 280.0 * 280.0), (9.0, 400.0 * 300.0)] {
        let got = texels(Intermediate::Voxel, half_height, 16);
        assert!(got > 0.99 * want && got < 1.12 * want, "{half_height}: {got}");
        // No finer than pixels.
        let got = texels(Intermediate::Auto, half_height, 16);
        assert!(got <= 30.0 * 30.0, "{half_height}: {got}");
    }
    // A texel a voxel between one and three pixels; three pixels where voxels are larger.
    for (half_height, side, want) in [(1.4, 560, 280.0), (0.14, 100, 100.0 / 3.0)] {
        let got = texels(Intermediate::Auto, half_height, side);
        assert!(got >= want * want && got <= (want + 14.0) * (want + 14.0), "{half_height}: {got}");
    }
}

/// A view along an axis up to rounding, whose central ray is nearly parallel to the other planes, has all of its planes.
#[test]
fn a_view_along_an_axis_to_rounding_has_its_planes() {
    let grid = grid([65, 65, 65], DVec3::ONE, DMat3::IDENTITY);
    // About the origin, where so small a tilt is one.
    let grid = grid.with_placement(DVec3::ONE, DVec3::splat(-32.0), DMat3::IDENTITY).unwrap();
    for tilt in [0.0, 1e-18, 1.2e-16, -1.2e-16, 1e-14, 1e-12, 1e-9] {
        let eye = grid.centre();
        let camera = Camera {
            eye,
            target: eye + DVec3::new(tilt, 0.0, -1.0),
            up: DVec3::Y,
            projection: Projection::Perspective { fov_y_deg: 120.0 },
        };
        let view = View::new(camera, 33, 33).unwrap();
        let planes = base_planes(&grid, &view, None, 0.0, Intermediate::Pixel(1.0), of(1e6)).unwrap();
        assert_eq!(planes.len(), 5, "{tilt}");
        for i in 0..33 * 33 {
            let pixel = DVec2::new(f64::from(i % 33), f64::from(i / 33)) - 16.0;
            for plane in &planes {
                let s = plane.steepness * pixel.extend(1.0);
                if s.x < s.y.abs().max(s.z.abs()) {
                    continue;
                }
                let p = plane.to_texel * pixel.extend(1.0);
                let texel = p.truncate() / p.z;
                let last = DVec2::from_array(plane.size.map(f64::from)) - 2.0;
                assert!(
                    texel.min_element() > 1.0 && texel.cmplt(last).all(),
                    "{tilt} {pixel}: {texel} {plane:?}"
                );
            }
        }
    }
}

/// Coarser texels replace those that exceed a side or the rows of the device; hysteresis keeps no plane that is edge-on.
#[test]
fn sides_and_shears_have_their_limits() {
    let grid = grid([40, 40, 40], DVec3::ONE, DMat3::IDENTITY);
    let look = |direction: DVec3, size: [u32; 2]| {
        let projection = Projection::Orthographic { half_height: 10.0 };
        let eye = grid.centre() - 100.0 * direction;
        View::new(Camera { eye, target: grid.centre(), up: DVec3::Y, projection }, size[0], size[1]).unwrap()
    };
    let room = Capacity { texels: 1e9, side: 700.0, rows: 500.0 };
    let view = look(DVec3::new(0.2, 0.1, -1.0), [1, 4096]);
    let [plane] = base_planes(&grid, &view, None, 0.0, Intermediate::Pixel(128.0), room).unwrap()[..] else {
        panic!()
    };
    assert!(plane.size[0] <= 700 && plane.size[1] <= 500 && plane.size[1] > 400, "{:?}", plane.size);
    // As much as anyone may ask for.
    let planes = base_planes(&grid, &view, None, 0.0, Intermediate::Pixel(1e200), room).unwrap();
    assert!(planes[0].size[1] <= 500, "{:?}", planes[0].size);
    let along = look(DVec3::new(1.0, 0.0, -0.01), [16, 16]);
    let [plane] = base_planes(&grid, &along, Some(2), 0.99, Intermediate::Auto, room).unwrap()[..] else {
        panic!()
    };
    assert_eq!(plane.axis, 0);
}
