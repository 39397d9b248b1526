//! Bulk data as plain arrays: columns in pieces put together, and a mesh with its columns.

use crate::connection::Client;
use crate::error::{ClientError, Result};
use bytes::Bytes;
use remesh_proto::v1;
use v1::{DataColumn, read_mesh_data_response};

/// Which columns besides positions and triangles are read. Patches and features of the input cost a partition if it is not cached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshColumns {
    /// Patch of each face.
    pub patch: bool,
    /// Region of each face.
    pub region: bool,
    /// Kappa of each face.
    pub kappa: bool,
    /// Feature edges.
    pub features: bool,
    /// Wanted edge length at each vertex; needs a size to be set.
    pub size: bool,
}

impl MeshColumns {
    /// Every column that needs no size to be set.
    pub const ALL: MeshColumns = MeshColumns { patch: true, region: true, kappa: true, features: true, size: false };

    fn wanted(self) -> Vec<i32> {
        let optional = [
            (self.patch, DataColumn::FacePatch),
            (self.region, DataColumn::FaceRegion),
            (self.kappa, DataColumn::FaceKappa),
            (self.features, DataColumn::FeatureEdges),
            (self.size, DataColumn::VertexSize),
        ];
        let always = [DataColumn::Positions, DataColumn::Triangles];
        always.into_iter().chain(optional.into_iter().filter(|(on, _)| *on).map(|(_, column)| column)).map(i32::from).collect()
    }
}

/// A mesh. Columns that were not asked for are empty.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshData {
    /// Revision of the session it belongs to.
    pub revision: u64,
    /// Position of each vertex, in `unit`.
    pub positions: Vec<[f64; 3]>,
    /// Vertices of each face.
    pub triangles: Vec<[u32; 3]>,
    /// Patch of each face.
    pub patch: Vec<u32>,
    /// Region of each face, an index into `regions`.
    pub region: Vec<u32>,
    /// Kappa of each face, in [0, 1].
    pub kappa: Vec<f64>,
    /// Feature edges (for the result also boundary edges), two vertices each.
    pub features: Vec<[u32; 2]>,
    /// Wanted edge length at each vertex.
    pub size: Vec<f64>,
    /// Number of quadrangles: for `q` below it `triangles[2 q]` = (a, b, c) and `triangles[2 q + 1]` = (a, c, d) are its halves.
    pub quads: u64,
    /// The regions.
    pub regions: Vec<v1::Region>,
    /// Unit of the positions.
    pub unit: v1::LengthUnit,
}

/// The bytes of the columns as they come in.
#[derive(Default)]
pub(crate) struct Columns(Vec<(DataColumn, Vec<u8>)>);

impl Columns {
    pub(crate) fn push(&mut self, chunk: &v1::DataChunk) -> Result<()> {
        let column = chunk.column();
        let index = match self.0.iter().position(|(c, _)| *c == column) {
            Some(index) => index,
            None => {
                self.0.push((column, Vec::new()));
                self.0.len() - 1
            }
        };
        let data = &mut self.0[index].1;
        if data.len() as u64 != chunk.offset {
            return Err(ClientError::protocol(format!("a piece of {column:?} at byte {} where {} follows", chunk.offset, data.len())));
        }
        data.extend_from_slice(&chunk.data);
        Ok(())
    }

    /// The rows of a column; `count` rows are announced for it.
    pub(crate) fn take<const N: usize, T: Scalar>(&mut self, column: DataColumn, count: u64) -> Result<Vec<[T; N]>> {
        let bytes = self.0.iter_mut().find(|(c, _)| *c == column).map(|(_, data)| std::mem::take(data)).unwrap_or_default();
        let rows = rows(&bytes);
        if rows.len() as u64 != count || bytes.len() as u64 != count * (N * T::BYTES) as u64 {
            return Err(ClientError::protocol(format!("{column:?} has {} bytes where {count} rows were announced", bytes.len())));
        }
        Ok(rows)
    }

    pub(crate) fn take_flat<T: Scalar>(&mut self, column: DataColumn, count: u64) -> Result<Vec<T>> {
        Ok(self.take::<1, T>(column, count)?.into_iter().map(|[value]| value).collect())
    }
}

pub(crate) trait Scalar: Copy + Default {
    const BYTES: usize;
    fn read(bytes: &[u8]) -> Self;
}

impl Scalar for f64 {
    const BYTES: usize = 8;
    fn read(bytes: &[u8]) -> Self {
        bytes.try_into().map(f64::from_le_bytes).unwrap_or_default()
    }
}

impl Scalar for u32 {
    const BYTES: usize = 4;
    fn read(bytes: &[u8]) -> Self {
        bytes.try_into().map(u32::from_le_bytes).unwrap_or_default()
    }
}

/// Whole rows of packed little-endian numbers; a rest is left out.
fn rows<const N: usize, T: Scalar>(bytes: &[u8]) -> Vec<[T; N]> {
    let row = |chunk: &[u8]| {
        let mut values = [T::default(); N];
        for (value, piece) in values.iter_mut().zip(chunk.chunks_exact(T::BYTES)) {
            *value = T::read(piece);
        }
        values
    };
    bytes.chunks_exact(N * T::BYTES).map(row).collect()
}

/// Packs numbers as the protocol wants them (little-endian f64, no padding).
pub fn pack_f64(values: &[f64]) -> Bytes {
    values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().into()
}

