//! Boundary conditions: libigl's charts, pins and targets, held loops of every shape, fillings; and that both forms of the system agree.

use super::reference::{assert_agree, deviation, deviation_aligned};
use super::*;

fn chart_as(form: Form, patch: &Patch, spec: &ChartSpec) -> Result<ChartOutcome> {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    parametrize_planned(patch, &plan_as(patch, form, &work)?, spec, &work)
}

fn mapped(outcome: ChartOutcome) -> Chart {
    match outcome {
        ChartOutcome::Mapped(chart) => chart,
        other => panic!("{other:?}"),
    }
}

fn pinned(pins: &[(u32, Option<Vec2>)]) -> ChartSpec {
    let pins = pins.iter().map(|&(vertex, target)| Pin { vertex, target }).collect();
    ChartSpec { pins: Pins::Given(pins), ..ChartSpec::only(ChartMethod::LeastSquaresConformal) }
}

fn held(method: ChartMethod, shape: BoundaryShape) -> ChartSpec {
    ChartSpec { boundary: Boundary { shape, ..Boundary::default() }, ..ChartSpec::only(method) }
}

fn bump() -> Patch {
    grid(16, 12, false, 0.6, |u, v| [3.0 * u, 2.0 * v, 0.6 * (4.0 * u).sin() * (3.0 * v).cos()])
}

/// A ring with a wavy wall: two loops.
fn ring() -> Patch {
    grid(36, 7, true, 0.5, |u, v| {
        let r = 2.0 - 1.2 * v;
        [r * (TAU * u).cos(), r * (TAU * u).sin(), 0.3 * (3.0 * TAU * u).sin() * v]
    })
}

#[test]
fn charts_are_those_of_libigl() {
    for form in [Form::Condensed, Form::Whole] {
        assert_agree(|r, spec| mapped(chart_as(form, &r.patch, &spec).unwrap()).uv);
    }
}

#[test]
fn the_condensed_and_the_whole_system_give_the_same_charts() {
    for patch in [bump(), ring()] {
        for method in METHODS {
            for holes in [Holes::Automatic, Holes::Open, Holes::CentreVertex, Holes::MeanPlane] {
                let spec = ChartSpec { holes, ..ChartSpec::only(method) };
                let (one, two) = (chart_as(Form::Condensed, &patch, &spec), chart_as(Form::Whole, &patch, &spec));
                match (one, two) {
                    (Ok(one), Ok(two)) => {
                        let (one, two) = (mapped(one), mapped(two));
                        assert!(deviation(&one.uv, &two.uv) < 1e-6, "{method:?} {holes:?}: {:e}", deviation(&one.uv, &two.uv));
                        assert_eq!(one.attempts.len(), two.attempts.len());
                    }
                    (Err(one), Err(two)) => assert_eq!(one.reason(), two.reason()),
                    (one, two) => panic!("{method:?} {holes:?}: {one:?} {two:?}"),
                }
            }
        }
        let spec = pinned(&[(3, Some([0.0, 0.0])), (40, Some([1.0, 0.2])), (90, Some([0.6, 0.7]))]);
        let solve = |form| chart_as(form, &patch, &spec).map(mapped).map(|c| c.uv).map_err(|e| e.reason());
        match (solve(Form::Condensed), solve(Form::Whole)) {
            (Ok(one), Ok(two)) => assert!(deviation(&one, &two) < 1e-6),
            (one, two) => assert_eq!(one.is_err(), two.is_err()),
        }
    }
}

#[test]
fn holes_are_filled_for_the_map_only() {
    let patch = ring();
    for holes in [Holes::CentreVertex, Holes::MeanPlane] {
        for method in METHODS {
            let chart = chart(&patch, ChartSpec { holes, ..ChartSpec::only(method) });
            assert_promises(&patch, &chart);
            assert_eq!(chart.uv.len(), patch.positions.len());
            let used = chart.attempts.last().unwrap().filling.holes;
            assert_eq!(used == HoleFilling::MeanPlane, holes == Holes::MeanPlane);
        }
    }
    // A flat ring filled flat maps by a similarity, whatever fills it; the harmonic map keeps linear functions.
    let flat = grid(30, 4, true, 0.4, |u, v| [(2.0 - v) * (TAU * u).cos(), (2.0 - v) * (TAU * u).sin(), 0.0]);
    let plane: Vec<Vec2> = flat.positions.iter().map(|p| [p[0], p[1]]).collect();
    for holes in [Holes::CentreVertex, Holes::MeanPlane] {
        for spec in [ChartSpec::only(ChartMethod::SpectralConformal), held(ChartMethod::Harmonic, BoundaryShape::MeanPlane)] {
            let chart = chart(&flat, ChartSpec { holes, ..spec });
            assert!(deviation_aligned(&chart.uv, &plane) < 1e-6);
        }
    }
}

