//! Shapes beside spheres: meshes, arrows and ellipsoids in pictures, in words, and refused where they cannot be.

use super::{Folder, dump, png};

const VIEW: &str = "--eye 0,0,20 --look-at 0,0,0 --up 0,1,0 --ortho 8 --radius 0.5 --look flat --color #ff0000 --background none";

/// A square of edge 2 around `x`, at height `z`.
fn square(x: i32, z: i32) -> String {
    let corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
    let lines = corners.map(|[dx, dy]| format!("v {} {dy} {z}\n", x + dx));
    format!("{}f 1 2 3 4\n", lines.concat())
}

/// The color at a place, of a picture of 48 x 32 pixels, 4 a unit.
fn color(folder: &Folder, name: &str, [x, y]: [i32; 2]) -> [u8; 4] {
    let (pixels, _, _) = png(&folder.path(name));
    let at = ((16 - 4 * y) * 48 + 24 + 4 * x) as usize * 4;
    [0, 1, 2, 3].map(|channel| pixels[at + channel])
}

#[test]
fn meshes_stand_before_and_behind_particles() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id type x y z", 4.0, &["1 1 -3 0 0", "2 1 3 0 0"]));
    folder.file("near.obj", square(-3, 2));
    folder.file("far.obj", square(3, -2));
    let said = folder
        .render(&format!("a.dump -o a.png {VIEW} --mesh near.obj --mesh far.obj --mesh-color #00ff00"))
        .fine();
    assert!(said.contains("2 meshes of 4 triangles"), "{said}");
    let (green, red) = ([0, 255, 0, 255], [255, 0, 0, 255]);
    let at = |x: i32, y: i32| color(&folder, "a.png", [x, y]);
    assert_eq!(
        [at(-3, 0), at(3, 0), at(0, 0)],
        [green, red, [0; 4]],
        "a square hides a particle, another is hidden"
    );
    // A color for each, from a scene file in another folder, whose paths are its own.
    std::fs::create_dir(folder.path("b")).unwrap();
    folder.file(
        "b/s.toml",
        "[particles]\nfiles = \"../a.dump\"\n[shapes]\nmesh = [\"../near.obj\", \"../far.obj\"]\nmesh-color = [\"#0000ff\", \"#00ff00\"]\n",
    );
    folder.render(&format!("b/s.toml -o b.png {VIEW}")).fine();
    // Three units right of the far square's middle it is still there, the particle no longer.
    let seen = [[-3, 0], [3, 0]].map(|place| color(&folder, "b.png", place));
    assert_eq!(seen, [[0, 0, 255, 255], red]);
    let (_, _, texts) = png(&folder.path("b.png"));
    assert!(texts.iter().any(|(key, text)| key == "Guesses" && text.contains("2 meshes of 4 triangles")));
}

#[test]
fn arrows_lead_out_of_particles_or_stand_alone() {
    let folder = Folder::new();
    let rows = ["1 1 -3 0 0 2 0 0", "2 1 3 0 0 0 -2 0", "3 1 0 3 0 0 0 0"];
    folder.file("a.dump", dump("id type x y z vx vy vz", 4.0, &rows));
    let said = folder
        .render(&format!("a.dump -o a.png {VIEW} --arrows v --arrow-scale 1 --arrow-radius 0.2"))
        .fine();
    assert!(said.contains("2 arrows of v, 1 times as long, radius 0.2"), "{said}");
    let (red, none) = ([255, 0, 0, 255], [0; 4]);
    let at = |name: &str, x: i32, y: i32| color(&folder, name, [x, y]);
    // Two units long: past the sphere, not on the other side.
    assert_eq!(
        [at("a.png", -2, 0), at("a.png", -4, 0), at("a.png", 3, -1), at("a.png", 3, 1)],
        [red, none, red, none]
    );
    assert_eq!(at("a.png", 0, 3), red, "a particle at rest");
    folder
        .render(&format!(
            "a.dump -o b.png {VIEW} --arrows v --arrow-scale 1 --arrow-radius 0.2 --arrows-only"
        ))
        .fine();
    assert_eq!([at("b.png", -2, 0), at("b.png", 3, -1), at("b.png", 0, 3)], [red, red, none]);
    let said = folder.render(&format!("a.dump -o c.png {VIEW} --arrows velocity")).fine();
    assert!(said.contains("2 arrows of velocity"), "any name of a velocity: {said}");
}

