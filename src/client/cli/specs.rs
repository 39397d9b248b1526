//! From options of the command line to the specs of the protocol.

mod chart;
mod mesher;
mod size;

pub(crate) use chart::{chart_edit, merged_chart, names_vertices};
pub(crate) use size::{missing_size, size_choice, size_spec};

use super::args::{
    BorderChoice, ChartMethod, ChartSpecArgs, Encoding, FeatureAngle, FitChoice, ImportArgs, InputArgs, LimitArg, LockChoice, ObjRegions,
    PartitionStrategy, ReadFormat, RegionListArg, SampleName, SampleSpecArgs, Unit,
};
use super::failure::Outcome;
use super::files;
use crate::arrays::pack_u32;
use crate::{Client, v1};
use bytes::Bytes;
use v1::change::Change;
use v1::packed_array::Data;

/// Arrays up to this size travel in the message, larger ones as a blob.
const INLINE_BYTES: usize = 1 << 20;

pub(crate) fn import_options(args: &ImportArgs) -> v1::ImportOptions {
    let format = args.format.map_or(v1::MeshFormat::Unspecified, |format| match format {
        ReadFormat::Stl => v1::MeshFormat::Stl,
        ReadFormat::Obj => v1::MeshFormat::Obj,
        ReadFormat::Ply => v1::MeshFormat::Ply,
        ReadFormat::Off => v1::MeshFormat::Off,
        ReadFormat::Msh => v1::MeshFormat::Msh,
        ReadFormat::Gltf => v1::MeshFormat::Gltf,
    });
    let unit = args.unit.map_or(v1::LengthUnit::Unspecified, |unit| match unit {
        Unit::M => v1::LengthUnit::Metre,
        Unit::Cm => v1::LengthUnit::Centimetre,
        Unit::Mm => v1::LengthUnit::Millimetre,
        Unit::Um => v1::LengthUnit::Micrometre,
        Unit::Inch => v1::LengthUnit::Inch,
        Unit::Foot => v1::LengthUnit::Foot,
    });
    let regions = args.obj_regions.map_or(v1::ObjRegions::Unspecified, |what| match what {
        ObjRegions::Group => v1::ObjRegions::Group,
        ObjRegions::Object => v1::ObjRegions::Object,
        ObjRegions::Material => v1::ObjRegions::Material,
    });
    v1::ImportOptions {
        format: format.into(),
        weld_tolerance: args.weld_tolerance.unwrap_or_default(),
        assume_unit: unit.into(),
        obj_regions: regions.into(),
        only_regions: args.only_region.clone(),
    }
}

pub(crate) fn sample_spec(args: &SampleSpecArgs) -> v1::SampleSpec {
    let kind = match args.name {
        SampleName::Artery => v1::SampleKind::Artery,
        SampleName::Pelvis => v1::SampleKind::Pelvis,
        SampleName::Brake => v1::SampleKind::Brake,
        SampleName::CadPart => v1::SampleKind::CadPart,
        SampleName::Tube => v1::SampleKind::Tube,
        SampleName::Lattice => v1::SampleKind::Lattice,
    };
    v1::SampleSpec {
        kind: kind.into(),
        triangles: args.triangles.or(args.resolution.map(|n| 2 * n * n)),
        genus: args.genus,
        outlets: args.outlets,
        aspect_ratio: args.aspect_ratio,
    }
}

pub(crate) fn encoding(encoding: Option<Encoding>) -> v1::MeshEncoding {
    match encoding {
        None => v1::MeshEncoding::Unspecified,
        Some(Encoding::Ascii) => v1::MeshEncoding::Ascii,
        Some(Encoding::Binary) => v1::MeshEncoding::Binary,
        Some(Encoding::Msh22) => v1::MeshEncoding::Msh22,
    }
}

async fn packed(client: &Client, bytes: Bytes) -> Outcome<v1::PackedArray> {
    let data = if bytes.len() <= INLINE_BYTES { Data::Inline(bytes) } else { Data::Blob(client.upload(bytes, |_| {}).await?) };
    Ok(v1::PackedArray { data: Some(data) })
}

