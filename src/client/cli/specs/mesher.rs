//! The planar mesher and the metric it follows.

use super::super::args::{MesherArgs, MesherName, MetricArgs};
use super::super::failure::{Failure, Outcome};
use super::super::files;
use super::packed;
use crate::arrays::pack_f64;
use crate::{Client, v1};
use v1::metric_spec::Source;

/// The mesher that the options ask for; `None` if they say nothing. What is not named stays as in `current`, if its mesher stays.
pub(super) async fn mesher_spec(client: &Client, args: &MesherArgs, current: &v1::MesherSpec) -> Outcome<Option<v1::MesherSpec>> {
    if *args == MesherArgs::default() {
        return Ok(None);
    }
    let mut spec = put_mesher(args, current)?;
    if let Some(file) = &args.metric.metric_file {
        let numbers = files::read_signed_numbers(file)?;
        let tensors = packed(client, pack_f64(&numbers)).await?;
        spec.metric.get_or_insert_default().source = Some(Source::Tensors(tensors));
    }
    Ok(Some(spec))
}

fn put_mesher(args: &MesherArgs, current: &v1::MesherSpec) -> Outcome<v1::MesherSpec> {
    let usage = |message: &str| Err(Failure::Usage(message.into()));
    let kind = args.mesher.map_or(current.kind(), |name| match name {
        MesherName::Frontal => v1::MesherKind::Frontal,
        MesherName::Delaunay => v1::MesherKind::Delaunay,
        MesherName::MeshAdapt => v1::MesherKind::MeshAdapt,
        MesherName::Anisotropic => v1::MesherKind::Anisotropic,
        MesherName::Quads => v1::MesherKind::Quads,
    });
    let mut spec = if kind == current.kind() { current.clone() } else { v1::MesherSpec::default() };
    spec.set_kind(kind);
    if args.min_angle.is_some() && kind != v1::MesherKind::Delaunay {
        return usage("--min-angle goes with --mesher delaunay");
    }
    if args.all_quads && kind != v1::MesherKind::Quads {
        return usage("--all-quads goes with --mesher quads");
    }
    spec.all_quads = if args.mesher.is_some() { args.all_quads } else { spec.all_quads || args.all_quads };
    spec.min_angle = args.min_angle.or(spec.min_angle);
    if args.metric == MetricArgs::default() {
        return Ok(spec);
    }
    if kind != v1::MesherKind::Anisotropic {
        return usage("--max-stretch and the --metric options go with --mesher anisotropic");
    }
    let m = &args.metric;
    let metric = spec.metric.get_or_insert_default();
    if m.metric_deviation.is_some() || m.metric_normal_angle.is_some() {
        let curvature = v1::CurvatureMetric { deviation: m.metric_deviation, normal_angle: m.metric_normal_angle };
        metric.source = Some(Source::Curvature(curvature));
    }
    metric.min_size = m.metric_min_size.or(metric.min_size);
    metric.max_size = m.metric_max_size.or(metric.max_size);
    metric.max_stretch = m.max_stretch.or(metric.max_stretch);
    metric.growth_rate = m.metric_growth_rate.or(metric.growth_rate);
    Ok(spec)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_go_with_their_mesher() {
        let frontal = v1::MesherSpec::default();
        let args = |mesher, min_angle, max_stretch| MesherArgs {
            mesher,
            min_angle,
            all_quads: false,
            metric: MetricArgs { max_stretch, ..MetricArgs::default() },
        };
        let delaunay = put_mesher(&args(Some(MesherName::Delaunay), Some(20.0), None), &frontal).unwrap();
        assert_eq!((delaunay.kind(), delaunay.min_angle), (v1::MesherKind::Delaunay, Some(20.0)));
        assert!(put_mesher(&args(None, Some(20.0), None), &frontal).is_err());
        assert!(put_mesher(&args(Some(MesherName::MeshAdapt), None, Some(5.0)), &frontal).is_err());
        let stretched = put_mesher(&args(Some(MesherName::Anisotropic), None, Some(5.0)), &delaunay).unwrap();
        assert_eq!((stretched.min_angle, stretched.metric.clone().and_then(|m| m.max_stretch)), (None, Some(5.0)));
        let quads = |mesher, all_quads| MesherArgs { mesher, all_quads, ..MesherArgs::default() };
        let all = put_mesher(&quads(Some(MesherName::Quads), true), &delaunay).unwrap();
        assert_eq!((all.kind(), all.all_quads, all.min_angle), (v1::MesherKind::Quads, true, None));
        assert!(!put_mesher(&quads(Some(MesherName::Quads), false), &all).unwrap().all_quads);
        assert!(put_mesher(&quads(Some(MesherName::Frontal), true), &all).is_err());
        // What is not named stays while the mesher does.
        let mut finer = args(None, None, None);
        finer.metric.metric_deviation = Some(0.1);
        let metric = put_mesher(&finer, &stretched).unwrap().metric.unwrap();
        assert_eq!(metric.max_stretch, Some(5.0));
        assert!(matches!(metric.source, Some(Source::Curvature(c)) if c.deviation == Some(0.1)));
    }
}