/// Packs indices as the protocol wants them (little-endian u32, no padding).
pub fn pack_u32(values: &[u32]) -> Bytes {
    values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().into()
}

/// Every index must name one of `count` things, so that whoever uses the arrays may index without checks.
pub(crate) fn check_indices<'a>(indices: impl IntoIterator<Item = &'a u32>, count: usize, what: &str) -> Result<()> {
    match indices.into_iter().find(|&&index| index as usize >= count) {
        Some(index) => Err(ClientError::protocol(format!("{what} {index} of {count}"))),
        None => Ok(()),
    }
}

impl Client {
    /// Reads the input or the result of a session as arrays, with the columns asked for.
    ///
    /// # Errors
    /// `NO_MESH`; those of a remesh if the result is not cached.
    pub async fn read_mesh(&self, session: &str, source: v1::MeshSource, columns: MeshColumns) -> Result<MeshData> {
        use read_mesh_data_response::Part;
        let request = v1::ReadMeshDataRequest {
            session: session.to_owned(),
            expected_revision: None,
            source: source.into(),
            columns: columns.wanted(),
        };
        let mut stream = self.meshes().read_mesh_data(request).await?.into_inner();
        let first = stream.message().await?.ok_or_else(|| ClientError::protocol("an empty stream"))?;
        let Some(Part::Header(header)) = first.part else { return Err(ClientError::protocol("mesh data without a header")) };
        let mut data = Columns::default();
        while let Some(message) = stream.message().await? {
            let Some(Part::Chunk(chunk)) = message.part else { return Err(ClientError::protocol("mesh data with a second header")) };
            data.push(&chunk)?;
        }
        mesh_of(first.revision, header, columns, data)
    }
}

fn mesh_of(revision: u64, header: v1::MeshDataHeader, columns: MeshColumns, mut data: Columns) -> Result<MeshData> {
    let (vertices, faces) = (header.vertices, header.faces);
    let count = |on: bool| if on { faces } else { 0 };
    if header.quads > faces / 2 {
        return Err(ClientError::protocol("there are not two faces for each quadrangle"));
    }
    let mesh = MeshData {
        revision,
        unit: header.unit(),
        positions: data.take(DataColumn::Positions, vertices)?,
        triangles: data.take(DataColumn::Triangles, faces)?,
        patch: data.take_flat(DataColumn::FacePatch, count(columns.patch))?,
        region: data.take_flat(DataColumn::FaceRegion, count(columns.region))?,
        kappa: data.take_flat(DataColumn::FaceKappa, count(columns.kappa))?,
        features: data.take(DataColumn::FeatureEdges, header.feature_edges)?,
        size: data.take_flat(DataColumn::VertexSize, if columns.size { vertices } else { 0 })?,
        quads: header.quads,
        regions: header.regions,
    };
    check_indices(mesh.triangles.iter().flatten(), mesh.positions.len(), "a triangle names vertex")?;
    check_indices(mesh.features.iter().flatten(), mesh.positions.len(), "a feature edge names vertex")?;
    // A surface without named regions has one region, whether or not the table has an entry for it.
    check_indices(&mesh.region, mesh.regions.len().max(1), "a face names region")?;
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(column: DataColumn, offset: u64, data: Bytes) -> v1::DataChunk {
        v1::DataChunk { column: column.into(), offset, data }
    }

    fn tetrahedron(triangles: &[u32]) -> Columns {
        let mut columns = Columns::default();
        let positions = pack_f64(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5]);
        columns.push(&chunk(DataColumn::Positions, 0, positions.slice(..48))).expect("in order");
        columns.push(&chunk(DataColumn::Positions, 48, positions.slice(48..))).expect("in order");
        columns.push(&chunk(DataColumn::Triangles, 0, pack_u32(triangles))).expect("in order");
        columns
    }

    const HEADER: fn() -> v1::MeshDataHeader = || v1::MeshDataHeader { vertices: 4, faces: 4, ..Default::default() };

    #[test]
    fn columns_come_together() {
        let triangles = [0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3];
        let mesh = mesh_of(7, HEADER(), MeshColumns::default(), tetrahedron(&triangles)).expect("a mesh");
        assert_eq!((mesh.revision, mesh.positions[3], mesh.triangles[2]), (7, [0.0, 0.0, 1.5], [1, 2, 3]));
        assert!(mesh.patch.is_empty() && mesh.kappa.is_empty());
    }

    #[test]
    fn broken_streams_are_refused() {
        let mut columns = tetrahedron(&[0, 2, 1]);
        assert!(columns.push(&chunk(DataColumn::Triangles, 4, Bytes::new())).is_err(), "a gap");
        assert!(mesh_of(0, HEADER(), MeshColumns::default(), columns).is_err(), "too few rows");
        let bad = tetrahedron(&[0, 2, 1, 0, 1, 3, 1, 2, 4, 2, 0, 3]);
        assert!(mesh_of(0, HEADER(), MeshColumns::default(), bad).is_err(), "an index out of range");
        let absent = tetrahedron(&[0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3]);
        let wanted = MeshColumns { kappa: true, ..Default::default() };
        assert!(mesh_of(0, HEADER(), wanted, absent).is_err(), "a column is missing");
    }

    #[test]
    fn only_wanted_columns_are_asked_for() {
        assert_eq!(MeshColumns::default().wanted().len(), 2);
        assert_eq!(MeshColumns::ALL.wanted().len(), 6);
    }
}
