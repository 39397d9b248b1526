//! Size fields through the whole pipeline: what is recomputed, what comes out.

use remesh_engine::engine::{Engine, EngineConfig};
use remesh_engine::fingerprint::{Contents, Fingerprint};
use remesh_engine::import::ImportOptions;
use remesh_engine::mesh::SurfaceMesh;
use remesh_engine::optimize::{OptimizeSpec, Remeshed, SurfaceFit};
use remesh_engine::partition::PartitionSpec;
use remesh_engine::pipeline::{self, Answer, Remesh, Run};
use remesh_engine::sample::{SampleKind, SampleSpec};
use remesh_engine::session::{Change, MeshSource, Session};
use remesh_engine::sizing::{
    CenterlineMeasure, CenterlineSize, ComposedSize, CurvatureSize, ProximitySize, Shape, ShapeSize, Sides, SizeBase, SizeFieldSpec,
    SizeSpec,
};
use remesh_engine::stage::{Outcome, Stage, StageRecord, Subject};
use remesh_engine::vector::{Vec3, add, distance, norm, scale, unit};
use remesh_engine::work::CancelToken;
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;
use std::time::SystemTime;

fn engine() -> Arc<Engine> {
    Engine::new(EngineConfig::default())
}

fn open(engine: &Engine, changes: &[Change]) -> Arc<Session> {
    let session = engine.create_session(None, SystemTime::now()).unwrap();
    session.apply(None, changes).unwrap();
    session
}

fn remesh(engine: &Engine, session: &Session, threads: usize) -> Answer<Remesh> {
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads };
    pipeline::remesh(engine, &session.snapshot(), &run).unwrap()
}

fn ran(records: &[StageRecord]) -> BTreeSet<&'static str> {
    records.iter().filter(|r| r.outcome == Outcome::Run).map(|r| r.stage.name()).collect()
}

fn tube() -> Change {
    let spec = SampleSpec { kind: SampleKind::Tube, triangles: 6000, genus: None, outlets: None, aspect_ratio: Some(6.0) };
    Change::Mesh { source: MeshSource::Sample(spec), options: ImportOptions::default() }
}

fn composed(fields: Vec<SizeFieldSpec>, max_size: f64) -> ComposedSize {
    ComposedSize { base: SizeBase::MaxSize, fields, min_size: Some(max_size / 10.0), max_size: Some(max_size), growth_rate: Some(1.3) }
}

fn size(spec: ComposedSize) -> Change {
    Change::Size(SizeSpec::Composed(spec))
}

/// One field of every dear kind.
fn dear(normal_angle: f64, elements_per_gap: f64) -> Vec<SizeFieldSpec> {
    vec![
        SizeFieldSpec::Curvature(CurvatureSize { normal_angle_deg: Some(normal_angle), deviation: None, smoothing: 2 }),
        SizeFieldSpec::Proximity(ProximitySize { elements_per_gap, sides: Sides::Both, reach: None }),
        SizeFieldSpec::Thickness { elements: elements_per_gap },
        SizeFieldSpec::Centerline(CenterlineSize { lines: None, measure: CenterlineMeasure::Radius, elements_around: 20.0 }),
    ]
}

/// A typical edge of the surface of a session, to choose sizes by.
fn usual_size(engine: &Engine, change: &Change) -> f64 {
    let session = open(engine, &[change.clone(), Change::Size(SizeSpec::TriangleCount { triangles: 3000 })]);
    remesh(engine, &session, 2).value.sizes.uniform.unwrap()
}

#[test]
fn measures_are_not_taken_again_for_other_lengths() {
    let engine = engine();
    let h = usual_size(&engine, &tube());
    let session = open(&engine, &[tube(), size(composed(dear(20.0, 4.0), 2.0 * h))]);
    let first = ran(&remesh(&engine, &session, 2).records);
    let measures = ["curvature", "proximity", "thickness", "centerline"];
    assert!(measures.iter().all(|stage| first.contains(stage)), "{first:?}");
    session.apply(None, &[size(composed(dear(17.0, 4.5), 1.5 * h))]).unwrap();
    let cancel = CancelToken::new();
    let run = Run { cancel: &cancel, events: &|_| {}, threads: 1 };
    let planned = ran(&pipeline::plan(&engine, &session.snapshot(), &run).unwrap());
    let second = ran(&remesh(&engine, &session, 2).records);
    assert_eq!(second, BTreeSet::from(["size", "curve", "planar", "lift", "interior", "assembly", "optimize"]));
    assert_eq!(planned, second);
    // Another smoothing is another measure.
    let mut fields = dear(17.0, 4.5);
    fields[0] = SizeFieldSpec::Curvature(CurvatureSize { normal_angle_deg: Some(17.0), deviation: None, smoothing: 5 });
    session.apply(None, &[size(composed(fields, 1.5 * h))]).unwrap();
    let third = ran(&remesh(&engine, &session, 2).records);
    assert!(third.contains("curvature") && !third.contains("proximity") && !third.contains("thickness"), "{third:?}");
}

