//! Charts of single patches: their specs, their data, previews and plans.

use crate::arrays::{Columns, check_indices};
use crate::connection::Client;
use crate::error::{ClientError, Result};
use crate::retry::{new_request_id, send};
use prost_types::FieldMask;
use remesh_proto::v1;
use v1::{DataColumn, preview_patch_chart_response, read_chart_data_response};

/// Distortion of one face of a chart, with equal total areas in the plane and on the surface, by the singular values a >= b of its map.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FaceDistortion {
    /// a / b; 1 is conformal.
    pub angle: f64,
    /// a b, negative for a flipped face; 1 keeps the area.
    pub area: f64,
    /// Root mean square of 1/a and 1/b; 1 everywhere is isometric.
    pub stretch: f64,
}

/// A chart: the map of one patch to the plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChartData {
    /// Revision of the session it belongs to.
    pub revision: u64,
    /// Its numbers.
    pub summary: v1::ChartSummary,
    /// What ran for it.
    pub run: v1::RunSummary,
    /// Place of each local vertex in the plane; empty in a preview without a map.
    pub uv: Vec<[f64; 2]>,
    /// Place of each local vertex in space.
    pub positions: Vec<[f64; 3]>,
    /// Local vertices of each face.
    pub triangles: Vec<[u32; 3]>,
    /// Vertex of the imported mesh for each local vertex.
    pub source_vertex: Vec<u32>,
    /// Face of the imported mesh for each local face.
    pub source_face: Vec<u32>,
    /// Distortion of each face; empty in a preview without a map.
    pub distortion: Vec<FaceDistortion>,
    /// Whether each face is clockwise or flat in the plane; empty in a preview without a map.
    pub flipped: Vec<bool>,
}

/// The chart that a patch would have under another spec.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChartPreview {
    /// The last map that was tried, usable or not.
    pub chart: ChartData,
    /// What to make of it.
    pub verdict: v1::ChartVerdict,
    /// Why it is not usable.
    pub error: Option<v1::ChartError>,
    /// The spec that was tried, defaults filled in.
    pub spec: v1::ChartSpec,
}

/// A chart spec, as a whole or in parts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChartEdit {
    /// The spec.
    pub spec: v1::ChartSpec,
    /// Which parts of it are meant (`method`, `outer_vertex`, `holes`, `pins`, `boundary`, `boundary.shape`, `boundary.spacing`,
    /// `boundary.start_vertex`); the other parts stay as they are. Empty: all.
    pub paths: Vec<String>,
}

impl ChartEdit {
    fn mask(&self) -> Option<FieldMask> {
        (!self.paths.is_empty()).then(|| FieldMask { paths: self.paths.clone() })
    }
}

const COLUMNS: [DataColumn; 9] = [
    DataColumn::Uv,
    DataColumn::Positions,
    DataColumn::Triangles,
    DataColumn::SourceVertex,
    DataColumn::SourceFace,
    DataColumn::FaceAngleDistortion,
    DataColumn::FaceAreaDistortion,
    DataColumn::FaceStretch,
    DataColumn::FaceFlipped,
];

impl Client {
    /// The spec that a patch follows, and its chart or what is wrong with it.
    ///
    /// # Errors
    /// `PATCH_NOT_FOUND`, those of [`Client::parametrize`].
    pub async fn get_patch_chart(&self, session: &str, patch: u32) -> Result<v1::GetPatchChartResponse> {
        let request = v1::GetPatchChartRequest { session: session.to_owned(), expected_revision: None, patch };
        Ok(send!(self.charts.get_patch_chart(request)))
    }