#[test]
fn particles_that_the_file_has_as_ellipsoids_are_ellipsoids() {
    let folder = Folder::new();
    // Long along x, the second turned by a quarter about z; the third has no shape.
    let rows =
        ["1 1 -3 0 0 4 1 1 1 0 0 0", "2 1 2 0 0 4 1 1 0.70710678 0 0 0.70710678", "3 1 0 3 0 0 0 0 1 0 0 0"];
    let columns = "id type x y z shapex shapey shapez quatw quati quatj quatk";
    folder.file("a.dump", dump(columns, 4.0, &rows));
    let said = folder.render(&format!("a.dump -o a.png {VIEW}")).fine();
    assert!(said.contains("2 ellipsoids by diameters shapex shapey shapez quatw, 1 sphere"), "{said}");
    let (red, none) = ([255, 0, 0, 255], [0; 4]);
    let seen = |name: &str| {
        [[-4, 0], [-2, 0], [-3, 1], [2, 1], [2, -1], [3, 0], [0, 3]].map(|at| color(&folder, name, at))
    };
    assert_eq!(seen("a.png"), [red, red, none, red, red, none, red]);
    for structure in ["pkd", "treelets"] {
        folder.render(&format!("a.dump -o same.png {VIEW} --structure {structure}")).fine();
        assert!(png(&folder.path("same.png")).0 == png(&folder.path("a.png")).0, "{structure}");
    }
    folder.render(&format!("a.dump -o s.png {VIEW} --ellipsoids none")).fine();
    assert_eq!(seen("s.png"), [none, none, none, none, none, none, red]);
    // The same by names: half axes of half the size, not turned.
    let said = folder.render(&format!("a.dump -o h.png {VIEW} --ellipsoids shape --radius-scale 0.5")).fine();
    assert!(said.contains("2 ellipsoids by half axes shape"), "{said}");
    assert_eq!(seen("h.png")[..6], [red, red, none, none, none, red]);
    // From a saved file, too; and spheres where nothing else is known.
    folder.line("build a.dump -o a.tyn").fine();
    folder.render(&format!("a.tyn -o t.png {VIEW}")).fine();
    assert!(png(&folder.path("t.png")).0 == png(&folder.path("a.png")).0);
    // What LIGGGHTS has are half axes, and exponents: a box and an octahedron, whose corners are drawn or not.
    let rows = ["1 1 -3 0 0 1.5 1.5 1 1 0 0 0 100 100", "2 1 3 0 0 1.5 1.5 1 1 0 0 0 1 1"];
    let columns = "id type x y z shapex shapey shapez quat1 quat2 quat3 quat4 blockiness1 blockiness2";
    folder.file("b.dump", dump(columns, 4.0, &rows));
    let said = folder.render(&format!("b.dump -o b.png {VIEW}")).fine();
    assert!(said.contains("2 superquadrics by half axes shapex shapey shapez quat1 blockiness1"), "{said}");
    let seen_b = [[-2, 1], [-4, -1], [4, 1], [4, 0]].map(|at| color(&folder, "b.png", at));
    assert_eq!(seen_b, [red, red, none, red]);
    let said = folder.render("a.dump -o p.png --culling confidence --look flat").fine();
    assert!(said.contains("note: the file has ellipsoids, which are spheres with --culling"), "{said}");
}

