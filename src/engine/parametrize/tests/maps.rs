//! Known maps: flat and developable patches, energies by a second formula, promises over families of patches.

use super::*;
use crate::parametrize::conformal::{ConformalProblem, boundary_mass, conformal_matrix};

#[test]
fn a_flat_patch_maps_by_a_similarity_in_any_pose_and_size() {
    for (seed, size) in [(1, 1.0), (2, 1e-8), (3, 1e3), (4, 1e-150)] {
        let flat = grid(9, 6, false, 0.7, |u, v| pose(seed, size, [2.0 * u + 0.1 * v * v, v, 0.0]));
        for method in FREE {
            let chart = chart(&flat, ChartSpec::only(method));
            assert!(length_error(&flat, &chart) < 1e-6, "{method:?} {size}: {}", length_error(&flat, &chart));
            let d = chart.distortion;
            assert!((d.angle.max - 1.0).abs() < 1e-6 && (d.area.min - 1.0).abs() < 1e-6 && (d.area.max - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn developable_patches_map_isometrically() {
    // Vertices on the surface, faces flat: facets of a cylinder and of a cone without jitter are developable exactly.
    let cylinder = grid(12, 5, false, 0.0, |u, v| [(2.0 * u).cos(), (2.0 * u).sin(), 1.5 * v]);
    let cone = grid(10, 4, false, 0.0, |u, v| {
        let r = 1.0 + v;
        [r * (1.7 * u).cos(), r * (1.7 * u).sin(), 0.8 * r]
    });
    for patch in [cylinder, cone] {
        for method in FREE {
            assert!(length_error(&patch, &chart(&patch, ChartSpec::only(method))) < 1e-6);
        }
    }
}

#[test]
fn one_to_three_faces_map_isometrically() {
    let corners: Vec<Vec3> = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.3, 0.8, 0.0], [1.2, 1.0, 0.7], [2.0, 0.2, 0.0]];
    let faces = [[0, 1, 2], [1, 3, 2], [1, 4, 3]];
    for count in 1..=3 {
        let patch = patch(corners[..count + 2].to_vec(), faces[..count].to_vec());
        for method in METHODS {
            let chart = chart(&patch, ChartSpec::only(method));
            assert_promises(&patch, &chart);
            if !method.has_fixed_boundary() {
                assert!(length_error(&patch, &chart) < 1e-6, "{method:?} {count}");
            }
        }
    }
}

fn half_sphere(n: u32) -> Patch {
    grid(n, n, false, 0.5, |u, v| {
        let (x, y) = (1.4 * u - 0.7, 1.4 * v - 0.7);
        [x, y, (1.0 - 0.9 * (x * x + y * y)).sqrt()]
    })
}

#[test]
fn all_methods_keep_the_promises_on_curved_patches() {
    let bump = grid(20, 14, false, 0.8, |u, v| [3.0 * u, 2.0 * v, (4.0 * u).sin() * (3.0 * v).cos()]);
    let tube = grid(24, 10, true, 0.5, |u, v| [(TAU * u).cos(), (TAU * u).sin(), 1.2 * v]);
    let ring = grid(30, 6, true, 0.5, |u, v| {
        let r = 2.0 - 1.2 * v;
        [r * (TAU * u).cos(), r * (TAU * u).sin(), 0.3 * (3.0 * TAU * u).sin() * v]
    });
    for patch in [half_sphere(12), bump, tube, ring] {
        for method in METHODS {
            assert_promises(&patch, &chart(&patch, ChartSpec::only(method)));
        }
        let automatic = chart(&patch, ChartSpec::default());
        assert_eq!(automatic.method, ChartMethod::SpectralConformal);
        assert!(automatic.distortion.angle.mean < 1.2, "{:?}", automatic.distortion);
    }
}

#[test]
fn mean_value_is_one_to_one_on_discs_with_slivers() {
    for seed in 0..6 {
        // Rows and columns crowd towards one side: triangles of aspect 1000 and more, on a wavy surface.
        let crowd = |x: f64| x.powi(4 + seed);
        let patch = grid(14, 14, false, 0.3, |u, v| [crowd(u) + 0.02 * u, v + 0.001 * u, 0.1 * (9.0 * v).sin() * u]);
        match outcome(&patch, ChartSpec::only(ChartMethod::MeanValue)).unwrap() {
            ChartOutcome::Mapped(chart) => assert_promises(&patch, &chart),
            ChartOutcome::MustSplit { reason, .. } => assert!(reason.contains("differ"), "{reason}"),
            ChartOutcome::Refused(error) => panic!("{error}"),
        }
        assert_promises(&patch, &chart(&patch, ChartSpec::default()));
    }
}

/// Upper triangle of a Hermitian matrix applied: w^H M w.
fn form(matrix: &remesh_linalg::ComplexMatrix, w: &[Complex]) -> f64 {
    let mut sum = 0.0;
    for (m, (i, j)) in matrix {
        let term = w[i as usize].conj() * m * w[j as usize];
        sum += if i == j { term.re } else { 2.0 * term.re };
    }
    sum
}

/// Integral of |grad u turned - grad v|^2 / 2 face by face (P1 eq. 15), from gradients in space.
fn conformal_energy_directly(patch: &Patch, w: &[Complex]) -> f64 {
    let face = |t: &[u32; 3]| {
        let p = t.map(|v| patch.positions[v as usize]);
        let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let twice = norm(normal);
        let n = scale(normal, 1.0 / twice);
        let gradient = |f: &dyn Fn(Complex) -> f64| {
            (0..3).fold([0.0; 3], |g, k| {
                let opposite = cross(n, sub(p[(k + 2) % 3], p[(k + 1) % 3]));
                add(g, scale(opposite, f(w[t[k] as usize]) / twice))
            })
        };
        let difference = sub(cross(n, gradient(&|w| w.re)), gradient(&|w| w.im));
        0.25 * twice * dot(difference, difference)
    };
    patch.triangles.iter().map(face).sum()
}

#[test]
fn the_matrix_gives_the_conformal_energy_and_the_spectral_map_minimises_it() {
    let patch = half_sphere(14);
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let domain = Domain::new(&patch, 0, Filling::default(), &work).unwrap();
    let mass = boundary_mass(&domain);
    assert!((mass.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    let matrix = conformal_matrix(&domain, &mass, 0.0).unwrap();
    let random: Vec<Complex> = (0..domain.size() as u32).map(|i| Complex::new(noise(i), noise(i + 5000))).collect();
    let (one, two) = (0.5 * form(&matrix, &random), conformal_energy_directly(&patch, &random));
    assert!((one / two - 1.0).abs() < 1e-10, "{one} {two}");

    for form in [Form::Condensed, Form::Whole] {
        let system = plan_as(&patch, form, &work).unwrap();
        let factor = factor_system(&patch, &system, Weights::Cotangent, &work).unwrap();
        let conformal = ConformalProblem::new(&domain, &factor, &work).unwrap();
        minimises(&patch, &domain, &factor, &conformal, &mass);
    }
}

/// The spectral map has the least ratio of energy and boundary moment; pinned maps have the least energy under their pins.
fn minimises(patch: &Patch, domain: &Domain<'_>, factor: &ChartFactor, conformal: &ConformalProblem, mass: &[f64]) {
    let cancel = CancelToken::new();
    let work = Work::silent(&cancel);
    let count = patch.positions.len();
    let complex = |uv: Vec<Vec2>| -> Vec<Complex> { uv.iter().map(|p| Complex::new(p[0], p[1])).collect() };
    let (solution, value) = conformal.spectral(&work).unwrap();
    let spectral = complex(solution.spread(factor, count).unwrap());
    let ratio = |w: &[Complex]| {
        let on: Vec<Complex> = domain.outer.iter().map(|&v| w[v as usize]).collect();
        let mean: Complex = on.iter().zip(mass).map(|(w, &m)| w * m).sum();
        2.0 * conformal_energy_directly(patch, w) / on.iter().zip(mass).map(|(w, m)| (w - mean).norm_sqr() * m).sum::<f64>()
    };
    assert!((ratio(&spectral) / value - 1.0).abs() < 1e-5, "{} {value}", ratio(&spectral));
    let ring = &domain.outer;
    let inner = (0..count as u32).filter(|v| !ring.contains(v)).collect::<Vec<_>>();
    let at = |k: usize| ring[k % ring.len()];
    let pair = [Complex::new(0.0, 0.0), Complex::new(1.0, 0.0)];
    let many = [(0.0, 0.0), (1.1, 0.1), (0.9, 1.2), (-0.2, 1.0), (0.4, 0.7)].map(|(x, y)| Complex::new(x, y));
    let cases: Vec<Vec<(u32, Complex)>> = vec![
        vec![(at(0), pair[0]), (at(ring.len() / 2), pair[1])],
        vec![(at(1), pair[0]), (at(3), pair[1])],
        vec![(inner[7], pair[0]), (at(5), pair[1])],
        vec![(inner[11], pair[0]), (inner[60], pair[1])],
        vec![(at(0), many[0]), (at(13), many[1]), (inner[70], many[2]), (at(40), many[3]), (inner[80], many[4])],
    ];
    for pins in cases {
        let pinned = complex(conformal.pinned(factor, &pins, &work).unwrap().spread(factor, count).unwrap());
        for &(v, target) in &pins {
            assert!((pinned[v as usize] - target).norm() < 1e-9, "{v}: {} {target}", pinned[v as usize]);
        }
        if pins.len() == 2 {
            assert!(ratio(&pinned) >= value * (1.0 - 1e-6));
        }
        // Stationary: no other map with these pins has less energy, tried in a few directions.
        let energy = conformal_energy_directly(patch, &pinned);
        for seed in 0..5u32 {
            let mut other = pinned.clone();
            for (v, w) in other.iter_mut().enumerate().filter(|(v, _)| pins.iter().all(|p| p.0 != *v as u32)) {
                *w += Complex::new(noise(seed * 9001 + v as u32) - 0.5, noise(seed * 77 + 3 * v as u32) - 0.5) * 1e-4;
            }
            assert!(conformal_energy_directly(patch, &other) > energy);
        }
    }
}

#[test]
fn charts_are_the_same_bit_for_bit() {
    let patch = half_sphere(10);
    for method in METHODS {
        assert_eq!(chart(&patch, ChartSpec::only(method)), chart(&patch, ChartSpec::only(method)));
    }
}

#[test]
fn a_rigid_motion_of_space_does_not_turn_the_chart() {
    let shape = |u: f64, v: f64| [3.0 * u, v * (1.0 + u), 0.3 * (5.0 * u * v).sin()];
    let (here, there) = (grid(11, 7, false, 0.4, shape), grid(11, 7, false, 0.4, |u, v| pose(5, 1.0, shape(u, v))));
    for method in METHODS {
        let (a, b) = (chart(&here, ChartSpec::only(method)), chart(&there, ChartSpec::only(method)));
        let apart = a.uv.iter().zip(&b.uv).map(|(p, q)| (p[0] - q[0]).hypot(p[1] - q[1])).fold(0.0, f64::max);
        assert!(apart < 1e-5, "{method:?} {apart}");
    }
}