    /// Gives a patch a spec of its own, or changes it. With `base`, only if that is the current revision.
    ///
    /// # Errors
    /// `BAD_PARAMETER` for a spec that contradicts itself or names a vertex outside of the patch, `PATCH_NOT_FOUND`,
    /// `STALE_REVISION`.
    pub async fn update_patch_chart(
        &self,
        session: &str,
        patch: u32,
        edit: ChartEdit,
        base: Option<u64>,
    ) -> Result<v1::UpdatePatchChartResponse> {
        let update_mask = edit.mask();
        let request = v1::UpdatePatchChartRequest {
            session: session.to_owned(),
            base_revision: base,
            patch,
            spec: Some(edit.spec),
            update_mask,
            request_id: new_request_id(),
        };
        Ok(send!(self.charts.update_patch_chart(request)))
    }

    /// Takes the own spec of a patch back.
    ///
    /// # Errors
    /// `PATCH_NOT_FOUND`, `STALE_REVISION`.
    pub async fn reset_patch_chart(&self, session: &str, patch: u32, base: Option<u64>) -> Result<v1::ResetPatchChartResponse> {
        let request = v1::ResetPatchChartRequest { session: session.to_owned(), base_revision: base, patch, request_id: new_request_id() };
        Ok(send!(self.charts.reset_patch_chart(request)))
    }

    /// What the charts, or the preview of one, would find cached and what they would compute; computes nothing.
    ///
    /// # Errors
    /// `NO_MESH`, and those of [`Client::update_patch_chart`] for a proposal.
    pub async fn plan_charts(&self, session: &str, proposal: Option<(u32, ChartEdit)>) -> Result<v1::PlanChartsResponse> {
        let preview = proposal.map(|(patch, edit)| v1::ChartProposal { patch, update_mask: edit.mask(), spec: Some(edit.spec) });
        let request = v1::PlanChartsRequest { session: session.to_owned(), expected_revision: None, preview };
        Ok(send!(self.charts.plan_charts(request)))
    }

    /// Reads the chart of a patch.
    ///
    /// # Errors
    /// `PATCH_NOT_FOUND`, those of [`Client::parametrize`].
    pub async fn read_chart(&self, session: &str, patch: u32) -> Result<ChartData> {
        use read_chart_data_response::Part;
        let columns = COLUMNS.map(i32::from).to_vec();
        let request = v1::ReadChartDataRequest { session: session.to_owned(), expected_revision: None, patch, columns };
        let mut stream = self.charts().read_chart_data(request).await?.into_inner();
        let first = stream.message().await?.ok_or_else(|| ClientError::protocol("an empty stream"))?;
        let Some(Part::Header(header)) = first.part else { return Err(ClientError::protocol("chart data without a header")) };
        let mut data = Columns::default();
        while let Some(message) = stream.message().await? {
            let Some(Part::Chunk(chunk)) = message.part else { return Err(ClientError::protocol("chart data with a second header")) };
            data.push(&chunk)?;
        }
        let summary = header.chart.unwrap_or_default();
        let chart = chart_of(summary, Rows::All, data)?;
        Ok(ChartData { revision: first.revision, run: header.summary.unwrap_or_default(), ..chart })
    }

    /// Reads the chart that a patch would have under another spec. Changes nothing.
    ///
    /// # Errors
    /// Those of [`Client::update_patch_chart`]. A map that is not one-to-one is no error but a verdict.
    pub async fn preview_chart(&self, session: &str, patch: u32, edit: ChartEdit) -> Result<ChartPreview> {
        use preview_patch_chart_response::Part;
        let request = v1::PreviewPatchChartRequest {
            session: session.to_owned(),
            expected_revision: None,
            patch,
            update_mask: edit.mask(),
            spec: Some(edit.spec),
            columns: COLUMNS.map(i32::from).to_vec(),
        };
        let mut stream = self.charts().preview_patch_chart(request).await?.into_inner();
        let first = stream.message().await?.ok_or_else(|| ClientError::protocol("an empty stream"))?;
        let Some(Part::Header(header)) = first.part else { return Err(ClientError::protocol("a preview without a header")) };
        let mut data = Columns::default();
        while let Some(message) = stream.message().await? {
            let Some(Part::Chunk(chunk)) = message.part else { return Err(ClientError::protocol("a preview with a second header")) };
            data.push(&chunk)?;
        }
        let verdict = header.verdict();
        let rows = if header.has_map { Rows::All } else { Rows::NoMap };
        let chart = chart_of(header.chart.unwrap_or_default(), rows, data)?;
        let chart = ChartData { revision: first.revision, run: header.summary.unwrap_or_default(), ..chart };
        Ok(ChartPreview { chart, verdict, error: header.error, spec: header.spec.unwrap_or_default() })
    }
}

