//! glTF 2.0, JSON or GLB: triangles of all nodes of the default scene with their transforms, one region for each material
//! (or mesh) name. Data is read from the binary chunk and from data: URIs only; no other file is opened.

use super::binary::{ByteOrder, ByteReader};
use super::raw::{RawSurface, checkpoint};
use crate::error::{EngineError, Reason, Result};
use crate::mesh::LengthUnit;
use crate::work::Work;
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use std::collections::HashMap;

fn malformed(message: impl std::fmt::Display) -> EngineError {
    EngineError::new(Reason::FormatMalformed, format!("glTF: {message}"))
}

fn unsupported(message: impl std::fmt::Display) -> EngineError {
    EngineError::new(Reason::FormatUnsupported, format!("glTF: {message}"))
}

/// An affine map: three rows of four numbers.
type Affine = [[f64; 4]; 3];

const IDENTITY: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

fn compose(outer: &Affine, inner: &Affine) -> Affine {
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let linear: f64 = (0..3).map(|k| outer[r][k] * inner[k][c]).sum();
            if c == 3 { linear + outer[r][3] } else { linear }
        })
    })
}

fn local_transform(node: &gltf::Node<'_>) -> Affine {
    match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => std::array::from_fn(|r| std::array::from_fn(|c| f64::from(matrix[c][r]))),
        gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            let [x, y, z, w] = rotation.map(f64::from);
            let rotated = [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
                [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
                [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
            ];
            std::array::from_fn(|r| {
                std::array::from_fn(|c| if c == 3 { f64::from(translation[r]) } else { rotated[r][c] * f64::from(scale[c]) })
            })
        }
    }
}

fn determinant(m: &Affine) -> f64 {
    let row = |r: usize| [m[r][0], m[r][1], m[r][2]];
    crate::vector::dot(row(0), crate::vector::cross(row(1), row(2)))
}

struct Reader<'a, 'b> {
    buffers: Vec<Vec<u8>>,
    raw: &'b mut RawSurface,
    work: &'b Work<'b>,
    /// First vertex of a position accessor under the present node.
    placed: HashMap<usize, u32>,
    skipped_primitives: u64,
    document: &'a gltf::Document,
}

pub(crate) fn read(bytes: &[u8], raw: &mut RawSurface, work: &Work<'_>) -> Result<()> {
    let binary = bytes.starts_with(b"glTF");
    raw.format = if binary { "glTF binary (GLB)" } else { "glTF JSON" }.to_owned();
    raw.unit = Some(LengthUnit::Metre);
    if binary && bytes.get(8..12).is_none_or(|l| l.first_chunk::<4>().is_none_or(|l| u32::from_le_bytes(*l) < 20)) {
        return Err(malformed("the GLB header is cut off"));
    }
    let file = parse(bytes)?;
    let required: Vec<&str> = file.document.extensions_required().collect();
    if !required.is_empty() {
        return Err(
            unsupported(format!("the file requires {}", required.join(", "))).with_hint("write it without compression or extensions")
        );
    }
    let mut blob = file.blob;
    let buffers = file.document.buffers().map(|b| buffer_data(&b, &mut blob)).collect::<Result<Vec<_>>>()?;
    let document = &file.document;
    let mut reader = Reader { buffers, raw, work, placed: HashMap::new(), skipped_primitives: 0, document };
    reader.read_scene()?;
    if reader.skipped_primitives > 0 {
        let count = reader.skipped_primitives;
        raw.warnings.push(format!("{count} primitives of points or lines were not read"));
    }
    Ok(())
}

/// Parses and validates. The validation of `gltf` 1.4 itself indexes the accessors by positions that it has not checked,
/// so those are checked first.
fn parse(bytes: &[u8]) -> Result<gltf::Gltf> {
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice_without_validation(bytes).map_err(malformed)?;
    let root = document.into_json();
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    if primitives.flat_map(|p| p.attributes.values()).any(|index| index.value() >= root.accessors.len()) {
        return Err(malformed("an attribute names an accessor that is not there"));
    }
    Ok(gltf::Gltf { document: gltf::Document::from_json(root).map_err(malformed)?, blob })
}

fn buffer_data(buffer: &gltf::Buffer<'_>, blob: &mut Option<Vec<u8>>) -> Result<Vec<u8>> {
    match buffer.source() {
        gltf::buffer::Source::Bin => blob.take().ok_or_else(|| malformed("the binary chunk is missing")),
        gltf::buffer::Source::Uri(uri) => {
            let Some((header, data)) = uri.strip_prefix("data:").and_then(|rest| rest.split_once(',')) else {
                return Err(unsupported("a buffer is in another file").with_hint("write it as GLB, or with embedded buffers"));
            };
            if !header.ends_with(";base64") {
                return Err(unsupported("a data: URI is not in base64"));
            }
            super::base64::decode(data.as_bytes()).ok_or_else(|| malformed("a data: URI is not proper base64"))
        }
    }
}