#[test]
fn tensors_are_ellipsoids_along_their_principal_axes() {
    let folder = Folder::new();
    // Long along x, along the diagonal of x and y, and none.
    let rows = ["1 1 -3 0 0 4 1 1 0 0 0 7", "2 1 2 0 0 2.5 2.5 1 1.5 0 0 7", "3 1 0 3 0 0 0 0 0 0 0 7"];
    let columns = "id type x y z c_s[1] c_s[2] c_s[3] c_s[4] c_s[5] c_s[6] q";
    folder.file("a.dump", dump(columns, 4.0, &rows));
    let said = folder
        .render(&format!("a.dump -o a.png {VIEW} --ellipsoids tensor:c_s --ellipsoid-scale 0.5"))
        .fine();
    let told = "2 ellipsoids by the tensor c_s (xx yy zz xy xz yz), half axes its eigenvalues times 0.5, 1 particle left out whose tensor is 0";
    assert!(said.contains(told), "{said}");
    let (red, none) = ([255, 0, 0, 255], [0; 4]);
    let seen = |name: &str| {
        [[-4, 0], [-2, 0], [-3, 1], [3, 1], [1, -1], [3, -1], [0, 3]].map(|at| color(&folder, name, at))
    };
    assert_eq!(seen("a.png"), [red, red, none, red, red, none, none]);
    // As long as the root of four, not as four.
    let said = folder
        .render(&format!("a.dump -o r.png {VIEW} --ellipsoids covariance:c_s --ellipsoid-scale 0.7"))
        .fine();
    assert!(said.contains("half axes the roots of its eigenvalues times 0.7"), "{said}");
    assert_eq!(seen("r.png")[..3], [red, red, none]);
    let said = folder.render(&format!("a.dump -o u.png {VIEW} --ellipsoids tensor:c_s")).fine();
    assert!(said.contains("half axes its eigenvalues times 0.125"), "{said}");
    // Nine numbers of an extended XYZ, of which the reader reads what is asked for.
    let nine = "2\nProperties=species:S:1:pos:R:3:stress:R:9:more:R:6\nAr -3 0 0 4 0 0 0 1 0 0 0 1 1 2 3 4 5 6\nAr 2 0 0 2.5 1.5 0 1.5 2.5 0 0 0 1 1 2 3 4 5 6\n";
    folder.file("a.xyz", nine);
    let said = folder
        .render(&format!("a.xyz -o x.png {VIEW} --ellipsoids tensor:stress --ellipsoid-scale 0.5"))
        .fine();
    assert!(said.contains("2 ellipsoids by the tensor stress, half axes"), "{said}");
    assert_eq!(seen("x.png"), seen("a.png"));
    for (words, parts) in [
        (
            "tensor:stres",
            ["--ellipsoids cannot be 'stres'", "the file has: stress, more; did you mean 'stress'?"],
        ),
        ("tensor:", ["--ellipsoids cannot be 'tensor:'", "tensor:NAME or covariance:NAME"]),
        ("tensor:stress --ellipsoid-scale 0", ["--ellipsoid-scale", "greater than 0"]),
        ("tensor:stress --device gpu", ["--device", "--ellipsoids"]),
    ] {
        folder.render(&format!("a.xyz -o n.png --ellipsoids {words}")).fails(2, &parts);
    }
}

#[test]
fn the_cell_is_rods_among_the_particles() {
    let folder = Folder::new();
    // Edges from 0 to 4; one particle before the edge along y at x = 4, one within the cell.
    folder.file("a.dump", dump("id type x y z", 4.0, &["1 1 4 2 1", "2 1 2 2 2"]));
    let view = "--eye 2,2,20 --look-at 2,2,0 --up 0,1,0 --ortho 8 --radius 0.5 --look flat --color #ff0000 --background none";
    folder.render(&format!("a.dump -o a.png {view} --cell-radius 0.3 --cell-color #0000ff")).fine();
    let (red, blue, none) = ([255, 0, 0, 255], [0, 0, 255, 255], [0; 4]);
    // From the middle of the picture, which is that of the cell: an edge at z = 4 stands before the particle at z = 1.
    let seen = [[2, 0], [-2, 1], [1, 2], [0, 0], [1, 1]].map(|at| color(&folder, "a.png", at));
    assert_eq!(seen, [blue, blue, blue, red, none]);
    folder.render(&format!("a.dump -o b.png {view} --cell-radius --look matte")).fine();
    folder.file("a.xyz", super::line_of(2));
    let said = folder.render("a.xyz -o c.png --cell-radius").fine();
    assert!(said.contains("--cell-radius: the file has no cell"), "{said}");
    for (words, parts) in [
        ("--cell-radius 0", ["--cell-radius", "greater than 0"]),
        ("--cell-radius --cell", ["--cell-radius", "--cell"]),
        ("--cell-color red", ["--cell-radius", "required"]),
        ("--cell-radius --replicate 2", ["--cell-radius", "--replicate"]),
        ("--cell-radius --device gpu", ["--device", "--cell-radius"]),
        ("--cell-radius --mode project", ["--cell-radius", "for spheres"]),
    ] {
        folder.render(&format!("a.dump -o n.png {words}")).fails(2, &parts);
    }
}

