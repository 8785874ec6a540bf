use super::*;

const SHOT: &str = include_str!("../../../../tests/data/shot.usda");

fn cameras(text: &str, prim: Option<&str>, times: &[TimeCode]) -> Result<Vec<UsdCamera>> {
    cameras_of(Path::new("shot.usda"), text.as_bytes(), prim, times)
}

fn fault(text: &str, prim: &str) -> String {
    cameras(text, Some(prim), &[TimeCode::At(101.0)]).unwrap_err().to_string()
}

#[test]
fn cameras_stand_where_openusd_puts_them() {
    // Time code, eye, line of sight, up and horizontal angle of view, as `UsdGeomCamera::GetCamera` of OpenUSD 26.11 has them.
    type Row = (f64, [f64; 3], [f64; 3], [f64; 3], f64);
    let rig: [Row; 6] = [
        (
            90.0,
            [0.0, 2.551008, 20.333026],
            [0.0, -0.241922, -0.970296],
            [0.0, 0.970296, -0.241922],
            37.849289,
        ),
        (
            104.5,
            [3.574734, 2.550467, 18.573782],
            [-0.267153, -0.239526, -0.933411],
            [-0.033757, 0.970348, -0.239343],
            34.623291,
        ),
        (
            109.0,
            [8.162816, 2.548124, 16.286006],
            [-0.578708, -0.229175, -0.782672],
            [-0.07492, 0.970586, -0.228802],
            31.185623,
        ),
        (
            113.0,
            [8.226412, 3.544338, 12.231538],
            [-0.797016, -0.21252, -0.565332],
            [-0.1074, 0.970999, -0.213604],
            28.645439,
        ),
        (
            121.0,
            [8.291965, 5.531259, 4.086824],
            [-0.987781, -0.155379, 0.012113],
            [-0.155114, 0.972591, -0.173225],
            24.616032,
        ),
        (
            140.0,
            [8.291965, 6.531259, 0.086824],
            [-0.987781, -0.155379, 0.012113],
            [-0.155114, 0.972591, -0.173225],
            24.616032,
        ),
    ];
    let drone: [Row; 4] = [
        (101.0, [4.0, 2.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 23.670166),
        (104.5, [0.5, 2.0, -1.0], [0.85264, 0.0, -0.522498], [0.0, 1.0, 0.0], 23.670166),
        (109.0, [-4.0, 2.0, -1.0], [0.309017, 0.0, -0.951057], [0.0, 1.0, 0.0], 23.670166),
        // What is blocked does nothing.
        (113.0, [7.0, 0.0, -2.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], 23.670166),
    ];
    for (prim, rows) in [("/world/rig/cam", &rig[..]), ("layout/drone", &drone)] {
        for &(code, eye, forward, up, angle) in rows {
            let found = &cameras(SHOT, Some(prim), &[TimeCode::At(code)]).unwrap()[0];
            for (found, wanted) in [(found.eye, eye), (found.forward, forward), (found.up, up)] {
                assert!(
                    found.abs_diff_eq(DVec3::from_array(wanted), 2e-6),
                    "{prim} {code}: {found} {wanted:?}"
                );
            }
            let Projection::Perspective { vertical_angle } = found.camera(1.5, 2.0).projection else {
                panic!()
            };
            let horizontal = 2.0 * (1.5 * (0.5 * vertical_angle).tan()).atan();
            assert!(
                (horizontal.to_degrees() - angle).abs() < 1e-5,
                "{prim} {code}: {}",
                horizontal.to_degrees()
            );
        }
    }
}

#[test]
fn parallel_rays_lenses_and_defaults_are_those_of_the_schema() {
    let plan = &cameras(SHOT, Some("/layout/plan"), &[TimeCode::At(104.5)]).unwrap()[0];
    let camera = plan.camera(2.0, 5.0);
    assert_eq!(camera.projection, Projection::Orthographic { height: 15.0 });
    let wanted = [DVec3::new(3.5, 20.0, 0.0), DVec3::new(3.5, 15.0, 0.0), DVec3::NEG_Z];
    for (found, wanted) in [camera.eye, camera.look_at, camera.up].into_iter().zip(wanted) {
        assert!(found.abs_diff_eq(wanted, 1e-12), "{found} {wanted}");
    }
    assert_eq!((plan.focus, plan.lens), (None, None));
    let cam = &cameras(SHOT, Some("/world/rig/cam"), &[TimeCode::At(101.0)]).unwrap()[0];
    assert_eq!((cam.focus, &*cam.prim), (Some(9.5), "/world/rig/cam"));
    assert!((cam.lens.unwrap() - 3.5 / 2.8 / 2.0).abs() < 1e-6);

    let bare = "#usda 1.0\ndef Camera \"a\" { float focalLength = None }\n";
    let bare = &cameras(bare, None, &[TimeCode::FromStart(3.0)]).unwrap()[0];
    let slope = 0.5 * 20.955 / 50.0;
    assert_eq!((bare.eye, bare.forward, bare.up), (DVec3::ZERO, DVec3::NEG_Z, DVec3::Y));
    assert_eq!(bare.film, Film::Perspective { slope });
}

#[test]
fn time_codes_count_from_the_start_of_the_stage() {
    let at = |time| cameras(SHOT, Some("/world/rig/cam"), &[time]).unwrap();
    assert_eq!(at(TimeCode::FromStart(8.0)), at(TimeCode::At(109.0)));
    let without = SHOT.replace("startTimeCode = 101", "");
    let counted = cameras(&without, Some("/world/rig/cam"), &[TimeCode::FromStart(109.0)]).unwrap();
    assert_eq!(counted, at(TimeCode::At(109.0)));
}

#[test]
fn what_is_no_camera_is_told_with_a_way_out() {
    let several = cameras(SHOT, None, &[]).unwrap_err().to_string();
    assert!(
        several.contains("there are 3 cameras: /world/rig/cam, /layout/plan, /layout/drone"),
        "{several}"
    );
    assert!(several.contains("FILE:/world/rig/cam"), "{several}");
    let unknown = fault(SHOT, "/cam");
    assert!(
        unknown.contains("no camera '/cam'") && unknown.contains("there is: /world/rig/cam"),
        "{unknown}"
    );
    let rig = "/world/rig/cam";
    for (from, to, what) in [
        ("horizontalApertureOffset = 0", "horizontalApertureOffset = 1.5", "horizontalApertureOffset is 1.5"),
        ("\"perspective\"", "\"fisheye\"", "projection \"fisheye\""),
        ("horizontalAperture = 24", "horizontalAperture = 0", "horizontalAperture is 0"),
        ("fStop = 2.8", "fStop = wide", "fStop has no number at time code 101"),
        ("fStop = 2.8", "double fStop.spline = { 1: 2 }", "fStop.spline is a spline"),
        ("(2, 2, 2)", "(2, 1, 2)", "not perpendicular"),
        ("(2, 2, 2)", "(2, 0, 2)", "have no length"),
        ("xformOp:rotateX = -4", "xformOp:rotateX = up", "xformOp:rotateX cannot be read"),
        ("\"xformOp:rotateX\"]", "\"xformOp:shear\"]", "xformOp:shear cannot be read"),
    ] {
        assert!(SHOT.contains(from), "{from}");
        let error = fault(&SHOT.replace(from, to), rig);
        assert!(error.contains(what) && error.contains("prim '/world/rig/cam'"), "{to}: {error}");
    }
    let none = fault("#usda 1.0\nover \"a\" ( references = @b.usda@ ) { }\n", "/a");
    assert!(none.contains("no prim of type Camera") && none.contains("--flatten"), "{none}");
    for (bytes, what) in [(&b"PXR-USDC\0\0\x08"[..], "binary USD"), (b"solid a\n", "no stage of USD as text")]
    {
        let error = cameras_of(Path::new("a.usd"), bytes, None, &[]).unwrap_err().to_string();
        assert!(error.contains(what) && error.contains("usdcat"), "{error}");
    }
    crate::read::real_data::damage(SHOT.as_bytes(), |file| {
        drop(cameras_of(Path::new("a.usda"), file, Some(rig), &[TimeCode::At(101.0)]));
    });
}