/// The changes that the options ask for. A spec replaces the former one as a whole, so options are put into the `current` inputs.
pub(crate) async fn changes(
    client: &Client,
    args: &InputArgs,
    method: Option<ChartMethod>,
    current: &v1::SessionInputs,
) -> Outcome<Vec<Change>> {
    let mut changes = Vec::new();
    let mut features = current.features.clone().unwrap_or_default();
    if put_features(args, &mut features) {
        if let Some(file) = &args.feature_edges {
            features.explicit_edges = Some(packed(client, pack_u32(files::read_edges(file)?.as_flattened())).await?);
        }
        changes.push(Change::Features(features));
    }
    let mut partition = current.partition.unwrap_or_default();
    if put_partition(args, &mut partition) {
        changes.push(Change::Partition(partition));
    }
    if method.is_some() {
        let edit = chart_edit(&ChartSpecArgs { method, ..Default::default() })?;
        changes.push(Change::Charts(merged_chart(current.charts.clone().unwrap_or_default(), edit)));
    }
    if let Some(choice) = &args.lock {
        use v1::lock_spec::Lock;
        let lock = match choice {
            LockChoice::Nothing => Lock::Nothing(v1::NoLock {}),
            LockChoice::Boundary => Lock::Boundary(v1::BoundaryLock {}),
            LockChoice::Loops(vertices) => Lock::Loops(packed(client, pack_u32(vertices)).await?),
            LockChoice::Vertices(vertices) => Lock::Vertices(packed(client, pack_u32(vertices)).await?),
        };
        changes.push(Change::Lock(v1::LockSpec { lock: Some(lock), count: 0 }));
    }
    let mesher = current.mesher.clone().unwrap_or_default();
    if let Some(spec) = mesher::mesher_spec(client, &args.mesher, &mesher).await? {
        changes.push(Change::Mesher(spec));
    }
    let mut optimize = current.optimize.unwrap_or_default();
    if args.rounds.is_some() || args.min_kappa.is_some() || args.fit.is_some() {
        optimize.rounds = args.rounds.or(optimize.rounds);
        optimize.min_kappa = args.min_kappa.or(optimize.min_kappa);
        if let Some(choice) = args.fit {
            optimize.set_fit(match choice {
                FitChoice::Faces => v1::SurfaceFit::Faces,
                FitChoice::Vertices => v1::SurfaceFit::Vertices,
            });
        }
        changes.push(Change::Optimize(optimize));
    }
    Ok(changes)
}

fn put_features(args: &InputArgs, spec: &mut v1::FeatureSpec) -> bool {
    use v1::feature_spec::SharpEdges;
    if let Some(angle) = args.feature_angle {
        spec.sharp_edges = Some(match angle {
            FeatureAngle::Degrees(degrees) => SharpEdges::FeatureAngle(degrees),
            FeatureAngle::None => SharpEdges::NoSharpEdges(true),
        });
    }
    spec.min_chain_share = args.min_chain.or(spec.min_chain_share);
    if args.ignore_region_borders || args.keep_region_borders {
        spec.set_region_borders(if args.ignore_region_borders { v1::RegionBorders::Ignore } else { v1::RegionBorders::Keep });
    }
    let region_borders = args.ignore_region_borders || args.keep_region_borders;
    let compounds = put_compounds(args, spec);
    compounds || args.feature_angle.is_some() || args.min_chain.is_some() || region_borders || args.feature_edges.is_some()
}

fn put_compounds(args: &InputArgs, spec: &mut v1::FeatureSpec) -> bool {
    let named = !args.compounds.is_empty() || args.merge_angle.is_some() || args.merge_below_size.is_some();
    if named {
        let compounds = spec.compounds.get_or_insert_default();
        if !args.compounds.is_empty() {
            // Lists named anew replace the former ones.
            let lists = args.compounds.iter().filter_map(|list| match list {
                RegionListArg::Regions(regions) => Some(v1::RegionList { regions: regions.clone() }),
                RegionListArg::None => None,
            });
            compounds.lists = lists.collect();
        }
        let put = |value: &mut Option<f64>, arg: Option<LimitArg>| match arg {
            Some(LimitArg::Below(limit)) => *value = Some(limit),
            Some(LimitArg::None) => *value = None,
            None => {}
        };
        put(&mut compounds.merge_angle, args.merge_angle);
        put(&mut compounds.merge_below_size, args.merge_below_size);
    }
    named
}