#[test]
fn shapes_that_cannot_be_are_refused() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id type x y z", 4.0, &["1 1 0.5 1 1", "2 1 1.5 1 1"]));
    folder.file("a.obj", square(0, 0));
    folder.file("b.obj", "v 0 0 0\nf 1 2 3\n");
    for (words, code, parts) in [
        ("--mesh none.stl", 3, vec!["none.stl", "No such file"]),
        ("--mesh a.dump", 3, vec!["this is no mesh that is known (a.dump)", "STL, OBJ or PLY"]),
        ("--mesh b.obj", 3, vec!["line 2", "'2' is none of the 1 corners before it"]),
        (
            "--mesh a.obj --mesh-color red --mesh-color blue",
            2,
            vec!["--mesh-color cannot be '2 colors'", "1 mesh"],
        ),
        ("--mesh a.obj --mesh-color redd", 2, vec!["did you mean 'red'"]),
        ("--mesh a.obj --culling confidence", 2, vec!["--culling", "off or certified with --mesh"]),
        ("--mesh a.obj --device gpu", 2, vec!["--device cannot be 'gpu'", "auto or cpu with --mesh"]),
        ("--mesh a.obj --mode medium", 2, vec!["--mesh is for spheres"]),
        ("--mesh a.obj --mode project", 2, vec!["--mesh is for spheres"]),
        ("--mesh-color red", 2, vec!["--mesh"]),
        ("--arrows w", 2, vec!["--arrows cannot be 'w'", "the file has none"]),
        ("--arrows v --arrow-scale -1", 2, vec!["a number greater than 0"]),
        ("--arrows-only", 2, vec!["--arrows"]),
        ("--ellipsoids axes", 2, vec!["--ellipsoids cannot be 'axes'", "3 numbers a particle"]),
        ("--ellipsoids a,b,c,d", 2, vec!["covariance:NAME, HALF_AXES, HALF_AXES,QUATERNION or"]),
        ("--arrows v --mode medium", 2, vec!["--arrows is for spheres"]),
    ] {
        folder.render(&format!("a.dump -o a.png {words}")).fails(code, &parts);
    }
    assert!(!folder.path("a.png").exists());
}

#[test]
fn holdouts_hide_without_being_shown() {
    let folder = Folder::new();
    folder.file("a.dump", dump("id type x y z", 4.0, &["1 1 -3 0 0", "2 1 3 0 0"]));
    folder.file("near.obj", square(-3, 2));
    folder.file("far.obj", square(3, -2));
    let line = format!(
        "a.dump -o a.png {VIEW} --holdout near.obj --mesh far.obj --mesh-color #00ff00 --save-scene a.toml"
    );
    let said = folder.render(&line).fine();
    assert!(said.contains("a mesh of 2 triangles · a hold-out of 2 triangles"), "{said}");
    let (green, red) = ([0, 255, 0, 255], [255, 0, 0, 255]);
    let seen = |name: &str| [[-3, 0], [3, 0], [2, 0]].map(|place| color(&folder, name, place));
    assert_eq!(seen("a.png"), [[0; 4], red, green]);
    // It shows a background.
    folder.render(&format!("a.dump -o white.png {VIEW} --background white --holdout near.obj")).fine();
    let (pixels, color, _) = png(&folder.path("white.png"));
    assert_eq!((color, &pixels[(16 * 48 + 12) * 3..][..3]), (png::ColorType::Rgb, &[255; 3][..]));
    // Again by the scene, and by the picture.
    assert!(std::fs::read_to_string(folder.path("a.toml")).unwrap().contains("holdout = [\"near.obj\"]"));
    folder.line("render a.toml -o b.png").fine();
    folder.line("render --again a.png -o c.png").fine();
    assert!([seen("b.png"), seen("c.png")].iter().all(|it| *it == seen("a.png")));
    // Where nothing is left, the picture is there all the same: others of the sequence have something.
    folder.file("wide.obj", square(0, 2).replace("v 1", "v 9").replace("v -1", "v -9"));
    let said = folder.render(&format!("a.dump -o none.png {VIEW} --holdout wide.obj")).fine();
    assert!(said.contains("nothing is seen, but for --holdout"), "{said}");
    assert!(png(&folder.path("none.png")).0.iter().all(|it| *it == 0));
    folder
        .render(&format!("a.dump -o x.png {VIEW} --outline --holdout near.obj"))
        .fails(2, &["--outline", "--holdout"]);
    folder.render(&format!("a.dump -o x.png {VIEW} --holdout none.obj")).fails(3, &["none.obj"]);
    folder.file("odd.obj", "v 0 0 0\nv 1 0 0\nv 0 1 nan\nf 1 2 3\n");
    folder
        .render(&format!("a.dump -o x.png {VIEW} --holdout odd.obj"))
        .fails(2, &["--holdout odd.obj", "finite"]);
    folder
        .line("render a.dump -o x.png --mode project --holdout near.obj")
        .fails(2, &["--holdout is for spheres"]);
}