#[test]
fn the_size_of_one_patch_leaves_patches_farther_away_alone() {
    let engine = engine();
    let h = usual_size(&engine, &tube());
    let cut = Change::Partition(PartitionSpec { patches: Some(8), ..PartitionSpec::default() });
    let spec = |fields| ComposedSize { base: SizeBase::Uniform(h), fields, ..ComposedSize::default() };
    let session = open(&engine, &[tube(), cut, size(spec(Vec::new()))]);
    let before = remesh(&engine, &session, 2).value;
    let patches = &before.charts.patches;
    let count = patches.patches.len();
    assert!(count >= 6, "{count} patches");
    let chosen = 0;
    let field = SizeFieldSpec::Patch { patch: patches.identities[chosen], size: 0.5 * h };
    session.apply(None, &[size(spec(vec![field]))]).unwrap();
    let answer = remesh(&engine, &session, 2);
    let touched: BTreeSet<u32> = patches.patches[chosen].2.vertices.iter().copied().collect();
    let meshed: BTreeSet<usize> = answer
        .records
        .iter()
        .filter(|r| r.stage == Stage::Planar && r.outcome == Outcome::Run)
        .filter_map(|r| if let Subject::Patch(p) = r.subject { Some(p as usize) } else { None })
        .collect();
    let neighbours: BTreeSet<usize> = (0..count).filter(|&p| patches.patches[p].2.vertices.iter().any(|v| touched.contains(v))).collect();
    assert!(meshed.contains(&chosen) && meshed.is_subset(&neighbours) && neighbours.len() < count, "{meshed:?} of {neighbours:?}");
    // Half the length inside, the old one elsewhere.
    let faces = |remesh: &Remesh, p: usize| remesh.result.face_patch.iter().filter(|&&q| q as usize == p).count() as f64;
    assert!(faces(&answer.value, chosen) > 2.5 * faces(&before, chosen));
    // A patch that is not there is waited for.
    let gone = SizeFieldSpec::Patch { patch: Fingerprint([1; 16]), size: 0.01 * h };
    session.apply(None, &[size(spec(vec![gone]))]).unwrap();
    assert_eq!(remesh(&engine, &session, 2).value.result.fingerprint(), before.result.fingerprint());
}

#[test]
fn threads_and_history_do_not_change_bits() {
    let one = engine();
    let h = usual_size(&one, &tube());
    let ball = SizeFieldSpec::Shape(ShapeSize {
        shape: Shape::Sphere { center: [0.0; 3], radius: 5.0 * h },
        size: 0.4 * h,
        growth_rate: Some(1.2),
    });
    let fields: Vec<SizeFieldSpec> = dear(15.0, 6.0).into_iter().chain([ball]).collect();
    let changes = [tube(), size(composed(fields, 2.0 * h))];
    let fresh = engine();
    let expected = remesh(&fresh, &open(&fresh, &changes), 1).value.result.fingerprint();
    assert_eq!(remesh(&one, &open(&one, &changes), 3).value.result.fingerprint(), expected);
}

#[test]
fn a_number_of_triangles_is_met_with_fields() {
    let engine = engine();
    let h = usual_size(&engine, &tube());
    let ball =
        SizeFieldSpec::Shape(ShapeSize { shape: Shape::Sphere { center: [0.0; 3], radius: 4.0 * h }, size: 0.5 * h, growth_rate: None });
    let curved = SizeFieldSpec::Curvature(CurvatureSize { normal_angle_deg: Some(25.0), deviation: None, smoothing: 2 });
    for triangles in [4000, 8000] {
        let spec = ComposedSize {
            base: SizeBase::Triangles(triangles),
            fields: vec![ball.clone(), curved.clone()],
            growth_rate: Some(1.25),
            ..ComposedSize::default()
        };
        let made = remesh(&engine, &open(&engine, &[tube(), size(spec)]), 2).value.result.mesh.triangles.len();
        assert!((made as f64 / triangles as f64 - 1.0).abs() < 0.1, "{made} of {triangles}");
    }
}

/// A sphere of radius 1 by subdividing an octahedron.
fn sphere(level: u32) -> SurfaceMesh {
    let mut points: Vec<Vec3> = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    let mut faces = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5u32]];
    for _ in 0..level {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let [x, y, z] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    points.push(unit(add(points[p as usize], points[q as usize])));
                    points.len() as u32 - 1
                })
            });
            finer.extend([[a, x, z], [x, b, y], [z, y, c], [x, y, z]]);
        }
        faces = finer;
    }
    SurfaceMesh::from_parts(points, faces)
}