#[test]
fn maps_with_linear_precision_leave_flat_patches_as_they_are() {
    let flat = grid(9, 7, false, 0.6, |u, v| pose(3, 2.0, [2.0 * u, v, 0.0]));
    let plane: Vec<Vec2> = grid(9, 7, false, 0.6, |u, v| [2.0 * u, v, 0.0]).positions.iter().map(|p| [p[0], p[1]]).collect();
    let corner = |x: f64, y: f64| {
        let far = |v: &usize| (plane[*v][0] - x).hypot(plane[*v][1] - y);
        (0..plane.len()).min_by(|a, b| far(a).total_cmp(&far(b))).unwrap() as u32
    };
    let corners = [corner(0.0, 0.0), corner(2.0, 0.0), corner(2.0, 1.0), corner(0.0, 1.0)];
    let square = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]];
    for method in [ChartMethod::Harmonic, ChartMethod::MeanValue] {
        for shape in [
            BoundaryShape::MeanPlane,
            BoundaryShape::Rectangle { ratio: None, corners: Some(corners) },
            BoundaryShape::Rectangle { ratio: Some(2.0), corners: Some(corners) },
            BoundaryShape::Polygon { points: square.clone(), corners: Some(corners.to_vec()) },
        ] {
            let chart = chart(&flat, held(method, shape.clone()));
            let off = deviation_aligned(&chart.uv, &plane);
            assert!(off < 1e-6, "{method:?} {shape:?}: {off:e}");
        }
    }
}

#[test]
fn pins_go_to_their_targets() {
    let patch = bump();
    let (a, b) = ([3.0, -2.0], [5.5, 1.0]);
    let [p, q] = [patch.loops[0][0], patch.loops[0][25]];
    let free = chart(&patch, pinned(&[(p, None), (q, None)]));
    let placed = chart(&patch, pinned(&[(p, Some(a)), (q, Some(b))]));
    assert_eq!((placed.uv[p as usize], placed.uv[q as usize]), (a, b));
    assert!(deviation_aligned(&placed.uv, &free.uv) < 1e-9, "moved targets are a similarity");
    assert_eq!(placed.distortion, free.distortion);
    assert_promises(&patch, &free);
    assert_eq!(free.attempts[0].pins, [p, q]);
    // Three pins where an unconstrained map has them change nothing; elsewhere they bend it.
    let r = patch.loops[0][40];
    let inner = (0..patch.positions.len() as u32).find(|v| !patch.loops[0].contains(v)).unwrap() + 20;
    let at = |v: u32| Some(placed.uv[v as usize]);
    for third in [r, inner] {
        let same = chart(&patch, pinned(&[(p, at(p)), (q, at(q)), (third, at(third))]));
        assert!(deviation(&same.uv, &placed.uv) < 1e-6, "{:e}", deviation(&same.uv, &placed.uv));
        let moved = [placed.uv[third as usize][0] + 0.05, placed.uv[third as usize][1] - 0.04];
        let bent = chart(&patch, pinned(&[(p, at(p)), (q, at(q)), (third, Some(moved))]));
        assert_eq!([bent.uv[p as usize], bent.uv[q as usize], bent.uv[third as usize]], [a, b, moved]);
        assert!(bent.distortion.angle.mean > placed.distortion.angle.mean);
    }
}

#[test]
fn convex_maps_are_one_to_one_over_random_meshes_on_strictly_convex_curves() {
    for seed in 0..8 {
        let crowd = |x: f64| x.powi(1 + seed / 2);
        let shake = 0.2 + 0.09 * f64::from(seed);
        let patch = grid(11, 9, false, shake, |u, v| [crowd(u) + 0.05 * u, v + 0.01 * u, 0.4 * (7.0 * v + f64::from(seed)).sin() * u]);
        for method in [ChartMethod::MeanValue, ChartMethod::Barycentric] {
            for shape in [BoundaryShape::Circle, BoundaryShape::Ellipse { ratio: 1.7 }] {
                match outcome(&patch, held(method, shape)).unwrap() {
                    ChartOutcome::Mapped(chart) => {
                        assert_promises(&patch, &chart);
                        assert_eq!(chart.attempts.last().unwrap().flipped_before, 0, "{method:?} {seed}");
                    }
                    ChartOutcome::MustSplit { attempts, reason } => {
                        assert!(reason.contains("differ") && attempts.iter().all(|a| a.flipped_before == 0), "{reason}");
                    }
                    ChartOutcome::Refused(error) => panic!("{error}"),
                }
            }
        }
    }
}