impl<'a> Reader<'a, '_> {
    /// Walks the node tree without recursion; a node that is met twice would make it endless.
    fn read_scene(&mut self) -> Result<()> {
        let document = self.document;
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let mut stack: Vec<(gltf::Node<'a>, Affine)> = match scene {
            Some(scene) => scene.nodes().map(|n| (n, IDENTITY)).collect(),
            None => document.nodes().map(|n| (n, IDENTITY)).collect(),
        };
        stack.reverse();
        let mut met = vec![false; document.nodes().count()];
        while let Some((node, outer)) = stack.pop() {
            if std::mem::replace(&mut met[node.index()], true) {
                return Err(malformed(format!("node {} has several parents", node.index())));
            }
            let place = compose(&outer, &local_transform(&node));
            if let Some(mesh) = node.mesh() {
                self.placed.clear();
                for primitive in mesh.primitives() {
                    self.read_primitive(&primitive, mesh.name().or(node.name()), &place)?;
                }
            }
            let children: Vec<_> = node.children().map(|child| (child, place)).collect();
            stack.extend(children.into_iter().rev());
        }
        Ok(())
    }

    fn read_primitive(&mut self, primitive: &gltf::Primitive<'_>, mesh_name: Option<&str>, place: &Affine) -> Result<()> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.skipped_primitives += 1;
            return Ok(());
        }
        let Some(positions) = primitive.get(&gltf::Semantic::Positions) else { return Ok(()) };
        let first = match self.placed.get(&positions.index()) {
            Some(&first) => first,
            None => {
                let first = self.read_positions(&positions, place)?;
                self.placed.insert(positions.index(), first);
                first
            }
        };
        let name = primitive.material().name().or(mesh_name).unwrap_or_default().trim();
        let region = if name.is_empty() { self.raw.regions.numbered(0, "") } else { self.raw.regions.named(name) };
        let indices = match primitive.indices() {
            Some(accessor) => self.read_indices(&accessor)?,
            None => (0..positions.count() as u32).collect(),
        };
        let limit = positions.count() as u32;
        if let Some(bad) = indices.iter().find(|&&i| i >= limit) {
            return Err(EngineError::new(Reason::IndexOutOfRange, format!("glTF: index {bad} of a primitive of {limit} vertices")));
        }
        // A mirror image turns every face.
        let mirrored = determinant(place) < 0.0;
        for (count, t) in triangles_of(mode, &indices).enumerate() {
            checkpoint(self.work, count)?;
            let [a, b, c] = t.map(|i| first + i);
            self.raw.push_triangle(if mirrored { [a, c, b] } else { [a, b, c] }, region)?;
        }
        Ok(())
    }

    /// The bytes of an accessor of tightly checked extent, its stride and count.
    fn view<'s>(buffers: &'s [Vec<u8>], accessor: &gltf::Accessor<'_>, item: usize) -> Result<(&'s [u8], usize, usize)> {
        if accessor.sparse().is_some() {
            return Err(unsupported("sparse accessors are not read"));
        }
        let view = accessor.view().ok_or_else(|| malformed("an accessor has no buffer view"))?;
        let stride = view.stride().unwrap_or(item);
        let count = accessor.count();
        let needed = count.checked_sub(1).and_then(|n| n.checked_mul(stride)).and_then(|n| n.checked_add(item)).unwrap_or(0);
        let buffer = buffers.get(view.buffer().index()).ok_or_else(|| malformed("a buffer is missing"))?;
        let inside = view.offset().checked_add(view.length()).and_then(|end| buffer.get(view.offset()..end));
        let bytes = inside.and_then(|b| b.get(accessor.offset()..)).filter(|b| b.len() >= needed && stride >= item);
        bytes.map(|b| (b, stride, count)).ok_or_else(|| malformed(format!("accessor {} reaches beyond its buffer", accessor.index())))
    }

    fn read_positions(&mut self, accessor: &gltf::Accessor<'_>, place: &Affine) -> Result<u32> {
        if accessor.data_type() != DataType::F32 || accessor.dimensions() != Dimensions::Vec3 {
            return Err(unsupported("positions that are not three 32-bit floats"));
        }
        let (bytes, stride, count) = Self::view(&self.buffers, accessor, 12)?;
        let first = self.raw.positions.len() as u32;
        for vertex in 0..count {
            checkpoint(self.work, vertex)?;
            let mut reader = ByteReader::new(&bytes[vertex * stride..], 0, ByteOrder::Little);
            let p = [f64::from(reader.f32()?), f64::from(reader.f32()?), f64::from(reader.f32()?)];
            let moved = if *place == IDENTITY {
                p
            } else {
                std::array::from_fn(|r| place[r][0] * p[0] + place[r][1] * p[1] + place[r][2] * p[2] + place[r][3])
            };
            self.raw.push_vertex(moved)?;
        }
        Ok(first)
    }

    fn read_indices(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<u32>> {
        if accessor.dimensions() != Dimensions::Scalar {
            return Err(malformed("indices that are not scalars"));
        }
        let item = match accessor.data_type() {
            DataType::U8 => 1,
            DataType::U16 => 2,
            DataType::U32 => 4,
            _ => return Err(malformed("indices that are not unsigned integers")),
        };
        let (bytes, stride, count) = Self::view(&self.buffers, accessor, item)?;
        let mut indices = Vec::with_capacity(count.min(bytes.len()));
        for at in 0..count {
            let mut reader = ByteReader::new(&bytes[at * stride..], 0, ByteOrder::Little);
            indices.push(match item {
                1 => u32::from(reader.u8()?),
                2 => u32::from(reader.u16()?),
                _ => reader.u32()?,
            });
        }
        Ok(indices)
    }
}

fn triangles_of(mode: Mode, indices: &[u32]) -> Box<dyn Iterator<Item = [u32; 3]> + '_> {
    match mode {
        Mode::TriangleStrip => {
            Box::new(indices.windows(3).enumerate().map(|(k, w)| if k.is_multiple_of(2) { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }))
        }
        Mode::TriangleFan => Box::new((2..indices.len()).map(|k| [indices[0], indices[k - 1], indices[k]])),
        _ => Box::new(indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]])),
    }
}