/// Which rows the columns of a chart have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rows {
    All,
    /// None in those that are about the plane.
    NoMap,
}

fn chart_of(summary: v1::ChartSummary, rows: Rows, mut data: Columns) -> Result<ChartData> {
    let (vertices, faces) = (summary.vertices, summary.faces);
    let mapped = |count| if rows == Rows::All { count } else { 0 };
    let angle: Vec<f64> = data.take_flat(DataColumn::FaceAngleDistortion, mapped(faces))?;
    let area: Vec<f64> = data.take_flat(DataColumn::FaceAreaDistortion, mapped(faces))?;
    let stretch: Vec<f64> = data.take_flat(DataColumn::FaceStretch, mapped(faces))?;
    let flipped: Vec<u32> = data.take_flat(DataColumn::FaceFlipped, mapped(faces))?;
    let chart = ChartData {
        uv: data.take(DataColumn::Uv, mapped(vertices))?,
        positions: data.take(DataColumn::Positions, vertices)?,
        triangles: data.take(DataColumn::Triangles, faces)?,
        source_vertex: data.take_flat(DataColumn::SourceVertex, vertices)?,
        source_face: data.take_flat(DataColumn::SourceFace, faces)?,
        distortion: (0..angle.len()).map(|f| FaceDistortion { angle: angle[f], area: area[f], stretch: stretch[f] }).collect(),
        flipped: flipped.into_iter().map(|f| f != 0).collect(),
        summary,
        ..ChartData::default()
    };
    check_indices(chart.triangles.iter().flatten(), chart.positions.len(), "a triangle names vertex")?;
    Ok(chart)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arrays::{pack_f64, pack_u32};

    fn columns(with_map: bool) -> Columns {
        let mut columns = Columns::default();
        let mut put = |column: DataColumn, data| columns.push(&v1::DataChunk { column: column.into(), offset: 0, data }).expect("in order");
        put(DataColumn::Positions, pack_f64(&[0.0; 9]));
        put(DataColumn::Triangles, pack_u32(&[0, 1, 2]));
        put(DataColumn::SourceVertex, pack_u32(&[4, 5, 6]));
        put(DataColumn::SourceFace, pack_u32(&[8]));
        if with_map {
            put(DataColumn::Uv, pack_f64(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]));
            for column in [DataColumn::FaceAngleDistortion, DataColumn::FaceAreaDistortion, DataColumn::FaceStretch] {
                put(column, pack_f64(&[1.5]));
            }
            put(DataColumn::FaceFlipped, pack_u32(&[1]));
        }
        columns
    }

    #[test]
    fn a_preview_may_have_no_map_and_a_chart_must_have_one() {
        let summary = || v1::ChartSummary { vertices: 3, faces: 1, ..Default::default() };
        let chart = chart_of(summary(), Rows::All, columns(true)).expect("whole");
        assert_eq!((chart.uv[1], chart.flipped[0], chart.distortion[0].stretch), ([1.0, 0.0], true, 1.5));
        let bare = chart_of(summary(), Rows::NoMap, columns(false)).expect("no map");
        assert!(bare.uv.is_empty() && bare.flipped.is_empty() && bare.triangles.len() == 1);
        assert!(chart_of(summary(), Rows::All, columns(false)).is_err());
        assert!(chart_of(summary(), Rows::NoMap, columns(true)).is_err(), "rows nobody announced");
    }
}
