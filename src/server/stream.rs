//! Streams that a call answers with: progress until the result, or bulk data cut into chunks as the client takes them.

use crate::config::CHUNK_BYTES;
use crate::dispatch::too_late;
use crate::status::status_of;
use bytes::Bytes;
use remesh_engine::work::CancelToken;
use remesh_proto::v1;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Instant;
use tokio::sync::mpsc;
use tokio_stream::Stream;
use tonic::Status;

/// Messages made one by one on demand.
pub(crate) type Chunks<M> = Box<dyn Iterator<Item = M> + Send>;

/// The stream of a response. Dropping it cancels the work behind it.
pub(crate) enum Watch<M> {
    /// Progress, then the result.
    Progress {
        /// What comes.
        receiver: mpsc::Receiver<Result<M, Status>>,
        /// Stops the work.
        token: CancelToken,
    },
    /// Bulk data, until the deadline of the call.
    Chunks(Chunks<M>, Option<Instant>),
}

impl<M> Watch<M> {
    pub(crate) fn of_progress(receiver: mpsc::Receiver<Result<M, Status>>, token: CancelToken) -> Self {
        Watch::Progress { receiver, token }
    }

    pub(crate) fn of_chunks(chunks: Chunks<M>, deadline: Option<Instant>) -> Self {
        Watch::Chunks(chunks, deadline)
    }
}

impl<M> Drop for Watch<M> {
    fn drop(&mut self) {
        if let Watch::Progress { token, .. } = self {
            token.cancel();
        }
    }
}

impl<M> Stream for Watch<M> {
    type Item = Result<M, Status>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        match &mut *self {
            Watch::Progress { receiver, .. } => receiver.poll_recv(context),
            Watch::Chunks(_, Some(deadline)) if Instant::now() > *deadline => Poll::Ready(Some(Err(status_of(&too_late().into())))),
            Watch::Chunks(chunks, _) => Poll::Ready(chunks.next().map(Ok)),
        }
    }
}

/// Packs numbers behind what there is. Of known length, so that it becomes a plain copy where the machine is little-endian.
fn pack<T: Copy, const N: usize>(values: &[T], bytes: fn(T) -> [u8; N], out: &mut Vec<u8>) {
    let begin = out.len();
    out.resize(begin + N * values.len(), 0);
    for (place, &value) in out[begin..].chunks_exact_mut(N).zip(values) {
        place.copy_from_slice(&bytes(value));
    }
}

/// The rows of a column: how many there are and how a range of them is packed.
pub(crate) struct Column {
    kind: v1::DataColumn,
    rows: usize,
    row_bytes: usize,
    pack: Box<dyn Fn(std::ops::Range<usize>, &mut Vec<u8>) + Send>,
}

impl Column {
    /// A column of `N` f64 a row; `rows` picks the array out of what is held.
    pub(crate) fn f64s<T: Send + Sync + 'static, const N: usize>(kind: v1::DataColumn, held: Arc<T>, rows: fn(&T) -> &[[f64; N]]) -> Self {
        let count = rows(&held).len();
        let pack = move |range: std::ops::Range<usize>, out: &mut Vec<u8>| {
            pack(rows(&held)[range].as_flattened(), f64::to_le_bytes, out);
        };
        Column { kind, rows: count, row_bytes: 8 * N, pack: Box::new(pack) }
    }

    /// A column of `N` u32 a row.
    pub(crate) fn u32s<T: Send + Sync + 'static, const N: usize>(kind: v1::DataColumn, held: Arc<T>, rows: fn(&T) -> &[[u32; N]]) -> Self {
        let count = rows(&held).len();
        let pack = move |range: std::ops::Range<usize>, out: &mut Vec<u8>| {
            pack(rows(&held)[range].as_flattened(), u32::to_le_bytes, out);
        };
        Column { kind, rows: count, row_bytes: 4 * N, pack: Box::new(pack) }
    }

    /// A column of one u32 a row.
    pub(crate) fn indices<T: Send + Sync + 'static>(kind: v1::DataColumn, held: Arc<T>, rows: fn(&T) -> &[u32]) -> Self {
        let count = rows(&held).len();
        let pack = move |range: std::ops::Range<usize>, out: &mut Vec<u8>| {
            pack(&rows(&held)[range], u32::to_le_bytes, out);
        };
        Column { kind, rows: count, row_bytes: 4, pack: Box::new(pack) }
    }

    /// A column of one computed f64 a row.
    pub(crate) fn computed(kind: v1::DataColumn, rows: usize, value: impl Fn(usize) -> f64 + Send + 'static) -> Self {
        let pack = move |range: std::ops::Range<usize>, out: &mut Vec<u8>| {
            range.for_each(|row| out.extend_from_slice(&value(row).to_le_bytes()));
        };
        Column { kind, rows, row_bytes: 8, pack: Box::new(pack) }
    }

    /// The pieces of the column, in order; none for an empty column.
    pub(crate) fn chunks(self) -> impl Iterator<Item = v1::DataChunk> + Send {
        let step = CHUNK_BYTES / self.row_bytes;
        (0..self.rows.div_ceil(step)).map(move |piece| {
            let range = piece * step..((piece + 1) * step).min(self.rows);
            let mut data = Vec::with_capacity(range.len() * self.row_bytes);
            let offset = (range.start * self.row_bytes) as u64;
            (self.pack)(range, &mut data);
            v1::DataChunk { column: self.kind.into(), offset, data: data.into() }
        })
    }
}

/// A file in pieces, without copying it.
pub(crate) fn file_pieces(file: Bytes) -> impl Iterator<Item = Bytes> + Send {
    let count = file.len().div_ceil(CHUNK_BYTES);
    (0..count).map(move |piece| file.slice(piece * CHUNK_BYTES..((piece + 1) * CHUNK_BYTES).min(file.len())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_come_in_whole_rows_and_join_to_the_array() {
        let points: Vec<[f64; 3]> = (0..100_000).map(|i| [f64::from(i), 0.5, -1.0]).collect();
        let column = Column::f64s(v1::DataColumn::Positions, Arc::new(points.clone()), |p| p);
        let mut joined = Vec::new();
        for chunk in column.chunks() {
            assert_eq!(chunk.offset as usize, joined.len());
            assert!(chunk.data.len() <= CHUNK_BYTES && chunk.data.len() % 24 == 0);
            joined.extend_from_slice(&chunk.data);
        }
        let wanted: Vec<u8> = points.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        assert!(joined == wanted);
    }

    #[test]
    fn empty_columns_and_files_have_no_pieces() {
        assert_eq!(Column::indices(v1::DataColumn::FacePatch, Arc::new(Vec::new()), |p: &Vec<u32>| p).chunks().count(), 0);
        assert_eq!(file_pieces(Bytes::new()).count(), 0);
        assert_eq!(file_pieces(Bytes::from(vec![0; CHUNK_BYTES + 1])).map(|p| p.len()).collect::<Vec<_>>(), [CHUNK_BYTES, 1]);
    }
}
