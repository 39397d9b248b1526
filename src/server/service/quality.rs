//! `QualityService`: how good a mesh is, measured against another.

use crate::convert::{from_proto, sources, to_proto};
use crate::dispatch::{Call, Intent, Weight};
use crate::state::{Shared, Target};
use remesh_engine::error::Result as EngineResult;
use remesh_engine::pipeline::{self, Run};
use remesh_proto::v1;
use remesh_proto::v1::quality_service_server::QualityService;
use std::sync::Arc;
use std::time::Instant;
use tonic::{Request, Response, Status};

/// The service.
#[derive(Debug, Clone)]
pub(crate) struct Qualities(pub(crate) Arc<Shared>);

pub(super) fn measure(shared: &Shared, run: &Run<'_>, target: &Target, scope: i32) -> EngineResult<v1::GetQualityResponse> {
    let begin = Instant::now();
    let answer = pipeline::quality(&shared.engine, &target.snapshot, from_proto::scope(scope, "scope")?, run)?;
    Ok(v1::GetQualityResponse {
        revision: target.revision(),
        report: Some(to_proto::quality(&answer.value.1)),
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
    })
}

fn compare(shared: &Shared, run: &Run<'_>, request: v1::CompareMeshesRequest) -> EngineResult<v1::CompareMeshesResponse> {
    let begin = Instant::now();
    let scope = from_proto::scope(request.scope, "scope")?;
    let input = sources::mesh_file(&shared.engine, request.input, "input")?;
    let output = sources::mesh_file(&shared.engine, request.output, "output")?;
    let answer = pipeline::compare(&shared.engine, (&input.0, &input.1), (&output.0, &output.1), request.size, scope, run)?;
    Ok(v1::CompareMeshesResponse {
        report: Some(to_proto::quality(&answer.value)),
        summary: Some(to_proto::summary(&answer.records, begin.elapsed().as_secs_f64() * 1e3)),
    })
}

#[tonic::async_trait]
impl QualityService for Qualities {
    async fn get_quality(&self, request: Request<v1::GetQualityRequest>) -> Result<Response<v1::GetQualityResponse>, Status> {
        let mut call = Call::begin(&self.0, "GetQuality", &request)?;
        let request = request.into_inner();
        let target = call.target(&request.session, request.expected_revision)?;
        let planned = target.clone();
        let weigh = move |shared: &Shared, run: &Run<'_>| {
            let scope = from_proto::scope(request.scope, "scope")?;
            Ok(Intent::of_plan(&pipeline::plan_quality(&shared.engine, &planned.snapshot, scope, run)?))
        };
        let weight = Weight::planned(weigh);
        call.compute(weight, move |shared, run| measure(shared, run, &target, request.scope)).await
    }

    async fn compare_meshes(&self, request: Request<v1::CompareMeshesRequest>) -> Result<Response<v1::CompareMeshesResponse>, Status> {
        let call = Call::begin(&self.0, "CompareMeshes", &request)?;
        let request = request.into_inner();
        call.compute(Intent::Long, move |shared, run| compare(shared, run, request)).await
    }
}