#[test]
fn any_loop_can_be_the_outer_one_and_the_start_is_where_it_is_wanted() {
    let patch = ring();
    let inner = patch.loops[1][4];
    let spec = |method| ChartSpec { outer: OuterLoop::Through(inner), ..ChartSpec::only(method) };
    for method in METHODS {
        let chart = chart(&patch, spec(method));
        assert_promises(&patch, &chart);
        let extent = |ring: &[u32]| ring.iter().map(|&v| chart.uv[v as usize][0].hypot(chart.uv[v as usize][1])).fold(0.0, f64::max);
        assert!(extent(&patch.loops[1]) > extent(&patch.loops[0]), "{method:?}");
    }
    let start = patch.loops[0][17];
    let boundary = Boundary { start: Some(start), ..Boundary::default() };
    let chart = chart(&patch, ChartSpec { boundary, ..ChartSpec::only(ChartMethod::Harmonic) });
    let centre = patch.loops[0].iter().fold([0.0; 2], |s, &v| {
        let p = chart.uv[v as usize];
        [s[0] + p[0] / patch.loops[0].len() as f64, s[1] + p[1] / patch.loops[0].len() as f64]
    });
    let p = chart.uv[start as usize];
    assert!((p[1] - centre[1]).abs() < 0.05 && p[0] > centre[0], "{p:?} {centre:?}");
}

#[test]
fn conditions_that_do_not_fit_are_refused_by_field_and_place() {
    let patch = ring();
    let field = |spec: ChartSpec| {
        let error = outcome(&patch, spec).unwrap_err();
        assert_eq!(error.reason(), Reason::BadParameter, "{error:?}");
        (error.metadata().iter().find(|m| m.0 == "field").unwrap().1.clone(), error.locations().first().map(|l| l.ids.clone()))
    };
    let some = |x: f64| Some([x, 0.0]);
    let inside = (0..patch.positions.len() as u32).find(|v| !patch.loops.concat().contains(v)).unwrap();
    let far = patch.positions.len() as u32;
    assert_eq!(field(pinned(&[(1, some(0.0)), (1, some(1.0))])).0, "pins");
    assert_eq!(field(pinned(&[(1, some(0.0)), (2, some(0.0))])).0, "pins");
    assert_eq!(field(pinned(&[(1, some(0.0))])).0, "pins");
    assert_eq!(field(pinned(&[(1, None), (2, None), (3, None)])).0, "pins");
    assert_eq!(field(pinned(&[(1, some(0.0)), (far, some(1.0))])).0, "pins");
    assert_eq!(field(ChartSpec { pins: Pins::Inertia, ..ChartSpec::only(ChartMethod::SpectralConformal) }).0, "pins");
    assert_eq!(field(ChartSpec { outer: OuterLoop::Through(inside), ..ChartSpec::default() }), ("outer_vertex".into(), Some(vec![inside])));
    let start = Boundary { start: Some(inside), ..Boundary::default() };
    let spec = ChartSpec { boundary: start, ..ChartSpec::only(ChartMethod::Harmonic) };
    let free = ChartSpec { outer: OuterLoop::Through(patch.loops[1][0]), holes: Holes::Open, ..ChartSpec::default() };
    assert_eq!(field(free).0, "outer_vertex");
    assert_eq!(field(spec.clone()), ("boundary.start_vertex".into(), Some(vec![inside])));
    assert_eq!(field(ChartSpec { method: None, ..spec }).0, "boundary");
    let polygon = |points: Vec<Vec2>| held(ChartMethod::Harmonic, BoundaryShape::Polygon { points, corners: None });
    for points in [
        vec![[0.0, 0.0], [1.0, 0.0]],
        vec![[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]],
        vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 1.0]],
        (0..5).map(|k| [(2.0 * TAU * f64::from(k) / 5.0).cos(), (2.0 * TAU * f64::from(k) / 5.0).sin()]).collect(),
    ] {
        assert_eq!(field(polygon(points)).0, "boundary.polygon");
    }
    assert_eq!(field(held(ChartMethod::Harmonic, BoundaryShape::Ellipse { ratio: -1.0 })).0, "boundary.ratio");
    let error = outcome(&patch, pinned(&[(1, some(f64::NAN)), (2, some(1.0))])).unwrap_err();
    assert_eq!(error.reason(), Reason::NonFinite);
}