fn put_partition(args: &InputArgs, spec: &mut v1::PartitionSpec) -> bool {
    spec.patches = args.patches.or(spec.patches);
    spec.max_patch_faces = args.max_patch_faces.or(spec.max_patch_faces);
    spec.max_aspect_ratio = args.max_aspect_ratio.or(spec.max_aspect_ratio);
    if let Some(strategy) = args.partition_strategy {
        spec.set_strategy(match strategy {
            PartitionStrategy::Auto => v1::PartitionStrategy::Auto,
            PartitionStrategy::Multilevel => v1::PartitionStrategy::Multilevel,
            PartitionStrategy::Laplace => v1::PartitionStrategy::Laplace,
            PartitionStrategy::MaxCut => v1::PartitionStrategy::MaxCut,
            PartitionStrategy::Handles => v1::PartitionStrategy::Handles,
            PartitionStrategy::Pants => v1::PartitionStrategy::Pants,
            PartitionStrategy::Plane => v1::PartitionStrategy::Plane,
        });
        // A strategy named anew has the plane named with it, or finds one.
        spec.plane = None;
    }
    if let Some(plane) = args.plane {
        let point = |[x, y, z]: [f64; 3]| Some(v1::Point { x, y, z });
        spec.plane = Some(v1::CutPlane { point: point(plane.point), normal: point(plane.normal) });
    }
    if let Some(borders) = args.borders {
        spec.set_borders(match borders {
            BorderChoice::Vote => v1::PartitionBorders::Vote,
            BorderChoice::Shortest => v1::PartitionBorders::Shortest,
            BorderChoice::Geodesic => v1::PartitionBorders::Geodesic,
        });
    }
    let numbers = args.patches.is_some() || args.max_patch_faces.is_some() || args.max_aspect_ratio.is_some();
    numbers || args.partition_strategy.is_some() || args.plane.is_some() || args.borders.is_some()
}

#[cfg(test)]
mod tests {
    use super::super::args::PlaneArg;
    use super::*;

    #[test]
    fn options_are_put_into_the_current_inputs() {
        let mut features = v1::FeatureSpec { min_chain_share: Some(0.1), ..Default::default() };
        let args = InputArgs { feature_angle: Some(FeatureAngle::None), ignore_region_borders: true, ..Default::default() };
        assert!(put_features(&args, &mut features));
        assert_eq!(features.min_chain_share, Some(0.1));
        assert_eq!(features.sharp_edges, Some(v1::feature_spec::SharpEdges::NoSharpEdges(true)));
        assert_eq!(features.region_borders(), v1::RegionBorders::Ignore);
        assert!(!put_features(&InputArgs::default(), &mut features));
        let mut partition = v1::PartitionSpec { patches: Some(3), ..Default::default() };
        assert!(put_partition(&InputArgs { max_patch_faces: Some(100), ..Default::default() }, &mut partition));
        assert_eq!((partition.patches, partition.max_patch_faces), (Some(3), Some(100)));
        let plane = PlaneArg { point: [1.0, 2.0, 3.0], normal: [0.0, 0.0, -1.0] };
        let args = InputArgs { partition_strategy: Some(PartitionStrategy::Plane), plane: Some(plane), ..Default::default() };
        assert!(put_partition(&args, &mut partition));
        assert_eq!(partition.plane.and_then(|p| p.normal), Some(v1::Point { x: 0.0, y: 0.0, z: -1.0 }));
        assert!(put_partition(&InputArgs { borders: Some(BorderChoice::Shortest), ..Default::default() }, &mut partition));
        assert!(partition.plane.is_some() && partition.strategy() == v1::PartitionStrategy::Plane, "other options leave the plane");
        let laplace = InputArgs { partition_strategy: Some(PartitionStrategy::Laplace), ..Default::default() };
        assert!(put_partition(&laplace, &mut partition) && partition.plane.is_none());
        assert_eq!(partition.borders(), v1::PartitionBorders::Shortest);
    }

    #[test]
    fn resolution_is_a_linear_measure() {
        let args = SampleSpecArgs {
            name: SampleName::Brake,
            triangles: None,
            resolution: Some(100),
            genus: None,
            outlets: None,
            aspect_ratio: None,
        };
        assert_eq!(sample_spec(&args).triangles, Some(20_000));
    }
}