#[test]
fn holdouts_end_media_and_what_is_in_them() {
    let folder = Folder::new();
    folder.file("ball.xyz", "1\nProperties=species:S:1:pos:R:3\nCu 0.1 0.5 0.05\n");
    // The left half of the view, through the middle of the cloud.
    folder.file("wall.obj", "v -9 -9 0.5\nv 0.5 -9 0.5\nv 0.5 9 0.5\nv -9 9 0.5\nf 1 2 3 4\n");
    let words = "--eye 0.5,0.5,5 --look-at 0.5,0.5,0 --up 0,1,0 --ortho 1.4 --background none --extinction 0.005 --grid 24 --samples 2 --size 24x16";
    let cloud = "synthetic:uniform?n=300 --mode medium";
    let render =
        |name: &str, more: &str| folder.line(&format!("render {cloud} {words} -o {name} {more}")).fine();
    let alpha = |name: &str, left: bool| {
        let (pixels, color, _) = png(&folder.path(name));
        assert_eq!(color, png::ColorType::Rgba);
        let of_half = |at: &usize| (at % 24 < 12) == left;
        (0..24 * 16).filter(of_half).map(|at| f64::from(pixels[4 * at + 3])).sum::<f64>()
    };
    render("all.png", "--samples 4");
    for (name, more) in [("a.png", ""), ("b.png", "--method reference")] {
        let said = render(name, &format!("--holdout wall.obj {more}"));
        assert!(said.contains("a hold-out of 2 triangles"), "{said}");
        let share = [true, false].map(|left| alpha(name, left) / alpha("all.png", left));
        assert!(share[0] > 0.3 && share[0] < 0.9, "half of the cloud is left: {share:?}");
        assert!((share[1] - 1.0).abs() < 0.05, "{share:?}");
    }
    let (_, _, texts) = png(&folder.path("a.png"));
    assert!(texts.iter().any(|(key, text)| key == "Inputs" && text.contains("wall.obj (")), "{texts:?}");
    // A sphere behind it, whichever is named first, is not shown.
    let sphere = "ball.xyz --radius 0.35 --color red";
    let of_picture: Vec<&str> = words.split(' ').chain(["--holdout", "wall.obj"]).collect();
    let first: Vec<&str> = ["render"].into_iter().chain(sphere.split(' ')).collect();
    folder.run(&[&first[..], &of_picture, &["-o", "c.png", "--layer", cloud]].concat()).fine();
    let second: Vec<&str> = ["render"].into_iter().chain(cloud.split(' ')).collect();
    folder.run(&[&second[..], &of_picture, &["-o", "d.png", "--layer", sphere]].concat()).fine();
    for name in ["c.png", "d.png"] {
        assert!((alpha(name, true) / alpha("a.png", true) - 1.0).abs() < 0.02, "{name}");
    }
    let shown = format!("render {cloud} {words} -o x.png --show density --holdout wall.obj");
    folder.line(&shown).fails(2, &["--show", "--holdout"]);
}