#[test]
fn a_refused_method_names_the_faces_and_edges() {
    // More than a turn of a ramp: the boundary runs into itself, whatever is tried.
    let patch = grid(64, 3, false, 0.2, |u, v| {
        let (angle, r) = (TAU * 1.6 * u, 1.0 + 0.3 * v);
        [r * angle.cos(), -r * angle.sin(), 0.08 * u]
    });
    let error = outcome(&patch, ChartSpec::only(ChartMethod::SpectralConformal)).unwrap_err();
    assert_eq!(error.reason(), Reason::ChartFailed);
    assert!(!error.locations().is_empty() && error.message().contains("spectral conformal"));
}

#[test]
fn patches_that_no_chart_can_have_are_told_from_one_another() {
    // A torus, with and without a hole, and two sheets.
    let n = 12u32;
    let at = |i: u32, j: u32| (j % n) * n + i % n;
    let positions: Vec<Vec3> = (0..n * n)
        .map(|k| {
            let (a, b) = (TAU * f64::from(k % n) / f64::from(n), TAU * f64::from(k / n) / f64::from(n));
            [(2.0 + a.cos()) * b.cos(), (2.0 + a.cos()) * b.sin(), a.sin()]
        })
        .collect();
    let faces = |k: u32| {
        let (i, j) = (k % n, k / n);
        [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
    };
    let torus: Vec<[u32; 3]> = (0..n * n).flat_map(faces).collect();
    let one = bump();
    let shift = one.positions.len() as u32;
    let positions_of_two = one.positions.iter().copied().chain(one.positions.iter().map(|p| [p[0] + 9.0, p[1], p[2]])).collect();
    let faces_of_two = one.triangles.iter().copied().chain(one.triangles.iter().map(|t| t.map(|v| v + shift))).collect();
    let cases = [
        (patch(positions.clone(), torus.clone()), "closed"),
        (patch(positions, torus[1..].to_vec()), "1 handles"),
        (patch(positions_of_two, faces_of_two), "2 components"),
    ];
    for (patch, what) in cases {
        for spec in
            [ChartSpec::default(), ChartSpec::only(ChartMethod::Harmonic), pinned(&[(0, None), (patch.positions.len() as u32 - 1, None)])]
        {
            let error = outcome(&patch, spec).unwrap_err();
            assert_eq!(error.reason(), Reason::PatchTopology, "{error}");
            assert!(error.message().contains(what) || what == "closed", "{error}");
        }
    }
}

#[test]
fn faces_without_area_do_not_stop_a_chart() {
    // A vertex on the middle of an edge makes a face of no area.
    let mut sheet = grid(6, 6, false, 0.0, |u, v| [u, v, 0.2 * u * v]);
    let t = sheet.triangles[30];
    let p = t.map(|v| sheet.positions[v as usize]);
    let middle = sheet.positions.len() as u32;
    sheet.positions.push(scale(add(p[0], p[1]), 0.5));
    sheet.triangles[30] = [middle, t[1], t[2]];
    sheet.triangles.push([t[0], middle, t[2]]);
    assert!(sheet.triangles.iter().any(|s| (0..3).any(|k| s[k] == t[1] && s[(k + 1) % 3] == t[0])), "the edge is inside");
    // The face across keeps its long edge, so that the middle vertex makes a sliver of no area with it.
    sheet.triangles.push([t[0], t[1], middle]);
    let sheet = patch(sheet.positions, sheet.triangles);
    for method in METHODS {
        match outcome(&sheet, ChartSpec::only(method)) {
            Ok(ChartOutcome::Mapped(chart)) => assert_promises(&sheet, &chart),
            Ok(other) => assert!(matches!(other, ChartOutcome::MustSplit { .. })),
            Err(error) => assert_eq!(error.reason(), Reason::ChartFailed),
        }
    }
    assert_promises(&sheet, &chart(&sheet, ChartSpec::default()));
}

#[test]
fn pins_hold_on_long_strips() {
    let strip = grid(6000, 1, false, 0.0, |u, v| [6000.0 * u, v, 0.0]);
    let plane: Vec<Vec2> = strip.positions.iter().map(|p| [p[0], p[1]]).collect();
    let chart = chart(&strip, ChartSpec::only(ChartMethod::LeastSquaresConformal));
    // Bending so slender a strip costs next to nothing (by estimate (width/length)^2 of what shear costs): digits are lost, the map is not.
    assert!(deviation_aligned(&chart.uv, &plane) < 1e-3, "{:e}", deviation_aligned(&chart.uv, &plane));
}
