use super::*;
use eagpt_scene::{Dataset, Image};
use eagpt_testkit::room;
use std::sync::LazyLock;

/// Views of the test room, and points on its surfaces.
static ROOM: LazyLock<(Vec<View>, Vec<Vec3>)> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let options = room::RoomOptions {
        num_views: 16,
        width: 96,
        height: 72,
        num_samples: 64,
        num_points: 6000,
        seed: 2,
    };
    room::write(dir.path(), &options, |_| ()).unwrap();
    let dataset = Dataset::open(dir.path()).unwrap();
    let views = (0..dataset.len()).map(|i| dataset.load_view(i).unwrap());
    let points = dataset.points().unwrap().unwrap().positions;
    (views.collect(), points)
});

fn found(views: &[View], num: usize) -> Result<Agreed> {
    let mut agreement = Agreement::default();
    for view in views {
        agreement.add(view);
    }
    agreement.points(num, 5, Path::new("room"))
}

fn changed(change: impl Fn(usize, &mut View)) -> Vec<View> {
    let mut views = ROOM.0.clone();
    for (index, view) in views.iter_mut().enumerate() {
        change(index, view);
    }
    views
}

/// Distances from points on the surfaces, sorted.
fn distances(found: &Agreed) -> Vec<f32> {
    let to_surface = |p: &Vec3| {
        let squares = ROOM.1.iter().map(|q| p.distance_squared(*q));
        squares.fold(f32::MAX, f32::min).sqrt()
    };
    let mut all: Vec<f32> = found.cloud.positions.par_iter().map(to_surface).collect();
    all.sort_unstable_by(f32::total_cmp);
    all
}

#[test]
fn depth_gives_points_on_surfaces() {
    let found = found(&ROOM.0, 2000).unwrap();
    assert_eq!(found.num_from_depth, found.cloud.len());
    assert!(found.cloud.len().abs_diff(2000) < 20);
    let distances = distances(&found);
    // Neighbouring points of the cloud are 8 cm from each other.
    assert!(
        distances[distances.len() * 95 / 100] < 0.15,
        "{distances:?}"
    );
}

#[test]
fn views_that_agree_give_points_near_surfaces() {
    let plain = changed(|_, view| (view.depth, view.normal) = (None, None));
    let with_normals = changed(|_, view| view.depth = None);
    for views in [plain, with_normals] {
        let found = found(&views, 3000).unwrap();
        assert_eq!((found.num_from_depth, found.num_random), (0, 0));
        assert!(found.cloud.len() > 900, "{}", found.warning());
        let distances = distances(&found);
        let at = |percent: usize| distances[distances.len() * percent / 100];
        eprintln!("{}: {} {} {}", found.warning(), at(50), at(75), at(90));
        // Random points in the room are half a metre from the nearest surface.
        assert!(at(50) < 0.12 && at(75) < 0.25, "{} {}", at(50), at(75));
    }
}

#[test]
fn the_same_views_give_the_same_points() {
    let views = changed(|_, view| view.depth = None);
    let [one, other] = [(); 2].map(|()| found(&views, 500).unwrap().cloud);
    assert_eq!(one, other);
}

#[test]
fn what_a_view_sees_through_is_empty() {
    let half = |view: &View| {
        let (width, height) = view.radiance.size();
        let opaque = |i: u32| [if i % width < width / 2 { 1.0 } else { 0.0 }];
        Image::from_pixels(width, height, (0..width * height).map(opaque).collect())
    };
    let views = changed(|index, view| {
        view.depth = None;
        if index == 3 {
            view.alpha = half(view);
        }
    });
    let found = found(&views, 1500).unwrap();
    let camera = &views[3].camera;
    let middle = camera.width as f32 / 2.0;
    // A pixel of the picture in which opacity is looked up.
    for point in &found.cloud.positions {
        let at = camera.project(*point);
        let is_inside =
            at.z > 0.0 && (0.0..camera.height as f32).contains(&at.y) && at.x < camera.width as f32;
        assert!(!is_inside || at.x < middle + 2.0 || at.x < 0.0, "{at}");
    }
}

#[test]
fn flat_pictures_give_random_points_and_one_place_gives_none() {
    let flat = changed(|_, view| {
        (view.depth, view.normal) = (None, None);
        view.radiance = view.radiance.map(|_| [0.5; 3]);
    });
    let found_there = found(&flat, 400).unwrap();
    assert_eq!(
        (found_there.cloud.len(), found_there.num_random),
        (400, 400)
    );
    let place = flat[0].camera.world_from_camera.translation;
    let mut still = flat;
    for view in &mut still {
        view.camera.world_from_camera.translation = place;
    }
    let error = found(&still, 400).unwrap_err().to_string();
    assert!(
        error.contains("room") && error.contains("all stand in one"),
        "{error}"
    );
}