#[test]
fn deviation_bounds_the_chordal_error() {
    let source = MeshSource::from_arrays(sphere(6));
    let mesh = Change::Mesh { source, options: ImportOptions::default() };
    for deviation in [0.02, 0.005] {
        let field = SizeFieldSpec::Curvature(CurvatureSize { normal_angle_deg: None, deviation: Some(deviation), smoothing: 2 });
        let spec = ComposedSize { base: SizeBase::Uniform(10.0), fields: vec![field], ..ComposedSize::default() };
        let engine = engine();
        let session = open(&engine, &[mesh.clone(), size(spec)]);
        let fitted = remesh(&engine, &session, 2).value.result;
        let off = fitted.mesh.positions.iter().map(|p| (norm(*p) - 1.0).abs()).fold(0.0, f64::max);
        assert!(off <= deviation, "{off} over {deviation}");
        // The field answers for a mesh whose vertices lie on the surface.
        session.apply(None, &[Change::Optimize(OptimizeSpec { fit: SurfaceFit::Vertices, ..OptimizeSpec::default() })]).unwrap();
        let result = remesh(&engine, &session, 2).value.result;
        let sag = |t: &[u32; 3], of: &Remeshed| {
            let [a, b, c] = t.map(|v| of.mesh.positions[v as usize]);
            let middle = scale(add(add(a, b), c), 1.0 / 3.0);
            let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| norm(scale(add(p, q), 0.5)));
            1.0 - sides.into_iter().fold(norm(middle), f64::min)
        };
        let cut = fitted.mesh.triangles.iter().map(|t| sag(t, &fitted)).fold(0.0, f64::max);
        assert!(cut <= 0.7 * deviation, "{cut}: fitted faces cut less deep than {deviation}");
        let worst = result.mesh.triangles.iter().map(|t| sag(t, &result)).fold(0.0, f64::max);
        let longest =
            result.mesh.triangles.iter().map(|t| distance(result.mesh.positions[t[0] as usize], result.mesh.positions[t[1] as usize]));
        let longest = longest.fold(0.0, f64::max);
        assert!(worst <= deviation, "{worst} over {deviation}, longest edge {longest}");
        assert!(worst >= 0.5 * deviation, "{worst} is far below {deviation}: more triangles than needed");
    }
}

/// The table of DESIGN section 2, "size on a curve": that curve and the patches beside it, no chart.
#[test]
fn a_size_on_a_curve_meshes_that_curve_and_its_patches_and_maps_nothing() {
    let engine = engine();
    let h = usual_size(&engine, &tube());
    let cut = Change::Partition(PartitionSpec { patches: Some(8), ..PartitionSpec::default() });
    let spec = |fields| ComposedSize { base: SizeBase::Uniform(h), fields, ..ComposedSize::default() };
    let session = open(&engine, &[tube(), cut, size(spec(Vec::new()))]);
    let charts = remesh(&engine, &session, 2).value.charts;
    let (mesh, topology) = charts.ground();
    let curve = &charts.patches.network.curves[0];
    let center = mesh.positions[topology.origin(curve.halfedges[curve.halfedges.len() / 2]) as usize];
    let shape = Shape::Sphere { center, radius: 1.5 * h };
    session.apply(None, &[size(spec(vec![SizeFieldSpec::Shape(ShapeSize { shape, size: 0.5 * h, growth_rate: None })]))]).unwrap();
    let records = remesh(&engine, &session, 2).records;
    let of = |stage: Stage| -> BTreeSet<Subject> {
        records.iter().filter(|r| r.stage == stage && r.outcome == Outcome::Run).map(|r| r.subject).collect()
    };
    for stage in [Stage::Partition, Stage::Cut, Stage::System, Stage::Factor, Stage::Boundary, Stage::Solve, Stage::Chart] {
        assert!(of(stage).is_empty(), "{stage:?} ran");
    }
    let (curves, planar) = (of(Stage::Curve), of(Stage::Planar));
    assert!(curves.contains(&Subject::Curve(0)) && curves.len() < charts.patches.network.curves.len(), "{curves:?}");
    let beside = |p: usize| charts.patches.uses[p].iter().any(|u| curves.contains(&Subject::Curve(u.curve)));
    let wanted: BTreeSet<Subject> = (0..charts.charts.len()).filter(|&p| beside(p)).map(|p| Subject::Patch(p as u32)).collect();
    assert!(planar == wanted && wanted.len() < charts.charts.len(), "{planar:?} {wanted:?}");
}
